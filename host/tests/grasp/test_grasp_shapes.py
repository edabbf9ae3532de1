"""Rays and distances of solids agree with dense meshes and, in simple cases, with formulas."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from taxel.grasp.shapes import ConvexPolytope, Cylinder, ShapeError

BOX = ConvexPolytope.box(0.09, 0.055, 0.14)
PRISM = ConvexPolytope.prism(0.055, 0.13)
CYLINDER = Cylinder(0.03, 0.14)
HULL = ConvexPolytope.from_mesh(np.random.default_rng(7).normal((0, 0, 0.05), 0.04, size=(20, 3)))
ROUNDED = BOX.rounded(0.004)
SHAPES = {"box": BOX, "rounded": ROUNDED, "prism": PRISM, "cylinder": CYLINDER, "hull": HULL}
every_shape = pytest.mark.parametrize("shape", SHAPES.values(), ids=SHAPES)
UP, EAST, NORTH = np.eye(3)[2], np.eye(3)[0], np.eye(3)[1]


def normalise(vectors):
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def intersect_mesh(shape, point, direction, resolution):
    """Intersect a line with the triangles of the mesh (Moeller and Trumbore 1997); return distances."""
    vertices, faces = shape.mesh(resolution)
    corner, b, c = vertices[faces].swapaxes(0, 1)
    side_1, side_2 = b - corner, c - corner
    h = np.cross(direction, side_2)
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse = 1 / np.sum(side_1 * h, axis=1)
        u = np.sum((point - corner) * h, axis=1) * inverse
        q = np.cross(point - corner, side_1)
        v = (q @ direction) * inverse
        t = np.sum(side_2 * q, axis=1) * inverse
    return t[(u >= -1e-12) & (v >= -1e-12) & (u + v <= 1 + 1e-12)]


@every_shape
def test_a_shared_direction_gives_the_same_result_as_separate_directions(shape):
    rng = np.random.default_rng(2)
    points = rng.uniform(-0.06, 0.16, (400, 9, 3))
    directions = normalise(rng.normal(size=(400, 1, 3)))
    directions[:3, 0] = UP, EAST, NORTH
    separation = shape.ray_separation(points, directions)
    np.testing.assert_array_equal(separation, shape.ray_separation(points, np.repeat(directions, 9, axis=1)))
    assert np.isfinite(separation).sum() > 200
    assert shape.ray_separation(points[:0], directions[:0]).shape == (0, 9)


@every_shape
def test_ray_separation_agrees_with_a_dense_mesh(shape):
    seed = 1
    rng = np.random.default_rng(seed)
    points = rng.uniform(-0.08, 0.16, (150, 3))
    directions = normalise(rng.uniform((-0.04, -0.04, 0.03), (0.04, 0.04, 0.11), (150, 3)) - points)
    separations = shape.ray_separation(points, directions)
    hits = 0
    for point, direction, separation in zip(points, directions, separations, strict=True):
        distances = intersect_mesh(shape, point, direction, 2000)
        # The ray enters at the first intersection of its line; a shape behind the point is not hit.
        expected = distances.min() if len(distances) > 1 and distances.max() >= 0 else np.inf
        if np.isfinite(expected) != np.isfinite(separation):
            # The line passes between the lateral surface and a chord of the mesh.
            assert shape is CYLINDER, f"seed {seed}"
            continue
        hits += np.isfinite(expected)
        if np.isfinite(expected):
            assert separation == pytest.approx(expected, abs=1e-5 if shape is CYLINDER else 1e-12), f"seed {seed}"
    assert hits > 40


@every_shape
def test_signed_distance_agrees_with_the_nearest_point_of_a_dense_mesh(shape):
    seed = 2
    rng = np.random.default_rng(seed)
    vertices, faces = shape.mesh(400)
    weights = rng.dirichlet(np.ones(3), size=(len(faces), 120_000 // len(faces)))
    samples = np.einsum("fsk,fkc->fsc", weights, vertices[faces]).reshape(-1, 3)
    points = rng.uniform(-0.08, 0.18, (60, 3))
    nearest = np.array([np.linalg.norm(samples - point, axis=1).min() for point in points])
    distance = shape.signed_distance(points)
    is_inside = np.isfinite(shape.ray_separation(points, UP)) & (shape.ray_separation(points, UP) < 0)
    assert ((distance < 0) == is_inside).all(), f"seed {seed}"
    # No sample is nearer than the surface, except by the error of the mesh, 5e-6 m; samples are up to 2 mm apart.
    assert (np.abs(distance) <= nearest + 5e-6).all(), f"seed {seed}"
    np.testing.assert_allclose(np.abs(distance), nearest, atol=2e-3, err_msg=f"seed {seed}")


@every_shape
def test_the_entry_point_is_on_the_surface_with_its_outward_normal(shape):
    """A step of 1e-6 m along the normal leaves the surface by 1e-6 m, and the ray opposes the normal."""
    seed = 3
    rng = np.random.default_rng(seed)
    points, directions = rng.uniform(-0.08, 0.16, (500, 3)), normalise(rng.normal(size=(500, 3)))
    separation, normal = shape.ray_entry(points, directions)
    is_hit = np.isfinite(separation)
    entry = points[is_hit] + separation[is_hit, None] * directions[is_hit]
    np.testing.assert_allclose(shape.signed_distance(entry), 0.0, atol=1e-12)
    np.testing.assert_allclose(shape.signed_distance(entry + 1e-6 * normal[is_hit]), 1e-6, atol=1e-9)
    assert (np.sum(normal[is_hit] * directions[is_hit], axis=1) < 0).all()
    assert (normal[~is_hit] == 0).all()


@every_shape
def test_the_mesh_is_closed_oriented_outwards_and_within_the_bounds(shape):
    vertices, faces = shape.mesh()
    edges = {(int(a), int(b)) for face in faces for a, b in zip(face, np.roll(face, -1), strict=True)}
    assert len(edges) == 3 * len(faces)
    assert {(b, a) for a, b in edges} == edges
    a, b, c = vertices[faces].swapaxes(0, 1)
    centre = vertices.mean(axis=0)
    assert (np.sum(np.cross(b - a, c - a) * (a - centre), axis=1) > 0).all()
    np.testing.assert_allclose([vertices.min(axis=0), vertices.max(axis=0)], shape.bounds, atol=1e-12)
    assert shape.height == pytest.approx(np.ptp(vertices[:, 2]))


@settings(max_examples=60, deadline=None)
@given(
    name=st.sampled_from(sorted(SHAPES)),
    seed=st.integers(0, 2**32 - 1),
    step=st.floats(-0.02, 0.02),
)
def test_a_step_along_the_ray_reduces_the_separation_by_the_step(name, seed, step):
    shape, rng = SHAPES[name], np.random.default_rng(seed)
    point, direction = rng.uniform(-0.05, 0.12, 3), normalise(rng.normal(size=3))
    before, after = shape.ray_separation(point, direction), shape.ray_separation(point + step * direction, direction)
    if np.isfinite(before) and np.isfinite(after):
        assert after == pytest.approx(before - step, abs=1e-9)
    # Outside, the separation along a ray is at least the distance.
    assert before >= shape.signed_distance(point) - 1e-12 or before < 0


@settings(max_examples=60, deadline=None)
@given(name=st.sampled_from(sorted(SHAPES)), seed=st.integers(0, 2**32 - 1))
def test_signed_distance_is_lipschitz_continuous_with_constant_one(name, seed):
    shape, rng = SHAPES[name], np.random.default_rng(seed)
    first = rng.uniform(-0.08, 0.16, (30, 3))
    second = first + rng.normal(scale=0.01, size=(30, 3))
    change = np.abs(shape.signed_distance(first) - shape.signed_distance(second))
    assert (change <= np.linalg.norm(first - second, axis=1) + 1e-12).all()


@pytest.mark.parametrize("shape", SHAPES.values(), ids=SHAPES)
def test_the_distance_bound_is_a_lower_bound_and_exact_inside(shape):
    points = np.random.default_rng(3).uniform(-0.15, 0.25, size=(400, 3))
    bound, distance = shape.distance_bound(points), shape.signed_distance(points)
    assert (bound <= distance + 1e-12).all()
    is_inside = distance < 0
    np.testing.assert_allclose(bound[is_inside], distance[is_inside], atol=1e-12)


def test_the_separation_of_an_inner_point_is_negative():
    # The point is the centre of both solids, so the separation is minus half the size in the given direction.
    assert BOX.ray_separation([0, 0, 0.07], EAST) == pytest.approx(-0.045)
    assert CYLINDER.ray_separation([0, 0, 0.07], EAST) == pytest.approx(-0.03)
    assert CYLINDER.ray_separation([0, 0, 0.07], UP) == pytest.approx(-0.07)
    # The nearest faces of the box are 0.0275 m away: half of its smallest size, 0.055 m.
    assert BOX.signed_distance([0, 0, 0.07]) == pytest.approx(-0.0275)


def test_a_shape_behind_the_point_is_missed():
    assert BOX.ray_separation([0.05, 0, 0.07], EAST) == np.inf
    assert CYLINDER.ray_separation([0.05, 0, 0.07], EAST) == np.inf
    assert CYLINDER.ray_separation([0, 0, 0.2], UP) == np.inf


def test_rays_parallel_to_a_face_hit_only_between_the_faces():
    """From x = -0.1 m, the box (0.09 m wide) is 0.055 m away, and the cylinder (radius 0.03 m) 0.07 m."""
    heights = np.array([-1e-6, 1e-6, 0.07, 0.14 - 1e-6, 0.14 + 1e-6])
    points = np.stack([np.full(5, -0.1), np.zeros(5), heights], axis=1)
    for shape, entry in ((BOX, 0.055), (CYLINDER, 0.07)):
        expected = [np.inf, entry, entry, entry, np.inf]
        np.testing.assert_allclose(shape.ray_separation(points, EAST), expected)


def test_rays_along_the_axis_of_a_cylinder_hit_its_caps_within_the_radius():
    """The cylinder has a radius of 0.03 m and stands from z = 0 to 0.14 m; the rays start at z = 0.2 and -0.1 m."""
    x = np.array([0.0, 0.03 - 1e-9, 0.03 + 1e-9])
    points = np.stack([x, np.zeros(3), np.full(3, 0.2)], axis=1)
    np.testing.assert_allclose(CYLINDER.ray_separation(points, -UP), [0.06, 0.06, np.inf])
    np.testing.assert_allclose(CYLINDER.ray_separation(points - [0, 0, 0.3], UP), [0.1, 0.1, np.inf])


def test_grazing_rays_hit_just_inside_and_miss_just_outside():
    """The box measures 0.09 x 0.055 m, the cylinder has a radius of 0.03 m; rays pass 1 nm from the surface."""
    for offset, hits in ((1e-9, False), (-1e-9, True)):
        assert np.isfinite(CYLINDER.ray_separation([-0.1, 0.03 + offset, 0.07], EAST)) == hits
        assert np.isfinite(BOX.ray_separation([-0.1, 0.0275 + offset, 0.07], EAST)) == hits
        # Over an edge at 45 degrees.
        start = np.array([0.045 + 0.05 + offset, 0.0275 - 0.05, 0.07])
        assert np.isfinite(BOX.ray_separation(start, normalise(NORTH - EAST))) == hits


def test_a_grazing_hit_agrees_with_the_formula():
    depth = 1e-8
    half_chord = np.sqrt(2 * 0.03 * depth - depth**2)
    assert CYLINDER.ray_separation([-0.1, 0.03 - depth, 0.07], EAST) == pytest.approx(0.1 - half_chord, abs=1e-9)


def test_distances_at_faces_edges_and_corners():
    """Half sizes of the box: 0.045, 0.0275, 0.07 m. At an edge, offsets of 3 and 4 mm give 5 mm; at a corner, 1, 2 and
    2 mm give 3 mm. The cylinder has a radius of 0.03 m and a height of 0.14 m.
    """
    np.testing.assert_allclose(BOX.signed_distance([0.055, 0, 0.07]), 0.01)
    np.testing.assert_allclose(BOX.signed_distance([0.048, 0.0315, 0.07]), 0.005)
    np.testing.assert_allclose(BOX.signed_distance([0.046, 0.0295, -0.002]), 0.003)
    np.testing.assert_allclose(CYLINDER.signed_distance([0.033, 0, 0.144]), 0.005)
    np.testing.assert_allclose(CYLINDER.signed_distance([0, 0, -0.004]), 0.004)


def test_the_prism_has_a_face_towards_positive_y():
    assert PRISM.signed_distance([0, 0.055 / (2 * np.sqrt(3)) + 0.01, 0.06]) == pytest.approx(0.01)
    assert PRISM.bounds[:, 0] == pytest.approx([-0.0275, 0.0275])


def test_leading_axes_are_batch_axes_and_broadcast():
    points = np.random.default_rng(4).uniform(-0.1, 0.1, (2, 5, 3))
    for shape in SHAPES.values():
        assert shape.ray_separation(points, UP).shape == (2, 5)
        assert shape.signed_distance(points).shape == (2, 5)
        assert shape.ray_separation(points[0, 0], UP).shape == ()
        assert shape.ray_entry(points[0, 0], UP)[1].shape == (3,)
        np.testing.assert_array_equal(shape.signed_distance(points[1, 3]), shape.signed_distance(points)[1, 3])


@pytest.mark.parametrize("shape", [BOX, PRISM], ids=["box", "prism"])
def test_a_rounded_solid_is_inside_the_solid_and_has_small_angles_between_strips(shape):
    """An edge is rounded by flat strips, at most 15 degrees apart; the original corner is outside."""
    radius, step = 0.004, np.radians(15.0)
    rounded = shape.rounded(radius, step)
    np.testing.assert_allclose(rounded.bounds[:, 2], shape.bounds[:, 2], atol=1e-12)
    assert shape.signed_distance(rounded.vertices).max() < 1e-12
    corner = shape.vertices[0]
    assert rounded.signed_distance(corner) > 0.0
    for normal in rounded.normals:
        cosines = rounded.normals @ normal
        assert np.degrees(np.arccos(np.sort(cosines)[-2])) <= 15.0 + 1e-6


def test_the_distance_from_a_rounded_to_the_sharp_edge_agrees_with_a_circle():
    """The sharp edge is sqrt(2) radii from the centre of the circle, which is one radius from the rounded edge."""
    radius = 0.004
    edge = np.array([0.045, 0.0275, 0.07])
    distance = BOX.rounded(radius, np.radians(2.0)).signed_distance(edge)
    assert distance == pytest.approx((np.sqrt(2.0) - 1.0) * radius, rel=2e-3)


def test_a_zero_radius_changes_nothing_and_a_too_large_radius_is_rejected():
    np.testing.assert_array_equal(BOX.rounded(0.0).normals, BOX.normals)
    with pytest.raises(ShapeError, match=r"radius that leaves a part of every face, found 0\.03 m"):
        BOX.rounded(0.03)
    with pytest.raises(ShapeError, match="radius of at least 0 m"):
        BOX.rounded(-0.001)


def test_duplicate_and_tangent_half_spaces_change_nothing():
    """The mesh of the box keeps its 8 vertices and 12 triangles."""
    normals = np.concatenate([BOX.normals, BOX.normals[:1], [[1.0, 1.0, 0.0]]])
    offsets = np.concatenate([BOX.offsets, BOX.offsets[:1], [0.045 + 0.0275]])
    vertices, faces = ConvexPolytope(normals, offsets).mesh()
    assert (vertices.shape, faces.shape) == ((8, 3), (12, 3))


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: ConvexPolytope.box(0.1, 0.0, 0.1), "box: expected a depth above 0 metres, found 0.0"),
        (lambda: Cylinder(float("nan"), 0.1), "cylinder: expected a radius above 0 metres, found nan"),
        (lambda: ConvexPolytope(np.eye(3), np.ones(3)), "bound a solid"),
        (lambda: ConvexPolytope(np.concatenate([np.eye(3), -np.eye(3)]), -np.ones(6)), "bound a solid"),
        (lambda: ConvexPolytope(np.zeros((4, 3)), np.ones(4)), "longer than 0"),
        (lambda: ConvexPolytope.from_mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]]), "not coplanar"),
        (lambda: CYLINDER.mesh(2), "resolution of at least 3"),
    ],
)
def test_values_that_do_not_bound_a_solid_are_rejected(make, message):
    with pytest.raises(ShapeError, match=message):
        make()
