"""The contact of the soft layer in C agrees with its reference implementation in NumPy."""

import ctypes
import importlib.resources
from functools import cache

import numpy as np
import pytest

from taxel.grasp.objects import ASSUMED_SIZES, make_thesis_objects
from taxel.grasp.plan import make_thesis_approaches
from taxel.grasp.shapes import ConvexPolytope, Cylinder
from taxel.grasp.timeline import Phase, Timeline
from taxel.hand import load_hand
from taxel.hand.transforms import from_rotation_vector
from taxel.sim import closing
from taxel.sim.closing import SimulationSettings, simulate_grasp
from taxel.sim.native_contact import NativeContact
from taxel.sim.scene import build_scene
from taxel.sim.sim_library import SimLibraryError, load_sim_library
from taxel.sim.soft_contact import LayerLaw, SoftContact
from taxel.sim.soft_push import SoftPush

LAW = LayerLaw()
SHAPES = {
    "box": ConvexPolytope.box(0.03, 0.02, 0.03),
    "rounded box": ConvexPolytope.box(0.03, 0.02, 0.03).rounded(0.002),
    "prism": ConvexPolytope.prism(0.04, 0.05),
    "rounded prism": ConvexPolytope.prism(0.04, 0.05).rounded(0.003),
    "cylinder": Cylinder(0.015, 0.05),
}


def compare_loads(native, reference, poses, object_pose):
    """Check that loads and taxel forces of both implementations agree up to rounding; return the reference load.

    The second computation also advances both: it stores where the columns stick to the object.
    """
    for advance in (False, True):
        result, expected = (model.compute_load(poses, object_pose, advance) for model in (native, reference))
        for value, expected_value in zip(result, expected, strict=True):
            compare_arrays(value, expected_value)
    forces = native.compute_taxel_forces(poses, object_pose), reference.compute_taxel_forces(poses, object_pose)
    np.testing.assert_allclose(*forces, rtol=1e-9, atol=1e-12)
    return expected


def compare_arrays(value, expected_value):
    """Check that two arrays agree up to rounding relative to the largest component."""
    np.testing.assert_allclose(value, expected_value, rtol=1e-9, atol=1e-11 * max(np.abs(expected_value).max(), 1e-3))


@pytest.mark.parametrize("name", SHAPES)
def test_loads_in_random_poses_agree_with_the_numpy_reference(name):
    """The solid touches the flat board in some of the poses and is clear of the board in the others."""
    seed = 3
    hand, rng = load_hand("flat8"), np.random.default_rng(seed)
    native, reference = (contact_class(hand, SHAPES[name], LAW) for contact_class in (NativeContact, SoftContact))
    centre = SHAPES[name].bounds.mean(axis=0)
    contact_count = 0
    for _ in range(30):
        object_pose = from_rotation_vector(rng.normal(0.0, 1.5, 3))
        lowest = (SHAPES[name].mesh()[0] @ object_pose[:3, :3].T)[:, 2].min()
        object_pose[:3, 3] = [*rng.normal(0.0, 0.008, 2), rng.uniform(-0.0005, 0.003) - lowest]
        object_pose[:2, 3] -= (object_pose[:3, :3] @ centre)[:2]
        contact_count += int(compare_loads(native, reference, np.eye(4)[None], object_pose).wrench.any())
    assert 7 < contact_count < 30, f"seed {seed}"


@pytest.mark.parametrize("name", SHAPES)
def test_loads_of_a_solid_that_slides_and_turns_agree_with_the_numpy_reference(name):
    """The steps are small, so that columns stick to the solid, are sheared, and slide."""
    seed = 5
    hand, rng = load_hand("flat8"), np.random.default_rng(seed)
    native, reference = (contact_class(hand, SHAPES[name], LAW) for contact_class in (NativeContact, SoftContact))
    object_pose = np.eye(4)
    object_pose[:3, 3] = -SHAPES[name].bounds.mean(axis=0) * [1, 1, 0]
    object_pose[2, 3] = 0.0009
    speed = np.append(rng.normal(0.0, 1e-4, 2), 0.0)
    tangential = 0.0
    for _ in range(14):
        object_pose = object_pose @ from_rotation_vector([0.0, 0.0, 0.004])
        object_pose[:3, 3] += speed
        tangential = max(
            tangential, np.abs(compare_loads(native, reference, np.eye(4)[None], object_pose).wrench[0, 5])
        )
    assert tangential > 1e-3, f"seed {seed}"


