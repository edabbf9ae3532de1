"""The search for the sizes of the test objects: nearest points, registration, and the objective of given sizes."""

import importlib
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

FOLDER = Path(__file__).resolve().parents[3] / "tools" / "objects"
SEED = 20


@pytest.fixture(scope="module")
def tool():
    sys.path.insert(0, str(FOLDER))
    names = ("surfaces", "clouds", "match", "objective", "search_sizes", "thesis_tables")
    yield SimpleNamespace(**{name: importlib.import_module(name) for name in names})
    for name in names:
        del sys.modules[name]
    while str(FOLDER) in sys.path:
        sys.path.remove(str(FOLDER))


def prisms(tool):
    return [
        tool.surfaces.make_box(70, 40, 90),
        tool.surfaces.make_cylinder(25, 90),
        tool.surfaces.make_triangle(50, 60, 90),
    ]


def surface_points(prism, n, rng):
    """Points of the sides and both ends; for the ends, the curve pulled towards the axis."""
    curve, _ = prism.profile.evaluate(rng.random(n))
    sides = np.column_stack([curve, prism.height * rng.random(n)])
    ends = np.column_stack([curve * rng.random((n, 1)), prism.height * rng.integers(0, 2, n)])
    return np.concatenate([sides, ends])


def test_nearest_point_is_on_the_surface_and_no_point_is_nearer(tool):
    print("seed", SEED)
    rng = np.random.default_rng(SEED)
    for prism in prisms(tool):
        points = rng.uniform([-60, -60, -15], [60, 60, 105], (400, 3))
        nearest = prism.nearest(points)
        np.testing.assert_allclose(prism.nearest(nearest), nearest, atol=1e-6)
        distance = np.linalg.norm(points - nearest, axis=1)
        to_samples = np.linalg.norm(points[:, None] - surface_points(prism, 2000, rng), axis=2).min(axis=1)
        assert np.all(distance <= to_samples + 1e-9)
        assert np.median(to_samples - distance) < 0.5


@pytest.mark.parametrize(
    ("point", "nearest"),
    [((0, 0, 95), (0, 0, 90)), ((50, 0, 45), (35, 0, 45)), ((38, 24, 94), (35, 20, 90)), ((0, 15, 45), (0, 20, 45))],
)
def test_nearest_points_of_a_box(tool, point, nearest):
    np.testing.assert_allclose(tool.surfaces.make_box(70, 40, 90).nearest(np.array(point, dtype=float)), nearest)


def closest_point_iteration(points, prism, iterations):
    """Sum of squared distances after standard ICP: closest points, then the rigid fit of Kabsch."""
    for _ in range(iterations):
        target = prism.nearest(points)
        a, b = points - points.mean(axis=0), target - target.mean(axis=0)
        u, _, vt = np.linalg.svd(a.T @ b)
        turn = vt.T @ np.diag([1, 1, np.sign(np.linalg.det(vt.T @ u.T))]) @ u.T
        points = a @ turn.T + target.mean(axis=0)
    return np.sum((points - prism.nearest(points)) ** 2)


def test_registration_reaches_the_minimum_of_icp(tool):
    samples = tool.clouds.unit_samples(128, SEED)
    shapes = prisms(tool)
    distribution = tool.clouds.ContactDistribution(top_share=0.2, offset_mm=1.5, std_mm=0.5)
    for cloud_of in shapes:
        cloud = tool.clouds.contact_cloud(cloud_of, distribution, samples)
        for prism in shapes:
            starts = tool.match.starting_clouds(cloud, cloud_of.height, prism.height)
            (distances,) = tool.match.match_clouds([starts], prism)
            lowest = min(closest_point_iteration(start, prism, 60) for start in starts)
            assert np.sum(distances**2) <= 1.02 * lowest


def test_points_without_random_distance_are_outside_and_not_under_the_object(tool):
    samples = tool.clouds.unit_samples(256, SEED)
    distribution = tool.clouds.ContactDistribution(top_share=0.2, offset_mm=1.5, std_mm=0.0)
    for prism in prisms(tool):
        cloud = tool.clouds.contact_cloud(prism, distribution, samples)
        np.testing.assert_allclose(np.linalg.norm(cloud - prism.nearest(cloud), axis=1), 1.5, atol=1e-6)
        assert cloud[:, 2].min() >= 0


def test_triangle_larger_than_the_other_objects_or_square_box_is_penalised(tool):
    space = tool.search_sizes.SearchSpace((120.0, 150.0), isosceles=False)
    allowed = [69, 35, 130, 21, 130, 36, 130]
    square = [50, 50, 130, 25, 130, 37, 130]
    large = [70, 35, 130, 21, 130, 60, 130]
    penalties = [space.sizes(np.array(vector, dtype=float))[1] for vector in (allowed, square, large)]
    assert penalties[0] == 0
    assert min(penalties[1:]) > 0


def test_objective_is_lower_for_the_found_sizes(tool):
    settings = tool.objective.CloudSettings(points=128)
    good = tool.objective.Sizes(69, 35, 130, 21, 130, 36, 130, 36)
    bad = tool.objective.Sizes(100, 60, 130, 45, 130, 70, 130, 70)
    assert 5 * tool.objective.compute_objective(good, settings) < tool.objective.compute_objective(bad, settings)
