"""The compiled library for rays and polytopes agrees with the NumPy method `ray_entry`, and reports a wrong library."""

import ctypes
import importlib.resources

import numpy as np
import pytest

from taxel.grasp.polytope_library import PolytopeLibraryError, load_polytope_library
from taxel.grasp.shapes import ConvexPolytope

BOX = ConvexPolytope.box(0.09, 0.055, 0.14).rounded(0.004)


@pytest.mark.parametrize("count", [1, 15, 16, 17, 100])
@pytest.mark.parametrize("points_per_line", [1, 9, 20])
def test_the_library_agrees_with_the_reference_for_every_number_of_points(count, points_per_line):
    rng = np.random.default_rng([count, points_per_line])
    points = rng.uniform(-0.08, 0.16, (count, points_per_line, 3))
    directions = rng.normal(size=(count, 1, 3))
    directions /= np.linalg.norm(directions, axis=-1, keepdims=True)
    directions[::3] = np.eye(3)[0]  # parallel to most faces of the box
    expected = BOX.ray_entry(points, np.broadcast_to(directions, points.shape))[0]
    np.testing.assert_allclose(BOX.ray_separation(points, directions), expected, rtol=1e-9, atol=1e-12)


def test_a_missing_library_gives_one_line(monkeypatch, tmp_path):
    monkeypatch.setattr(importlib.resources, "files", lambda package: tmp_path)
    with pytest.raises(PolytopeLibraryError, match="is missing from the package; install taxel again"):
        load_polytope_library.__wrapped__()


def test_a_library_of_another_version_gives_one_line(monkeypatch):
    monkeypatch.setattr(ctypes, "sizeof", lambda kind: 0)
    with pytest.raises(PolytopeLibraryError, match="belongs to another version"):
        load_polytope_library.__wrapped__()