@pytest.mark.parametrize("name", ["box", "cylinder"])
def test_loads_of_an_upright_solid_agree_with_the_numpy_reference(name):
    """The axes of the columns are then parallel to the sides of the solid, and some lie in a side."""
    hand = load_hand("flat8")
    native, reference = (contact_class(hand, SHAPES[name], LAW) for contact_class in (NativeContact, SoftContact))
    object_pose = np.eye(4)
    for height in (0.0015, 0.001, 0.0):
        object_pose[2, 3] = height
        assert compare_loads(native, reference, np.eye(4)[None], object_pose).wrench[0, 2] < -1.0


@pytest.mark.parametrize("contact_class", [NativeContact, SoftContact])
def test_the_clearance_of_an_approaching_solid_is_at_most_its_distance(contact_class):
    """The clearance is a lower bound of the distance between the layer and the solid.

    The box approaches the board from 29 mm in steps of 0.3 mm, without contact.
    """
    hand = load_hand("flat8")
    contact = contact_class(hand, SHAPES["box"], LAW)
    object_pose = np.eye(4)
    lowest = SHAPES["box"].mesh()[0][:, 2].min()
    for distance in np.arange(0.029, 0.0, -0.0003):
        object_pose[2, 3] = hand.layer_m - lowest + distance
        assert not contact.compute_load(np.eye(4)[None], object_pose).wrench.any()
        assert contact.get_clearances()[0] <= distance + 1e-12


@cache
def build_object_scene(name):
    """Build the scene of the Allegro hand and the test object `name`."""
    return build_scene(load_hand("allegro"), make_thesis_objects(ASSUMED_SIZES)[name], "palm")


# The NumPy reference of a grasp with edges takes a minute; single poses with edges are compared above.
@pytest.mark.parametrize("name", [pytest.param("rectangular_prism", marks=pytest.mark.slow), "cylinder"])
def test_a_simulated_grasp_agrees_with_the_numpy_reference(name, monkeypatch):
    scene, timeline = (
        build_object_scene(name),
        Timeline(baseline_s=0.05, closing_s=0.8, hold_s=0.1, release_s=0.0, recovery_s=0.0),
    )
    approach = next(candidate for candidate in make_thesis_approaches(withdraw_m=0.02) if candidate.object == name)
    # Both runs use equal substeps. Otherwise a substep depends on distances between boards and object, which the two
    # implementations update at different times.
    monkeypatch.setattr(SoftPush, "_choose_step", lambda self, data: 0.25)
    monkeypatch.setattr(closing, "NativePush", SoftPush)
    native = simulate_grasp(scene, approach, timeline, SimulationSettings(law=LAW))
    monkeypatch.setattr(closing, "NativeContact", SoftContact)
    reference = simulate_grasp(scene, approach, timeline, SimulationSettings(law=LAW))
    until_hold = native.phase <= Phase.HOLD  # fingers bounce at release, which amplifies rounding errors
    assert native.taxel_force[until_hold].max() > 1.0
    np.testing.assert_allclose(native.taxel_force[until_hold], reference.taxel_force[until_hold], rtol=1e-3, atol=1e-3)
    np.testing.assert_allclose(native.object_pose[until_hold], reference.object_pose[until_hold], atol=1e-6)
    np.testing.assert_allclose(native.wrench[until_hold], reference.wrench[until_hold], atol=2e-3)


def test_an_unsupported_shape_is_refused():
    with pytest.raises(TypeError, match=r"expected a Cylinder or a ConvexPolytope, found object"):
        NativeContact(load_hand("flat8"), object(), LAW)


@pytest.mark.parametrize(("poses", "object_pose"), [((2, 4, 4), (4, 4)), ((1, 3, 4), (4, 4)), ((1, 4, 4), (1, 4, 4))])
def test_poses_of_another_shape_are_refused(poses, object_pose):
    contact = NativeContact(load_hand("flat8"), SHAPES["box"], LAW)
    with pytest.raises(ValueError, match=r"expected poses \[1, 4, 4\]"):
        contact.compute_load(np.zeros(poses), np.zeros(object_pose))


def test_a_missing_library_is_reported_with_the_remedy(monkeypatch, tmp_path):
    monkeypatch.setattr(importlib.resources, "files", lambda package: tmp_path)
    with pytest.raises(SimLibraryError, match="install taxel again"):
        load_sim_library.__wrapped__()


def test_a_library_of_another_version_is_refused(monkeypatch):
    monkeypatch.setattr(ctypes, "sizeof", lambda kind: 0)
    with pytest.raises(SimLibraryError, match="belongs to another version"):
        NativeContact(load_hand("flat8"), SHAPES["box"], LAW)
