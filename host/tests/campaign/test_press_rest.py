"""Rest of a pressed object: both solvers balance the mount's force, and come to the same place."""

from __future__ import annotations

import numpy as np
import pytest

from taxel.campaign.press import press_settings, random_press_plan
from taxel.campaign.press.errors import PressError
from taxel.campaign.press.rest import EmulatedRest
from taxel.campaign.press.soft_rest import LEVELS, SoftRest
from taxel.campaign.press.standing_layer import StandingLayer
from taxel.campaign.scatter import STILL
from taxel.campaign.session import session_world
from taxel.emulated.contact import SkinContact
from taxel.hand import load_hand
from taxel.hand.transforms import inverse
from taxel.sim.sensor_model import SimSensor
from taxel.sim.soft_contact import LayerLaw, SoftContact


@pytest.fixture(scope="module")
def hand():
    return load_hand("rig4")


@pytest.fixture(scope="module")
def plan(hand):
    return random_press_plan(hand, 0, sessions=1, repeats=1)


@pytest.fixture(scope="module")
def contact(hand, plan):
    with SkinContact(session_world(plan.setup, press_settings(hand, scatter=STILL), 0)) as opened:
        yield opened


def emulated(plan, contact, approach):
    index, centre = list(plan.objects).index(approach.object), plan.centre(approach.object)
    return EmulatedRest(contact, index, plan.bracket_poses, plan.mount, centre, approach.touch_pose, approach.direction)


def simulated(plan, approach, parts=5):
    layer = StandingLayer(plan.hand, plan.bracket_poses, LayerLaw(), parts)
    shape = plan.objects[approach.object].shape
    return SoftRest(layer, shape, plan.mount, approach.touch_pose, approach.direction)


def turned_and_moved(plan, approach, pose):
    """How far the mount's point has moved, f64[3], and by what angle the object has turned."""
    centre = np.append(plan.centre(approach.object), 1.0)
    moved = ((pose - approach.touch_pose) @ centre)[:3]
    cosine = 0.5 * (np.trace(pose[:3, :3] @ approach.touch_pose[:3, :3].T) - 1.0)
    return moved, float(np.arccos(np.clip(cosine, -1.0, 1.0)))


@pytest.mark.parametrize("number", range(8))
def test_the_emulated_skin_bears_what_the_mount_pushes_with(plan, contact, number):
    approach = plan.approaches[number]
    pressed = emulated(plan, contact, approach).press(approach.force_n)
    load = contact.load(list(plan.objects).index(approach.object), pressed.pose[-1], plan.bracket_poses)
    onto_boards = np.einsum("sij,sj->i", plan.bracket_poses[:, :3, :3], load.wrench[:, :3])
    moved, _ = turned_and_moved(plan, approach, pressed.pose[-1])
    across = moved - (moved @ approach.direction) * approach.direction
    expected = approach.force_n * approach.direction - plan.mount.n_per_m * across
    assert onto_boards == pytest.approx(expected, abs=1e-3 * approach.force_n)
    assert pressed.travel_m[-1] == pytest.approx(moved @ approach.direction + approach.force_n / plan.mount.n_per_m)
    assert (np.diff(pressed.travel_m) >= 0).all()


def test_both_sides_come_to_the_same_rest_and_the_same_counts(plan, contact):
    """To what the grain of 16 cells and of 25 springs a taxel leaves."""
    apart = []
    for approach in plan.approaches:
        index = list(plan.objects).index(approach.object)
        one = emulated(plan, contact, approach).press(approach.force_n)
        rest = simulated(plan, approach)
        other = rest.press(approach.force_n)
        assert one.pose[-1][:3, 3] == pytest.approx(rest.pose(other.motion)[:3, 3], abs=5e-5)
        assert one.travel_m[-1] == pytest.approx(other.travel_m, abs=4e-5)
        here = SimSensor().drop(contact.forces(index, one.pose[-1], plan.bracket_poses))
        there = SimSensor().drop(rest.taxel_forces(other.motion))
        felt = (here > 10.0) | (there > 10.0)
        apart.append(float(np.sqrt(np.mean((here - there)[felt] ** 2))))
    assert np.median(apart) < 8.0
    assert max(apart) < 30.0


def test_brackets_and_objects_that_are_elsewhere_are_met_elsewhere(hand, plan, contact):
    approach = next(item for item in plan.approaches if item.boards == ("sleeve",))
    shifted = ("bracket_offset sleeve 0 0 0.001 0 0 0",)
    with SkinContact(session_world(plan.setup, press_settings(hand, scatter=STILL, effects=shifted), 0)) as skin:
        nearer = emulated(plan, skin, approach).press(approach.force_n)
    usual = emulated(plan, contact, approach).press(approach.force_n)
    towards = -(plan.bracket_poses[3, :3, 2] @ approach.direction)
    assert usual.travel_m[0] - nearer.travel_m[0] == pytest.approx(1e-3 * towards, abs=4e-4)


def test_springs_that_stand_still_are_those_of_the_simulator(plan):
    """As many a taxel, one law, one geometry: `taxel.sim.soft_contact` gives the same forces."""
    for approach in plan.approaches:
        shape = plan.objects[approach.object].shape
        theirs = SoftContact(plan.hand, shape, LayerLaw()).taxel_forces(plan.bracket_poses, approach.held_pose)
        layer = StandingLayer(plan.hand, plan.bracket_poses, LayerLaw(), 3)
        ours = layer.taxel_forces(layer.near(shape, approach.held_pose), shape, approach.held_pose)
        assert theirs.sum() > 1.0
        assert ours == pytest.approx(theirs, abs=1e-9)


@pytest.mark.parametrize("number", [0, 5])
def test_rest_between_the_solved_levels_is_interpolated_to_the_noise(plan, number):
    approach = plan.approaches[number]
    rest = simulated(plan, approach)
    coarse = rest.press(approach.force_n)
    fine = rest.press(approach.force_n, tuple(sorted({*LEVELS, *np.geomspace(LEVELS[0], 1.0, 17).tolist()})))
    travel = np.linspace(coarse.path.x[0], coarse.travel_m, 20)
    drops = [
        SimSensor().drop([rest.taxel_forces(motion) for motion in press.motions(travel, approach.direction)])
        for press in (coarse, fine)
    ]
    felt = drops[1].max(axis=0) > 10.0
    assert np.sqrt(np.mean((drops[0] - drops[1])[:, felt] ** 2)) < 4.0


def test_an_object_that_meets_no_skin_is_an_error(hand, plan, contact):
    approach = plan.approaches[0]
    away = approach.touch_pose.copy()
    away[:3, 3] += 0.5
    layer = StandingLayer(hand, plan.bracket_poses, LayerLaw())
    shape, centre = plan.objects[approach.object].shape, plan.centre(approach.object)
    with pytest.raises(PressError, match="meets no skin"):
        SoftRest(layer, shape, plan.mount, away, approach.direction).press(5.0)
    with pytest.raises(PressError, match="meets no skin"):
        EmulatedRest(contact, 0, plan.bracket_poses, plan.mount, centre, away, approach.direction).press(5.0)


def test_poses_are_rigid(plan, contact):
    pressed = emulated(plan, contact, plan.approaches[1]).press(10.0)
    assert inverse(pressed.pose) @ pressed.pose == pytest.approx(np.broadcast_to(np.eye(4), pressed.pose.shape))
