"""Match of a cloud with models: best model, margin, lead, confidence."""

import json
from dataclasses import replace

import numpy as np
import pytest

from taxel.cloud.contact_cloud import ContactCloud
from taxel.cloud.errors import RegistrationError
from taxel.cloud.match import compute_likelihoods, match
from taxel.cloud.models import get_builtin_models
from taxel.hand.transforms import apply, from_rotation_vector


@pytest.mark.parametrize("name", get_builtin_models())
def test_shape_of_a_cloud_without_inactive_taxels_is_identified_with_a_margin_above_1_5(name, surface_cloud):
    result = match(surface_cloud(name), get_builtin_models())
    assert result.best == result.best_by_mean == name
    assert result.margin > 1.5
    assert result.confidence[name] == 1.0
    assert {fit.model for fit in result.fits} == set(get_builtin_models())


@pytest.mark.parametrize("name", ["rectangular_prism", "cone"])
def test_shape_of_a_cloud_in_an_unknown_pose_is_identified(name, surface_cloud):
    cloud = surface_cloud(name)
    rotated = cloud.transform(from_rotation_vector(np.array([2.0, -1.0, 0.5])))
    models = {model: get_builtin_models()[model] for model in ("rectangular_prism", "cone", "sphere")}
    result = match(replace(rotated, points=rotated.points + 0.3), models, in_model_frame=False)
    assert result.best == name
    assert result.fits[0].distances.rms_m < 0.001


def build_top_cloud(has_inactive: bool) -> ContactCloud:
    """Build a cloud on the top face of the triangular prism, with or without inactive taxels around the face."""
    mesh = get_builtin_models()["triangular_prism"]
    top = mesh.sample(6000, seed=2)
    top = top[(top[:, 2] > 0.215 - 1e-9)]
    x, y = np.meshgrid(np.linspace(-0.04, 0.04, 17), np.linspace(-0.04, 0.04, 17))
    around = np.column_stack([x.ravel(), y.ravel(), np.full(x.size, 0.215)])
    around = around[mesh.find_closest(around).distance > 0.004]
    cloud = ContactCloud.from_points(top, name="top")
    return (
        replace(cloud, inactive_points=around, inactive_grasp=np.zeros(len(around), np.int64))
        if has_inactive
        else cloud
    )


def test_inactive_taxels_distinguish_shapes_that_contacts_do_not():
    models = {name: get_builtin_models()[name] for name in ("rectangular_prism", "triangular_prism")}
    contacts_only = match(build_top_cloud(has_inactive=False), models)
    with_inactive = match(build_top_cloud(has_inactive=True), models)
    assert max(fit.distances.mean_m for fit in contacts_only.fits) < 1e-6  # both shapes contain all contacts
    assert with_inactive.best == "triangular_prism"
    assert with_inactive.lead > 10.0


def test_lead_is_the_difference_of_the_two_largest_evidences():
    models = {name: get_builtin_models()[name] for name in ("rectangular_prism", "triangular_prism")}
    result = match(build_top_cloud(has_inactive=True), models)
    assert result.lead == result.fits[0].evidence - result.fits[1].evidence


def test_lead_of_a_cloud_without_inactive_taxels_is_nan():
    models = {name: get_builtin_models()[name] for name in ("rectangular_prism", "triangular_prism")}
    assert np.isnan(match(build_top_cloud(has_inactive=False), models).lead)


def build_cloud_of_two_approaches() -> ContactCloud:
    """Build a cloud of two approaches with one grasp each, with the same active and inactive taxels."""
    single_approach = build_top_cloud(has_inactive=True)
    return replace(
        single_approach,
        points=np.tile(single_approach.points, (2, 1)),
        counts=np.tile(single_approach.counts, 2),
        taxel=np.tile(single_approach.taxel, 2),
        grasp=np.repeat([0, 1], len(single_approach)),
        grasps=("0000", "0001"),
        grasp_approach=np.array([0, 1]),
        approaches=("side", "top"),
        inactive_points=np.tile(single_approach.inactive_points, (2, 1)),
        inactive_grasp=np.repeat([0, 1], len(single_approach.inactive_points)),
    )


