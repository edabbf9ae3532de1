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
    """Import the modules of tools/objects for the tests of this file only."""
    sys.path.insert(0, str(FOLDER))
    names = ("surfaces", "clouds", "match", "objective", "search_sizes", "thesis_tables")
    yield SimpleNamespace(**{name: importlib.import_module(name) for name in names})
    for name in names:
        del sys.modules[name]
    while str(FOLDER) in sys.path:
        sys.path.remove(str(FOLDER))


def make_prisms(tool):
    """Make a box, a cylinder and a triangular prism; sizes in mm."""
    return [
        tool.surfaces.make_box(70, 40, 90),
        tool.surfaces.make_cylinder(25, 90),
        tool.surfaces.make_triangle(50, 60, 90),
    ]


def sample_surface(prism, n, rng):
    """Sample n random points on the sides and n on both ends of a prism, f64[2 n, 3], in mm."""
    curve, _ = prism.profile.evaluate(rng.random(n))
    sides = np.column_stack([curve, prism.height * rng.random(n)])
    ends = np.column_stack([curve * rng.random((n, 1)), prism.height * rng.integers(0, 2, n)])
    return np.concatenate([sides, ends])


def test_nearest_point_is_on_the_surface_and_no_point_is_nearer(tool):
    print("seed", SEED)
    rng = np.random.default_rng(SEED)
    for prism in make_prisms(tool):
        points = rng.uniform([-60, -60, -15], [60, 60, 105], (400, 3))
        nearest = prism.nearest(points)
        np.testing.assert_allclose(prism.nearest(nearest), nearest, atol=1e-6)
        distance = np.linalg.norm(points - nearest, axis=1)
        distance_to_samples = np.linalg.norm(points[:, None] - sample_surface(prism, 2000, rng), axis=2).min(axis=1)
        assert np.all(distance <= distance_to_samples + 1e-9)
        # In mm. A sample of the surface is almost as near, so the distance is not too small either.
        assert np.median(distance_to_samples - distance) < 0.5


@pytest.mark.parametrize(
    ("point", "nearest"),
    [((0, 0, 95), (0, 0, 90)), ((50, 0, 45), (35, 0, 45)), ((38, 24, 94), (35, 20, 90)), ((0, 15, 45), (0, 20, 45))],
)
def test_nearest_points_on_the_faces_and_edges_of_a_box(tool, point, nearest):
    np.testing.assert_allclose(tool.surfaces.make_box(70, 40, 90).nearest(np.array(point, dtype=float)), nearest)


def compute_icp_error(points, prism, iterations):
    """Return the sum of squared distances (mm2) after standard ICP: nearest points, then the rigid fit of Kabsch."""
    for _ in range(iterations):
        target = prism.nearest(points)
        a, b = points - points.mean(axis=0), target - target.mean(axis=0)
        u, _, vt = np.linalg.svd(a.T @ b)
        rotation = vt.T @ np.diag([1, 1, np.sign(np.linalg.det(vt.T @ u.T))]) @ u.T
        points = a @ rotation.T + target.mean(axis=0)
    return np.sum((points - prism.nearest(points)) ** 2)


def test_registration_is_at_most_2_percent_above_the_minimum_of_icp(tool):
    """The reference is 60 iterations of standard ICP (iterative closest point) from the same starting poses."""
    samples = tool.clouds.sample_unit_cube(128, SEED)
    shapes = make_prisms(tool)
    distribution = tool.clouds.ContactDistribution(top_share=0.2, offset_mm=1.5, std_mm=0.5)
    for contacted_prism in shapes:
        cloud = tool.clouds.build_contact_cloud(contacted_prism, distribution, samples)
        for prism in shapes:
            starts = tool.match.build_starting_clouds(cloud, contacted_prism.height, prism.height)
            (distances,) = tool.match.match_clouds([starts], prism)
            lowest = min(compute_icp_error(start, prism, 60) for start in starts)
            assert np.sum(distances**2) <= 1.02 * lowest


def test_contact_points_without_random_distance_lie_at_the_offset_and_not_below_the_object(tool):
    samples = tool.clouds.sample_unit_cube(256, SEED)
    distribution = tool.clouds.ContactDistribution(top_share=0.2, offset_mm=1.5, std_mm=0.0)
    for prism in make_prisms(tool):
        cloud = tool.clouds.build_contact_cloud(prism, distribution, samples)
        np.testing.assert_allclose(np.linalg.norm(cloud - prism.nearest(cloud), axis=1), 1.5, atol=1e-6)
        assert cloud[:, 2].min() >= 0


def test_triangle_larger_than_the_other_objects_or_square_box_is_penalised(tool):
    space = tool.search_sizes.SearchSpace((120.0, 150.0), isosceles=False)
    # Sides and height of the box, radius and height of the cylinder, side and height of the triangle, mm.
    allowed = [69, 35, 130, 21, 130, 36, 130]
    square = [50, 50, 130, 25, 130, 37, 130]
    large = [70, 35, 130, 21, 130, 60, 130]
    penalties = [space.sizes(np.array(vector, dtype=float))[1] for vector in (allowed, square, large)]
    assert penalties[0] == 0
    assert min(penalties[1:]) > 0


def test_objective_of_the_selected_sizes_is_less_than_a_fifth_of_that_of_larger_sizes(tool):
    """The objective states how far the distances of modelled contact clouds deviate from the thesis; 0 for equality.

    Sizes in mm: sides and height of the box, radius and height of the cylinder, base, height and legs of the triangle.
    """
    settings = tool.objective.CloudSettings(points=128)
    selected_sizes = tool.objective.Sizes(69, 35, 130, 21, 130, 36, 130, 36)
    larger_sizes = tool.objective.Sizes(100, 60, 130, 45, 130, 70, 130, 70)
    assert 5 * tool.objective.compute_objective(selected_sizes, settings) < tool.objective.compute_objective(
        larger_sizes, settings
    )
