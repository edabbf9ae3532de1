"""Triangle meshes: checks of the surface, nearest points, built-in shapes."""

import numpy as np
import pytest

from taxel.cloud.errors import MeshError
from taxel.cloud.mesh import TriangleMesh
from taxel.cloud.models import get_builtin_models, load_model, load_models
from taxel.grasp.shapes import ConvexPolytope

VERTICES, FACES = ConvexPolytope.box(0.06, 0.04, 0.1).mesh()


def build_box(vertices=VERTICES, faces=FACES) -> TriangleMesh:
    """Build a box of 60 x 40 x 100 mm, or a mesh with other vertices or faces."""
    return TriangleMesh("box", vertices, faces)


def test_areas_and_bounds_of_a_box_mesh_equal_those_of_the_box():
    mesh = build_box()
    assert mesh.areas.sum() == pytest.approx(2 * (0.06 * 0.04 + 0.06 * 0.1 + 0.04 * 0.1))
    assert mesh.bounds == pytest.approx(np.array([[-0.03, -0.02, 0.0], [0.03, 0.02, 0.1]]))


def test_mesh_with_inward_faces_is_turned_inside_out():
    mesh = build_box(faces=FACES[:, ::-1])
    assert mesh.compute_signed_distance(np.array([[0.0, 0.0, 0.05]])) == pytest.approx(-0.02)
    assert (mesh.normals == build_box().normals).all()


def test_mesh_with_a_hole_is_refused_in_one_line():
    with pytest.raises(MeshError, match="box: faces: expected a closed surface, found 3 edges of one face only; close"):
        build_box(faces=FACES[1:])


def test_faces_of_opposite_orientation_are_refused_in_one_line():
    faces = FACES.copy()
    faces[0] = faces[0][::-1]
    with pytest.raises(
        MeshError, match="expected faces of consistent orientation, found 3 edges between faces of opposite"
    ):
        build_box(faces=faces)


def test_edge_of_more_than_two_faces_is_refused_in_one_line():
    with pytest.raises(MeshError, match="expected edges of two faces, found 18 edges of more faces"):
        build_box(faces=np.concatenate([FACES, FACES]))


def test_vertex_with_nan_is_refused_in_one_line():
    vertices = VERTICES.copy()
    vertices[2, 1] = np.nan
    with pytest.raises(MeshError, match="box: vertices: expected finite coordinates, found 1 with NaN or infinity"):
        build_box(vertices)


@pytest.mark.parametrize("faces", [np.array([[0, 1, 8]]), np.array([[0, 1, -1]])])
def test_vertex_number_out_of_range_is_refused_in_one_line(faces):
    with pytest.raises(MeshError, match="faces: expected vertex numbers from 0 to 7"):
        build_box(faces=faces)


def test_surface_without_a_volume_is_refused_in_one_line():
    flat = VERTICES * [1.0, 1.0, 0.0]
    with pytest.raises(MeshError, match="expected a solid with a volume, found a flat surface"):
        build_box(flat)


def test_mesh_without_faces_is_refused_in_one_line():
    with pytest.raises(MeshError, match="faces: expected triangles, found none"):
        build_box(faces=np.empty((0, 3), int))


def test_samples_are_uniform_and_determined_by_the_seed():
    mesh = build_box()
    points = mesh.sample(20_000, seed=7)
    assert (points == mesh.sample(20_000, seed=7)).all()
    on_top = (points[:, 2] > 0.1 - 1e-12).mean()  # share on the top face of 60 x 40 mm
    assert on_top == pytest.approx(0.06 * 0.04 / mesh.areas.sum(), abs=0.01)


def test_nearest_points_are_classified_as_points_on_faces_edges_and_corners():
    """The box extends to x = 0.03, y = 0.02 and z = 0.1 m: each point lies outside in one, two or three directions."""
    before_face, beside_edge, beside_corner = [0.05, 0.003, 0.041], [0.04, 0.03, 0.04], [0.04, 0.03, 0.12]
    mesh = build_box()
    edge, direction, corner = mesh.find_edges_and_corners(
        mesh.find_closest(np.array([before_face, beside_edge, beside_corner]))
    )
    assert edge.tolist() == [1]
    assert np.abs(direction[0]) == pytest.approx([0.0, 0.0, 1.0])
    assert corner.tolist() == [2]


def test_points_before_and_on_a_face_have_the_normal_of_the_face():
    closest = build_box().find_closest(np.array([[0.05, 0.003, 0.041], [0.03, 0.0, 0.053]]))
    assert closest.distance == pytest.approx([0.02, 0.0], abs=1e-15)
    assert closest.normal == pytest.approx(np.array([[1.0, 0.0, 0.0]] * 2))


@pytest.mark.parametrize("name", get_builtin_models())
def test_built_in_shape_stands_on_the_plane_z_0_and_is_centred_in_x(name):
    low, high = get_builtin_models()[name].bounds
    assert low[2] == pytest.approx(0.0, abs=1e-12)
    assert high[2] > 0.05
    assert low[0] + high[0] == pytest.approx(0.0, abs=1e-12)


def test_volumes_of_built_in_shapes_equal_their_formulas_within_one_percent():
    triangles = {name: mesh.vertices[mesh.faces] for name, mesh in get_builtin_models().items()}
    volume = {name: np.linalg.det(corners).sum() / 6.0 for name, corners in triangles.items()}
    assert volume["sphere"] == pytest.approx(4.0 / 3.0 * np.pi * 0.035**3, rel=0.01)
    assert volume["cone"] == pytest.approx(np.pi * 0.035**2 * 0.13 / 3.0, rel=0.01)
    assert volume["hexagonal_prism"] == pytest.approx(1.5 * np.sqrt(3.0) * 0.03**2 * 0.13, rel=0.01)
    assert volume["cylinder"] == pytest.approx(np.pi * 0.020**2 * 0.215, rel=0.01)


def test_name_that_is_neither_a_shape_nor_a_file_is_refused_in_one_line():
    with pytest.raises(
        MeshError, match=r"mug: model: expected a mesh file or one of rectangular_prism, cylinder, .* neither"
    ):
        load_model("mug")


def test_models_are_loaded_once_by_name_and_all_built_in_shapes_without_names():
    assert list(load_models([])) == list(get_builtin_models())
    assert list(load_models(["cone", "sphere", "cone"])) == ["cone", "sphere"]