def test_match_of_one_approach_with_the_likelihoods_of_the_whole_cloud_equals_a_separate_match():
    two_approaches = build_cloud_of_two_approaches()
    models = {name: get_builtin_models()[name] for name in ("rectangular_prism", "triangular_prism")}
    likelihoods = compute_likelihoods(two_approaches, models)
    top_cloud = two_approaches.select_approach("top")
    reused, computed = match(top_cloud, models, likelihoods=likelihoods), match(top_cloud, models)
    assert [fit.to_json() for fit in reused.fits] == [fit.to_json() for fit in computed.fits]
    assert reused.lead == computed.lead


def test_confidence_is_computed_from_given_likelihoods():
    two_approaches = build_cloud_of_two_approaches()
    models = {name: get_builtin_models()[name] for name in ("rectangular_prism", "triangular_prism")}
    likelihoods = compute_likelihoods(two_approaches, models)
    assert set(match(two_approaches, models, likelihoods=likelihoods, bootstrap_samples=10).confidence) == set(models)


def test_confidence_is_the_share_of_bootstrap_samples_of_whole_grasps_and_depends_on_the_seed():
    """One grasp on the cylinder and nine on the cone: samples with few cone grasps select the cylinder."""
    points_on = {name: get_builtin_models()[name].sample(60, seed=5) for name in ("cylinder", "cone")}
    points = np.concatenate([points_on["cylinder"]] + [points_on["cone"]] * 9)
    grasp = np.repeat(np.arange(10), 60)
    cloud = ContactCloud.from_points(points)
    cloud = replace(cloud, grasp=grasp, grasps=tuple("abcdefghij"), grasp_approach=np.zeros(10, np.int64))
    models = {name: get_builtin_models()[name] for name in points_on}
    first, repeated = match(cloud, models, seed=3), match(cloud, models, seed=3)
    assert first.confidence == repeated.confidence
    assert 0.5 < first.confidence["cone"] < 1.0
    assert sum(first.confidence.values()) == pytest.approx(1.0)
    assert match(cloud, models, seed=4).confidence != first.confidence


def test_match_without_bootstrap_samples_has_no_confidence(surface_cloud):
    models = {name: get_builtin_models()[name] for name in ("cylinder", "cone")}
    assert match(surface_cloud("cone"), models, bootstrap_samples=0).confidence is None


def test_one_grasp_has_no_confidence_and_one_model_has_no_margin(surface_cloud):
    cloud = ContactCloud.from_points(surface_cloud("cone").points, name="cloud")
    result = match(cloud, {"cone": get_builtin_models()["cone"]})
    assert result.confidence is None
    assert np.isnan(result.margin)


def test_json_of_a_match_contains_null_for_nan_and_the_distances_of_each_fit(surface_cloud):
    result = match(surface_cloud("cone"), {"cone": get_builtin_models()["cone"]})
    values = json.loads(json.dumps(result.to_json(), allow_nan=False))
    assert values["margin"] is None
    assert values["lead"] is None
    assert values["fits"][0]["mean_m"] == result.fits[0].distances.mean_m


def test_distances_of_a_fit_are_those_of_the_cloud_mapped_by_its_transform(surface_cloud):
    cloud = surface_cloud("triangular_prism")
    fit = match(cloud, get_builtin_models()).fits[0]
    mesh = get_builtin_models()["triangular_prism"]
    assert mesh.find_closest(apply(fit.alignment.transform, cloud.points)).distance.mean() == fit.distances.mean_m


def test_cloud_that_cannot_be_aligned_is_refused_in_one_line(surface_cloud):
    with pytest.raises(RegistrationError, match="cone: points: expected three or more"):
        match(surface_cloud("cone").select(np.arange(2)), get_builtin_models())


def test_progress_ends_with_the_number_of_models(surface_cloud):
    calls = []
    match(surface_cloud("cone"), get_builtin_models(), progress=lambda *counts: calls.append(counts))
    assert calls[-1] == (len(get_builtin_models()), len(get_builtin_models()))
