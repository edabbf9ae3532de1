"""Contact of an object with its stand: weight, friction and rest, for the simulator and for the emulated hand."""

import numpy as np
import pytest

from taxel.campaign.free_object import FreeObject
from taxel.grasp.objects import GRAVITY_M_PER_S2, STAND_FRICTION, STAND_N_PER_M, compute_mass_properties
from taxel.grasp.shapes import ConvexPolytope, Cylinder
from taxel.hand.transforms import from_rotation_vector
from taxel.sim.stand_contact import StandContact

SHAPES = {"box": ConvexPolytope.box(0.06, 0.035, 0.2), "cylinder": Cylinder(0.02, 0.2)}
DEPTH_M = 1e-5


def shift(pose, x_m):
    """Return a copy of a pose, moved along x."""
    moved = pose.copy()
    moved[0, 3] += x_m
    return moved


@pytest.mark.parametrize("name", SHAPES)
def test_a_sunk_object_is_lifted_by_the_stiffness_of_the_stand(name):
    pose = np.eye(4)
    pose[2, 3] = -DEPTH_M
    load = StandContact(SHAPES[name], np.eye(4)).compute_load(pose)
    assert load.wrench[:3] == pytest.approx([0.0, 0.0, STAND_N_PER_M * DEPTH_M])
    assert load.wrench[3:] == pytest.approx(np.zeros(3), abs=1e-9)
    assert load.stiffness[2, 2] == pytest.approx(STAND_N_PER_M)


@pytest.mark.parametrize("name", SHAPES)
def test_an_object_sticks_to_the_stand_and_slides_at_the_friction_limit(name):
    stand, pose = StandContact(SHAPES[name], np.eye(4)), np.eye(4)
    pose[2, 3] = -DEPTH_M
    stand.compute_load(pose, advance=True)
    small = stand.compute_load(shift(pose, 0.1 * DEPTH_M), advance=True)
    assert small.wrench[0] == pytest.approx(-0.1 * STAND_N_PER_M * DEPTH_M)
    for step in range(2, 30):
        large = stand.compute_load(shift(pose, 0.1 * step * DEPTH_M), advance=True)
    assert large.wrench[0] == pytest.approx(-STAND_FRICTION * STAND_N_PER_M * DEPTH_M)
    assert large.stiffness[0, 0] == pytest.approx(0.0, abs=1e-6 * STAND_N_PER_M)


@pytest.mark.parametrize("name", SHAPES)
def test_a_tilted_object_gets_a_moment_that_turns_it_back(name):
    tilted = from_rotation_vector([1e-4, 0.0, 0.0])
    load = StandContact(SHAPES[name], np.eye(4)).compute_load(tilted)
    assert load.wrench[3] < 0.0


@pytest.mark.parametrize("name", SHAPES)
def test_weight_and_stand_of_the_emulated_hand_balance_at_rest(name):
    item = FreeObject(SHAPES[name], np.eye(4))
    weight_n = compute_mass_properties(SHAPES[name]).mass_kg * GRAVITY_M_PER_S2
    load, _ = item.compute_support()
    assert load[:3] == pytest.approx([0.0, 0.0, -weight_n])
    item.move(np.array([0.0, 0.0, -weight_n / STAND_N_PER_M, 0.0, 0.0, 0.0]), 1.0)
    load, stiffness = item.compute_support()
    assert load == pytest.approx(np.zeros(6), abs=1e-9)
    assert stiffness[2, 2] == pytest.approx(STAND_N_PER_M)
