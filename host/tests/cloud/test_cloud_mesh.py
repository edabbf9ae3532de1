"""A mesh is a closed surface, or it is refused with one line."""

from __future__ import annotations

import numpy as np
import pytest

from taxel.cloud.errors import MeshError
from taxel.cloud.mesh import TriangleMesh
from taxel.cloud.models import chosen_models, model, models
from taxel.grasp.shapes import ConvexPolytope

VERTICES, FACES = ConvexPolytope.box(0.06, 0.04, 0.1).mesh()


def box(vertices=VERTICES, faces=FACES) -> TriangleMesh:
    return TriangleMesh("box", vertices, faces)


def test_areas_and_bounds_of_a_box():
    mesh = box()
    assert mesh.areas.sum() == pytest.approx(2 * (0.06 * 0.04 + 0.06 * 0.1 + 0.04 * 0.1))
    assert mesh.bounds == pytest.approx(np.array([[-0.03, -0.02, 0.0], [0.03, 0.02, 0.1]]))


def test_a_mesh_that_is_wound_inward_is_turned_around():
    mesh = box(faces=FACES[:, ::-1])
    assert mesh.signed_distance(np.array([[0.0, 0.0, 0.05]])) == pytest.approx(-0.02)
    assert (mesh.normals == box().normals).all()


def test_a_hole_is_one_line():
    with pytest.raises(MeshError, match="box: faces: expected a closed surface, found 3 edges of one face only; close"):
        box(faces=FACES[1:])


def test_faces_wound_against_each_other_are_one_line():
    faces = FACES.copy()
    faces[0] = faces[0][::-1]
    with pytest.raises(MeshError, match="expected faces wound alike, found 3 edges between faces wound against"):
        box(faces=faces)


def test_an_edge_of_more_than_two_faces_is_one_line():
    with pytest.raises(MeshError, match="expected edges of two faces, found 18 edges of more"):
        box(faces=np.concatenate([FACES, FACES]))


def test_a_nan_is_one_line():
    vertices = VERTICES.copy()
    vertices[2, 1] = np.nan
    with pytest.raises(MeshError, match="box: vertices: expected finite coordinates, found 1 with NaN or infinity"):
        box(vertices)


@pytest.mark.parametrize("faces", [np.array([[0, 1, 8]]), np.array([[0, 1, -1]])])
def test_a_face_of_a_vertex_that_is_not_there_is_one_line(faces):
    with pytest.raises(MeshError, match="faces: expected vertex numbers from 0 to 7"):
        box(faces=faces)


def test_a_surface_without_a_volume_is_one_line():
    flat = VERTICES * [1.0, 1.0, 0.0]
    with pytest.raises(MeshError, match="expected a solid with a volume, found a flat surface"):
        box(flat)


def test_no_face_is_no_mesh():
    with pytest.raises(MeshError, match="faces: expected triangles, found none"):
        box(faces=np.empty((0, 3), int))


def test_samples_are_even_and_the_same_each_time():
    mesh = box()
    points = mesh.sample(20_000, seed=7)
    assert (points == mesh.sample(20_000, seed=7)).all()
    on_top = (points[:, 2] > 0.1 - 1e-12).mean()
    assert on_top == pytest.approx(0.06 * 0.04 / mesh.areas.sum(), abs=0.01)


def test_nearest_points_on_faces_edges_and_corners():
    mesh = box()
    near = mesh.closest(np.array([[0.05, 0.003, 0.041], [0.04, 0.03, 0.04], [0.04, 0.03, 0.12], [0.03, 0.0, 0.053]]))
    edge, along, corner = mesh.on_edges(near)
    assert edge.tolist() == [1]
    assert np.abs(along[0]) == pytest.approx([0.0, 0.0, 1.0])
    assert corner.tolist() == [2]
    assert near.normal[0] == pytest.approx([1.0, 0.0, 0.0])
    assert near.normal[3] == pytest.approx([1.0, 0.0, 0.0])  # on the surface: that of its face
    assert near.distance[3] < 1e-15


@pytest.mark.parametrize("name", models())
def test_built_in_shapes_stand_on_the_ground_upright(name):
    low, high = models()[name].bounds
    assert low[2] == pytest.approx(0.0, abs=1e-12)
    assert high[2] > 0.05
    assert low[:2] + high[:2] == pytest.approx([0.0, high[1] + low[1]], abs=1e-12)


def test_shapes_have_the_volumes_of_their_formulas():
    parts = {name: mesh.vertices[mesh.faces] for name, mesh in models().items()}
    volume = {name: np.linalg.det(corners).sum() / 6.0 for name, corners in parts.items()}
    assert volume["sphere"] == pytest.approx(4.0 / 3.0 * np.pi * 0.035**3, rel=0.01)
    assert volume["cone"] == pytest.approx(np.pi * 0.035**2 * 0.13 / 3.0, rel=0.01)
    assert volume["hexagonal_prism"] == pytest.approx(1.5 * np.sqrt(3.0) * 0.03**2 * 0.13, rel=0.01)
    assert volume["cylinder"] == pytest.approx(np.pi * 0.021**2 * 0.13, rel=0.01)


def test_a_name_that_is_neither_a_shape_nor_a_file_is_one_line():
    with pytest.raises(
        MeshError, match=r"mug: model: expected a mesh file or one of rectangular_prism, cylinder, .* neither"
    ):
        model("mug")


def test_models_are_chosen_by_name_and_file_or_all(tmp_path):
    assert list(chosen_models([])) == list(models())
    assert list(chosen_models(["cone", "sphere", "cone"])) == ["cone", "sphere"]
