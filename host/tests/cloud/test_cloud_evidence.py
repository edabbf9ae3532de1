"""What touched and what did not, for shapes of which the object lay a little aside."""

from __future__ import annotations

import warnings
from dataclasses import replace

import numpy as np
import pytest

from taxel.cloud import distance_grid
from taxel.cloud.contact_cloud import ContactCloud
from taxel.cloud.distance_grid import BIN_M, BINS, HIGH_M, LOW_M, DistanceGrid
from taxel.cloud.evidence import evidence, explainer
from taxel.cloud.mesh import TriangleMesh
from taxel.cloud.models import models, sphere
from taxel.cloud.pose_average import ASIDE_M, average_over_poses
from taxel.hand.transforms import apply, from_rotation_vector

LAYER_M = 0.002


def sheet_of_taxels(middle, along, across, rows=17, columns=12):
    """Taxels 5 mm apart about a point, f64[rows * columns, 3]."""
    x, y = np.meshgrid(0.005 * (np.arange(rows) - rows // 2), 0.005 * (np.arange(columns) - columns // 2))
    return middle + x.reshape(-1, 1) * np.array(along) + y.reshape(-1, 1) * np.array(across)


SHEETS = np.concatenate(
    [
        sheet_of_taxels([0.0, 0.0315, 0.065], [1, 0, 0], [0, 0, 1]),
        sheet_of_taxels([0.033, 0.0, 0.065], [0, 1, 0], [0, 0, 1]),
        sheet_of_taxels([0.0, 0.0, 0.1315], [1, 0, 0], [0, 1, 0]),
    ]
)
"""Beside two sides and on top of an object of the size of the thesis's."""


def grasped(mesh: TriangleMesh, aside_m: float, grasps: int = 3, seed: int = 1) -> ContactCloud:
    """Grasps of an object that lies aside, in each otherwise: active is what lies within the layer."""
    rng = np.random.default_rng(seed)
    felt, quiet = [], []
    for _ in range(grasps):
        motion = from_rotation_vector(rng.normal(0.0, aside_m / 0.075, 3))
        motion[:3, 3] = rng.normal(0.0, aside_m, 3)
        active = mesh.signed_distance(apply(np.linalg.inv(motion), SHEETS)) < LAYER_M
        felt.append(SHEETS[active])
        quiet.append(SHEETS[~active])
    cloud = ContactCloud.of_points(np.concatenate(felt), name="grasped")
    return replace(
        cloud,
        grasp=np.repeat(np.arange(grasps), [len(one) for one in felt]),
        grasps=tuple(f"{row:04d}" for row in range(grasps)),
        grasp_approach=np.zeros(grasps, np.int64),
        quiet=np.concatenate(quiet),
        quiet_grasp=np.repeat(np.arange(grasps), [len(one) for one in quiet]),
    )


@pytest.mark.parametrize("name", ["cylinder", "triangular_prism"])
def test_bins_hold_the_signed_distance(name):
    mesh = models()[name]
    grid = DistanceGrid.of(mesh)
    rng = np.random.default_rng(1)
    low, high = mesh.bounds[0] - HIGH_M, mesh.bounds[1] + HIGH_M
    places = low + (high - low) * rng.random((4000, 3))
    one_each = np.stack(
        [grid.counted(place[None].astype(np.float32), 1, np.eye(3)[None], np.zeros((1, 3)))[0] for place in places]
    )
    assert (one_each.sum(axis=1) == 1).all()
    told = LOW_M + BIN_M * (one_each.argmax(axis=1) + 0.5)
    error = told - np.clip(mesh.signed_distance(places), LOW_M, HIGH_M)
    assert np.sqrt((error**2).mean()) < 0.0002
    assert np.abs(error).max() < 0.001


def test_places_are_turned_shifted_and_counted_apart():
    mesh = sphere(0.03)
    grid = DistanceGrid.of(mesh)
    places = np.array([[0.03, 0.0, 0.0], [0.0, 0.0, 0.0], [0.5, 0.0, 0.0]], np.float32)
    turn = from_rotation_vector(np.array([0.0, np.pi / 2.0, 0.0]))[:3, :3]
    counted = grid.counted(places, 1, np.stack([np.eye(3), turn]), np.array([[0.0, 0.0, 0.03], [0.0, 0.0, 0.065]]))
    assert counted.shape == (2, 2 * BINS)
    assert (counted.sum(axis=1) == 3).all()
    on_surface, above = round((0.0 - LOW_M) / BIN_M), round((0.005 - LOW_M) / BIN_M)
    assert abs(counted[0, :BINS].argmax() - on_surface) <= 2  # on the equator
    assert counted[1, 0] == 1  # turned down, to deep inside
    assert counted[0, BINS] == 1  # deep inside
    assert counted[:, -1].tolist() == [1, 1]  # far away
    assert abs(counted[1, BINS:-1].argmax() - above) <= 2  # 5 mm above the top


def test_a_large_mesh_has_a_coarser_grid(monkeypatch):
    monkeypatch.setattr(distance_grid, "MOST_CELLS", 100_000)
    monkeypatch.setattr(distance_grid, "MOST_PLACES", 20_000)
    grid = DistanceGrid.of(models()["cylinder"])
    assert grid.bins.size <= 100_000
    assert grid.cell_m > 0.001


@pytest.mark.parametrize("deviation_m", [0.0004, 0.002])
def test_the_average_over_poses_is_that_of_the_integral(deviation_m):
    """A normal likelihood about a pose of its own, which lies where the prior puts few draws."""
    true = np.array([0.003, -0.002, 0.004, 0.001, -0.003, 0.002])

    def log_likelihood(poses):
        one = -0.5 * (((poses - true) / deviation_m) ** 2).sum(axis=1)
        return np.stack([one, one - 3.0], axis=1)

    def by_hand(scale):
        variance = deviation_m**2 + scale**2
        return 6.0 * np.log(deviation_m / np.sqrt(variance)) - 0.5 * (true**2).sum() / variance

    expected = np.logaddexp(*(by_hand(scale) for scale in ASIDE_M)) - np.log(2.0)
    found = np.array([average_over_poses(log_likelihood, seed) for seed in range(8)])
    assert found[:, 0] == pytest.approx(expected, abs=0.5)
    assert np.log(np.exp(found[:, 0] - expected).mean()) == pytest.approx(0.0, abs=0.15)
    assert found[:, 1] == pytest.approx(found[:, 0] - 3.0)


def test_a_likelihood_that_says_nothing_averages_to_itself():
    assert average_over_poses(lambda poses: np.full((len(poses), 2), -5.0), 1) == pytest.approx([-5.0, -5.0], abs=0.05)


def test_the_draws_are_balanced_and_the_same_each_time():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        one = average_over_poses(lambda poses: -1e6 * (poses**2), 77)
    assert (one == average_over_poses(lambda poses: -1e6 * (poses**2), 77)).all()
    assert (one != average_over_poses(lambda poses: -1e6 * (poses**2), 78)).any()


THESIS = ("rectangular_prism", "cylinder", "triangular_prism")


@pytest.mark.parametrize("aside_m", [0.0, 0.0035])
@pytest.mark.parametrize("name", THESIS)
def test_a_shape_is_told_though_the_object_lay_aside_in_every_grasp(name, aside_m):
    cloud = grasped(models()[name], aside_m)
    told = {one: float(evidence(explainer(models()[one]).by_grasp(cloud))[0]) for one in THESIS}
    others = [told[one] for one in THESIS if one != name]
    assert told[name] > max(others) + 20.0, told


def test_a_likelihood_is_each_grasps_own():
    cloud = grasped(models()["cylinder"], 0.002)
    whole = explainer(models()["cylinder"]).by_grasp(cloud)
    assert whole.shape[0] == 3
    alone = cloud.take(cloud.grasp == 1)
    alone = replace(
        alone, quiet=cloud.quiet[cloud.quiet_grasp == 1], quiet_grasp=cloud.quiet_grasp[cloud.quiet_grasp == 1]
    )
    told = explainer(models()["cylinder"]).by_grasp(alone)
    assert (told[1] == whole[1]).all()
    assert (told[[0, 2]] == 0.0).all()


def test_the_evidence_averages_over_settings_not_over_grasps():
    by_grasp = np.log(np.array([[0.5, 0.1], [0.2, 0.4]]))
    assert evidence(by_grasp) == pytest.approx([np.log(0.5 * (0.5 * 0.2 + 0.1 * 0.4))])
    times = np.array([[2.0, 0.0], [1.0, 1.0]])
    assert evidence(by_grasp, times) == pytest.approx([np.log(0.5 * (0.25 + 0.01)), np.log(0.07)])


def test_silent_taxels_far_away_say_nothing():
    cloud = grasped(models()["cylinder"], 0.001, grasps=1)
    more = replace(
        cloud,
        quiet=np.concatenate([cloud.quiet, np.full((50, 3), 1.0)]),
        quiet_grasp=np.zeros(len(cloud.quiet) + 50, np.int64),
    )
    meet = explainer(models()["cylinder"])
    assert (meet.by_grasp(more) == meet.by_grasp(cloud)).all()


def test_a_grid_is_made_once_and_goes_with_its_mesh():
    mesh = sphere(0.02)
    assert explainer(mesh) is explainer(mesh)
    assert explainer(mesh) is not explainer(sphere(0.02))
