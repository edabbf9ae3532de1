"""Which shape a cloud is of, by how much, and how surely."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from taxel.cloud.contact_cloud import ContactCloud
from taxel.cloud.errors import RegistrationError
from taxel.cloud.match import likelihoods_of, match
from taxel.cloud.models import models
from taxel.hand.transforms import apply, from_rotation_vector


@pytest.mark.parametrize("name", models())
def test_a_cloud_is_told_to_be_of_its_shape(name, surface_cloud):
    found = match(surface_cloud(name), models())
    assert found.best == name
    assert found.margin > 1.5
    assert found.best_by_mean == name
    assert np.isnan(found.lead)
    assert found.confidence[name] == 1.0
    assert {fit.model for fit in found.fits} == set(models())


@pytest.mark.parametrize("name", ["rectangular_prism", "cone"])
def test_a_cloud_that_lies_anywhere_is_told_too(name, surface_cloud):
    cloud = surface_cloud(name)
    turned = cloud.moved(from_rotation_vector(np.array([2.0, -1.0, 0.5])))
    some = {one: models()[one] for one in ("rectangular_prism", "cone", "sphere")}
    found = match(replace(turned, points=turned.points + 0.3), some, placed=False)
    assert found.best == name
    assert found.fits[0].distances.rms_m < 0.001


def plate(quiet: bool) -> ContactCloud:
    """A cloud on the top face of the triangular prism, and taxels around it that felt nothing."""
    mesh = models()["triangular_prism"]
    top = mesh.sample(6000, seed=2)
    top = top[(top[:, 2] > 0.13 - 1e-9)]
    x, y = np.meshgrid(np.linspace(-0.04, 0.04, 17), np.linspace(-0.04, 0.04, 17))
    around = np.column_stack([x.ravel(), y.ravel(), np.full(x.size, 0.13)])
    around = around[mesh.closest(around).distance > 0.004]
    cloud = ContactCloud.of_points(top, name="top")
    return replace(cloud, quiet=around, quiet_grasp=np.zeros(len(around), np.int64)) if quiet else cloud


def test_silent_taxels_tell_shapes_apart_that_the_contacts_do_not():
    some = {name: models()[name] for name in ("rectangular_prism", "triangular_prism")}
    blind = match(plate(quiet=False), some)
    told = match(plate(quiet=True), some)
    assert max(fit.distances.mean_m for fit in blind.fits) < 1e-6
    assert np.isnan(blind.lead)
    assert told.best == "triangular_prism"
    assert told.lead > 10.0
    assert told.lead == told.fits[0].evidence - told.fits[1].evidence


def test_likelihoods_of_the_whole_serve_its_parts():
    whole = plate(quiet=True)
    both = replace(
        whole,
        points=np.tile(whole.points, (2, 1)),
        counts=np.tile(whole.counts, 2),
        taxel=np.tile(whole.taxel, 2),
        grasp=np.repeat([0, 1], len(whole)),
        grasps=("0000", "0001"),
        grasp_approach=np.array([0, 1]),
        approaches=("side", "top"),
        quiet=np.tile(whole.quiet, (2, 1)),
        quiet_grasp=np.repeat([0, 1], len(whole.quiet)),
    )
    some = {name: models()[name] for name in ("rectangular_prism", "triangular_prism")}
    told = likelihoods_of(both, some)
    part = both.of_approach("top")
    known, fresh = match(part, some, likelihoods=told), match(part, some)
    assert [fit.to_json() for fit in known.fits] == [fit.to_json() for fit in fresh.fits]
    assert known.lead == fresh.lead
    assert known.confidence is None
    assert set(match(both, some, likelihoods=told, draws=10).confidence) == set(some)


def test_the_confidence_is_that_of_drawing_whole_grasps():
    """Nine grasps on the cylinder and one far more telling one on the cone: without it the cylinder wins."""
    cloud_on = {name: models()[name].sample(60, seed=5) for name in ("cylinder", "cone")}
    points = np.concatenate([cloud_on["cylinder"]] + [cloud_on["cone"]] * 3)
    grasp = np.repeat(np.arange(4), 60)
    cloud = ContactCloud.of_points(points)
    cloud = replace(cloud, grasp=grasp, grasps=tuple("abcd"), grasp_approach=np.zeros(4, np.int64))
    some = {name: models()[name] for name in cloud_on}
    one, again = match(cloud, some, seed=3), match(cloud, some, seed=3)
    assert one.confidence == again.confidence
    assert 0.5 < one.confidence["cone"] < 1.0
    assert sum(one.confidence.values()) == pytest.approx(1.0)
    assert match(cloud, some, seed=4).confidence != one.confidence
    assert match(cloud, some, draws=0).confidence is None


def test_a_cloud_of_one_grasp_has_no_confidence_and_one_model_no_margin(surface_cloud):
    cloud = ContactCloud.of_points(surface_cloud("cone").points, name="mine")
    found = match(cloud, {"cone": models()["cone"]})
    assert found.confidence is None
    assert np.isnan(found.margin)
    plain = json.loads(json.dumps(found.to_json(), allow_nan=False))
    assert plain["margin"] is None
    assert plain["lead"] is None
    assert plain["fits"][0]["mean_m"] == found.fits[0].distances.mean_m


def test_the_transform_lays_the_cloud_on_the_model(surface_cloud):
    cloud = surface_cloud("triangular_prism")
    fit = match(cloud, models()).fits[0]
    mesh = models()["triangular_prism"]
    assert mesh.closest(apply(fit.alignment.transform, cloud.points)).distance.mean() == fit.distances.mean_m


def test_a_cloud_that_cannot_be_aligned_is_one_line(surface_cloud):
    with pytest.raises(RegistrationError, match="cone: points: expected three or more"):
        match(surface_cloud("cone").take(np.arange(2)), models())


def test_progress_ends_with_all_models(surface_cloud):
    told = []
    match(surface_cloud("cone"), models(), show=lambda *what: told.append(what))
    assert told[-1] == (len(models()), len(models()))
