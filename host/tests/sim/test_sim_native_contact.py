"""The layer's contact in C against its reference in NumPy."""

import ctypes
import importlib.resources
from functools import cache

import numpy as np
import pytest

from taxel.grasp.objects import make_thesis_objects
from taxel.grasp.plan import make_thesis_approaches
from taxel.grasp.shapes import ConvexPolytope, Cylinder
from taxel.grasp.timeline import Phase, Timeline
from taxel.hand import load_hand
from taxel.hand.transforms import from_rotation_vector
from taxel.sim import closing
from taxel.sim.closing import simulate_grasp
from taxel.sim.native_contact import NativeContact, SimLibraryError, sim_library
from taxel.sim.scene import build_scene
from taxel.sim.soft_contact import LayerLaw, SoftContact

LAW = LayerLaw()
SHAPES = {
    "box": ConvexPolytope.box(0.03, 0.02, 0.03),
    "rounded box": ConvexPolytope.box(0.03, 0.02, 0.03).rounded(0.002),
    "prism": ConvexPolytope.prism(0.04, 0.05),
    "rounded prism": ConvexPolytope.prism(0.04, 0.05).rounded(0.003),
    "cylinder": Cylinder(0.015, 0.05),
}


def assert_alike(native, reference, poses, item):
    """To rounding, against the largest of the same kind: what is left of cancelling forces has no more digits."""
    got, wanted = native.load(poses, item), reference.load(poses, item)
    for ours, theirs in zip(got, wanted, strict=True):
        np.testing.assert_allclose(ours, theirs, rtol=1e-9, atol=1e-11 * max(np.abs(theirs).max(), 1e-3))
    forces = native.taxel_forces(poses, item), reference.taxel_forces(poses, item)
    np.testing.assert_allclose(*forces, rtol=1e-9, atol=1e-12)
    return wanted


@pytest.mark.parametrize("name", SHAPES)
def test_it_gives_the_references_loads(name):
    """A solid pressed into a flat board from all sides, and pulled off."""
    seed = 3
    hand, rng = load_hand("flat8"), np.random.default_rng(seed)
    native, reference = (kind(hand, SHAPES[name], LAW) for kind in (NativeContact, SoftContact))
    middle = SHAPES[name].bounds.mean(axis=0)
    pressed = 0
    for _ in range(60):
        item = from_rotation_vector(rng.normal(0.0, 1.5, 3))
        lowest = (SHAPES[name].mesh()[0] @ item[:3, :3].T)[:, 2].min()
        item[:3, 3] = [*rng.normal(0.0, 0.008, 2), rng.uniform(-0.0005, 0.003) - lowest]
        item[:2, 3] -= (item[:3, :3] @ middle)[:2]
        pressed += int(assert_alike(native, reference, np.eye(4)[None], item).wrench.any())
    assert 15 < pressed < 60, f"seed {seed}"


@pytest.mark.parametrize("name", ["box", "cylinder"])
def test_lines_along_a_face_are_lines_too(name):
    """A solid upright on the board: every line is parallel to its sides, some lie in them."""
    hand = load_hand("flat8")
    native, reference = (kind(hand, SHAPES[name], LAW) for kind in (NativeContact, SoftContact))
    item = np.eye(4)
    for height in (0.0015, 0.001, 0.0):
        item[2, 3] = height
        assert assert_alike(native, reference, np.eye(4)[None], item).wrench[0, 2] < -1.0


@cache
def scene_of(name):
    return build_scene(load_hand("allegro"), make_thesis_objects()[name], "palm")


@pytest.mark.parametrize("name", ["rectangular_prism", "cylinder"])
def test_a_grasp_comes_out_the_same(name, monkeypatch):
    scene, line = scene_of(name), Timeline(baseline_s=0.1, closing_s=1.0, hold_s=0.2, release_s=0.3, recovery_s=0.1)
    approach = next(each for each in make_thesis_approaches(withdraw_m=0.02) if each.object == name)
    native = simulate_grasp(scene, approach, line, law=LAW)
    monkeypatch.setattr(closing, "NativeContact", SoftContact)
    reference = simulate_grasp(scene, approach, line, law=LAW)
    held = native.phase <= Phase.HOLD  # fingers that let go bounce, and carry rounding farther
    assert native.taxel_force[held].max() > 1.0
    np.testing.assert_allclose(native.taxel_force[held], reference.taxel_force[held], rtol=1e-8, atol=1e-9)
    np.testing.assert_allclose(native.object_pose[held], reference.object_pose[held], atol=1e-11)
    np.testing.assert_allclose(native.wrench[held], reference.wrench[held], atol=1e-8)


def test_a_shape_that_the_library_does_not_know_is_refused():
    with pytest.raises(TypeError, match=r"expected a Cylinder or a ConvexPolytope, found object"):
        NativeContact(load_hand("flat8"), object(), LAW)


@pytest.mark.parametrize(("poses", "item"), [((2, 4, 4), (4, 4)), ((1, 3, 4), (4, 4)), ((1, 4, 4), (1, 4, 4))])
def test_poses_of_another_shape_are_refused(poses, item):
    contact = NativeContact(load_hand("flat8"), SHAPES["box"], LAW)
    with pytest.raises(ValueError, match=r"expected poses \[1, 4, 4\]"):
        contact.load(np.zeros(poses), np.zeros(item))


def test_a_library_that_is_missing_says_so(monkeypatch, tmp_path):
    monkeypatch.setattr(importlib.resources, "files", lambda package: tmp_path)
    with pytest.raises(SimLibraryError, match="install taxel again"):
        sim_library.__wrapped__()


def test_a_library_of_another_version_says_so(monkeypatch):
    monkeypatch.setattr(ctypes, "sizeof", lambda kind: 0)
    with pytest.raises(SimLibraryError, match="belongs to another version"):
        sim_library.__wrapped__()
