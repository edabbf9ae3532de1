"""Evidence of shapes from active and inactive taxels, with displaced objects."""

import warnings
from dataclasses import replace

import numpy as np
import pytest

from taxel.cloud import distance_grid
from taxel.cloud.contact_cloud import ContactCloud
from taxel.cloud.distance_grid import BIN_COUNT, BIN_WIDTH_M, MAX_DISTANCE_M, MIN_DISTANCE_M, DistanceGrid
from taxel.cloud.evidence import compute_evidence, get_shape_likelihood
from taxel.cloud.mesh import TriangleMesh
from taxel.cloud.models import build_sphere, get_builtin_models
from taxel.cloud.pose_average import POSE_STD_M, average_over_poses
from taxel.hand.transforms import apply, from_rotation_vector

LAYER_M = 0.002
"""Largest distance between an active taxel and the object in simulated grasps."""


def build_sheet(centre, along, across, rows=17, columns=12):
    """Build the positions of taxels at a 5 mm pitch around a point, f64[rows * columns, 3]."""
    x, y = np.meshgrid(0.005 * (np.arange(rows) - rows // 2), 0.005 * (np.arange(columns) - columns // 2))
    return centre + x.reshape(-1, 1) * np.array(along) + y.reshape(-1, 1) * np.array(across)


SHEETS = np.concatenate(
    [
        build_sheet([0.0, 0.0165, 0.1075], [1, 0, 0], [0, 0, 1]),
        build_sheet([0.0285, 0.0, 0.1075], [0, 1, 0], [0, 0, 1]),
        build_sheet([0.0, 0.0, 0.2165], [1, 0, 0], [0, 1, 0]),
    ]
)
"""Taxels on two sides and on top of an object with the size of those of the thesis."""


def simulate_grasps(mesh: TriangleMesh, displacement_m: float, grasps: int = 3, seed: int = 1) -> ContactCloud:
    """Simulate grasps of an object with a random displacement in each grasp; taxels within the layer are active.

    displacement_m: standard deviation of the shifts, and of the rotations times a lever arm of 75 mm.
    """
    rng = np.random.default_rng(seed)
    active_points, inactive_points = [], []
    for _ in range(grasps):
        motion = from_rotation_vector(rng.normal(0.0, displacement_m / 0.075, 3))
        motion[:3, 3] = rng.normal(0.0, displacement_m, 3)
        active = mesh.compute_signed_distance(apply(np.linalg.inv(motion), SHEETS)) < LAYER_M
        active_points.append(SHEETS[active])
        inactive_points.append(SHEETS[~active])
    cloud = ContactCloud.from_points(np.concatenate(active_points), name="simulated")
    return replace(
        cloud,
        grasp=np.repeat(np.arange(grasps), [len(points) for points in active_points]),
        grasps=tuple(f"{row:04d}" for row in range(grasps)),
        grasp_approach=np.zeros(grasps, np.int64),
        inactive_points=np.concatenate(inactive_points),
        inactive_grasp=np.repeat(np.arange(grasps), [len(points) for points in inactive_points]),
    )


@pytest.mark.parametrize("name", ["cylinder", "triangular_prism"])
def test_distance_bins_agree_with_the_signed_distance_within_0_2_mm_rms_and_1_mm_at_most(name):
    mesh = get_builtin_models()[name]
    grid = DistanceGrid.from_mesh(mesh)
    rng = np.random.default_rng(1)
    low, high = mesh.bounds[0] - MAX_DISTANCE_M, mesh.bounds[1] + MAX_DISTANCE_M
    points = low + (high - low) * rng.random((4000, 3))
    counts = np.stack(
        [grid.count_points(point[None].astype(np.float32), 1, np.eye(3)[None], np.zeros((1, 3)))[0] for point in points]
    )
    assert (counts.sum(axis=1) == 1).all()
    binned = MIN_DISTANCE_M + BIN_WIDTH_M * (counts.argmax(axis=1) + 0.5)
    error = binned - np.clip(mesh.compute_signed_distance(points), MIN_DISTANCE_M, MAX_DISTANCE_M)
    assert np.sqrt((error**2).mean()) < 0.0002
    assert np.abs(error).max() < 0.001


def test_active_and_inactive_points_are_rotated_shifted_and_counted_separately():
    mesh = build_sphere(0.03)  # rests on the plane z = 0: centre at z = 0.03, top at z = 0.06
    grid = DistanceGrid.from_mesh(mesh)
    points = np.array([[0.03, 0.0, 0.0], [0.0, 0.0, 0.0], [0.5, 0.0, 0.0]], np.float32)
    rotation = from_rotation_vector(np.array([0.0, np.pi / 2.0, 0.0]))[:3, :3]
    counted = grid.count_points(
        points,
        active_count=1,
        rotations=np.stack([np.eye(3), rotation]),
        shifts=np.array([[0.0, 0.0, 0.03], [0.0, 0.0, 0.065]]),
    )
    assert counted.shape == (2, 2 * BIN_COUNT)  # one row per pose: first the active point, then the inactive points
    assert (counted.sum(axis=1) == 3).all()
    on_surface, above = round((0.0 - MIN_DISTANCE_M) / BIN_WIDTH_M), round((0.005 - MIN_DISTANCE_M) / BIN_WIDTH_M)
    assert abs(counted[0, :BIN_COUNT].argmax() - on_surface) <= 2  # on the equator
    assert counted[1, 0] == 1  # rotated downward, deep inside
    assert counted[0, BIN_COUNT] == 1  # deep inside
    assert counted[:, -1].tolist() == [1, 1]  # far away
    assert abs(counted[1, BIN_COUNT:-1].argmax() - above) <= 2  # 5 mm above the top


def test_grid_becomes_coarser_instead_of_exceeding_its_largest_size(monkeypatch):
    monkeypatch.setattr(distance_grid, "MAX_CELLS", 100_000)
    monkeypatch.setattr(distance_grid, "MAX_SAMPLES", 20_000)
    grid = DistanceGrid.from_mesh(get_builtin_models()["cylinder"])
    assert grid.bins.size <= 100_000
    assert grid.cell_m > 0.001


@pytest.mark.parametrize("deviation_m", [0.0004, 0.002])
def test_average_over_poses_of_a_normal_likelihood_far_from_the_prior_mean_equals_the_analytical_integral(deviation_m):
    true = np.array([0.003, -0.002, 0.004, 0.001, -0.003, 0.002])

    def log_likelihood(poses):
        """Return the log likelihood for two settings, of which the second is smaller by 3 everywhere."""
        logs = -0.5 * (((poses - true) / deviation_m) ** 2).sum(axis=1)
        return np.stack([logs, logs - 3.0], axis=1)

    def compute_integral(scale):
        """Compute the log of the likelihood's mean over a normal prior of this standard deviation."""
        variance = deviation_m**2 + scale**2
        return 6.0 * np.log(deviation_m / np.sqrt(variance)) - 0.5 * (true**2).sum() / variance

    expected = np.logaddexp(*(compute_integral(scale) for scale in POSE_STD_M)) - np.log(2.0)
    averages = np.array([average_over_poses(log_likelihood, seed) for seed in range(8)])
    assert averages[:, 0] == pytest.approx(expected, abs=0.5)
    assert np.log(np.exp(averages[:, 0] - expected).mean()) == pytest.approx(0.0, abs=0.15)
    assert averages[:, 1] == pytest.approx(averages[:, 0] - 3.0)


def test_average_of_a_constant_likelihood_is_the_constant():
    assert average_over_poses(lambda poses: np.full((len(poses), 2), -5.0), 1) == pytest.approx([-5.0, -5.0], abs=0.05)


def test_average_over_poses_is_determined_by_the_seed():
    first = average_over_poses(lambda poses: -1e6 * (poses**2), 77)
    assert (first == average_over_poses(lambda poses: -1e6 * (poses**2), 77)).all()
    assert (first != average_over_poses(lambda poses: -1e6 * (poses**2), 78)).any()


def test_sampling_of_poses_raises_no_warning_of_an_unbalanced_sobol_sequence():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        average_over_poses(lambda poses: -1e6 * (poses**2), 79)  # a seed without cached samples


THESIS_OBJECTS = ("rectangular_prism", "cylinder", "triangular_prism")


@pytest.mark.parametrize("displacement_m", [0.0, 0.0035])
@pytest.mark.parametrize("name", THESIS_OBJECTS)
def test_evidence_of_the_true_shape_exceeds_that_of_others_by_20_even_if_the_object_is_displaced(name, displacement_m):
    cloud = simulate_grasps(get_builtin_models()[name], displacement_m)
    likelihoods = {
        model: get_shape_likelihood(get_builtin_models()[model]).compute_by_grasp(cloud) for model in THESIS_OBJECTS
    }
    evidence = {model: float(compute_evidence(by_grasp)[0]) for model, by_grasp in likelihoods.items()}
    assert evidence.pop(name) > max(evidence.values()) + 20.0


def test_likelihood_of_a_grasp_does_not_depend_on_other_grasps():
    cloud = simulate_grasps(get_builtin_models()["cylinder"], 0.002)
    all_grasps = get_shape_likelihood(get_builtin_models()["cylinder"]).compute_by_grasp(cloud)
    single = cloud.select(cloud.grasp == 1)
    single = replace(
        single,
        inactive_points=cloud.inactive_points[cloud.inactive_grasp == 1],
        inactive_grasp=cloud.inactive_grasp[cloud.inactive_grasp == 1],
    )
    by_grasp = get_shape_likelihood(get_builtin_models()["cylinder"]).compute_by_grasp(single)
    assert (by_grasp[1] == all_grasps[1]).all()


def test_log_likelihood_of_a_grasp_without_an_active_taxel_is_zero():
    """Only the active taxels of grasp 1 are kept, so the grasps 0 and 2 have none."""
    cloud = simulate_grasps(get_builtin_models()["cylinder"], 0.002)
    cloud = cloud.select(cloud.grasp == 1)
    by_grasp = get_shape_likelihood(get_builtin_models()["cylinder"]).compute_by_grasp(cloud)
    assert (by_grasp[[0, 2]] == 0.0).all()


def test_evidence_averages_over_reach_and_blur_and_multiplies_over_grasps():
    """Each row of `by_grasp` is a grasp, each column a pair of reach and blur.

    The evidence is the log of the mean over the columns of the product over the rows. A grasp of weight 2 counts twice.
    """
    by_grasp = np.log(np.array([[0.5, 0.1], [0.2, 0.4]]))
    assert compute_evidence(by_grasp) == pytest.approx([np.log(0.5 * (0.5 * 0.2 + 0.1 * 0.4))])
    grasp_weights = np.array([[2.0, 0.0], [1.0, 1.0]])
    assert compute_evidence(by_grasp, grasp_weights) == pytest.approx([np.log(0.5 * (0.25 + 0.01)), np.log(0.07)])


def test_distant_inactive_taxels_do_not_change_the_likelihood():
    cloud = simulate_grasps(get_builtin_models()["cylinder"], 0.001, grasps=1)
    extended = replace(
        cloud,
        inactive_points=np.concatenate([cloud.inactive_points, np.full((50, 3), 1.0)]),  # 50 taxels more than 1 m away
        inactive_grasp=np.zeros(len(cloud.inactive_points) + 50, np.int64),
    )
    likelihood = get_shape_likelihood(get_builtin_models()["cylinder"])
    assert (likelihood.compute_by_grasp(extended) == likelihood.compute_by_grasp(cloud)).all()


def test_shape_likelihood_is_created_once_for_each_mesh_object():
    mesh = build_sphere(0.02)
    assert get_shape_likelihood(mesh) is get_shape_likelihood(mesh)
    assert get_shape_likelihood(mesh) is not get_shape_likelihood(build_sphere(0.02))
