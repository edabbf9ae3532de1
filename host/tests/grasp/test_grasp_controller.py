"""Torques of the grasp controller over the phases of a grasp."""

import numpy as np
import pytest

from taxel.grasp.controller import TORQUE_LIMIT_NM, GraspController
from taxel.grasp.plan import make_thesis_approaches
from taxel.grasp.timeline import Phase, Timeline
from taxel.hand.allegro.dynamics import FreeJoints

APPROACH = make_thesis_approaches()[0]
TIMELINE = Timeline()
AT_REST = np.zeros(16)
OPEN = np.where(APPROACH.is_held, APPROACH.base_targets, APPROACH.open_angles)


def simulate(controller, angles, start_s, end_s, step_s=0.003):
    """Simulate joints without load from `start_s` to `end_s`; return their angles, f64[steps, 16]."""
    joints = FreeJoints(angles)
    path = []
    for t in np.arange(start_s, end_s, step_s):
        path.append(joints.step(controller.compute_torque(t, joints.angles, joints.velocities), step_s))
    return np.array(path)


def test_closing_joints_at_rest_in_the_hold_phase_have_the_planned_torque():
    torque = GraspController(APPROACH, TIMELINE).compute_torque(
        TIMELINE.get_start_s(Phase.HOLD) + 0.5, OPEN + 0.7, AT_REST
    )
    is_closing = ~APPROACH.is_held
    assert np.array_equal(torque[is_closing], APPROACH.torque[is_closing])


def test_the_torque_scale_multiplies_the_closing_torques():
    t = TIMELINE.get_start_s(Phase.HOLD)
    torque = GraspController(APPROACH, TIMELINE, torque_scale=0.5).compute_torque(t, OPEN, AT_REST)
    assert np.allclose(torque, 0.5 * APPROACH.torque)


def test_a_negative_torque_scale_is_rejected():
    with pytest.raises(ValueError, match="torque_scale"):
        GraspController(APPROACH, TIMELINE, torque_scale=-1.0)


@pytest.mark.parametrize("t", [0.0, 3.0, TIMELINE.get_start_s(Phase.RECOVERY), 11.9])
def test_a_hand_at_its_open_angles_has_no_torque_in_baseline_and_recovery(t):
    assert np.array_equal(GraspController(APPROACH, TIMELINE).compute_torque(t, OPEN, AT_REST), AT_REST)


def test_the_torque_is_continuous_and_limited():
    controller = GraspController(APPROACH, TIMELINE)
    torques = np.array(
        [controller.compute_torque(t, OPEN + 0.01, AT_REST) for t in np.arange(0, TIMELINE.duration_s, 0.003)]
    )
    assert np.abs(np.diff(torques, axis=0)).max() < 0.08  # the followed angle moves by 7 mrad per period
    limited = controller.compute_torque(0.0, OPEN + 100.0, AT_REST + 100.0)
    assert np.abs(limited).max() == TORQUE_LIMIT_NM


def test_held_joints_resist_a_displacement_in_every_phase():
    """A displacement of +0.01 rad causes a torque of more than 0.05 N m in the opposite direction."""
    controller = GraspController(APPROACH, TIMELINE)
    for phase in Phase:
        torque = controller.compute_torque(TIMELINE.get_start_s(phase), OPEN + 0.01, AT_REST)
        assert (torque[APPROACH.is_held] < -0.05).all()


def test_a_free_hand_closes_to_its_stops_and_opens_again():
    """Closing joints move by more than 1 rad and return within 0.06 rad; held joints stay within 0.02 rad."""
    controller = GraspController(APPROACH, TIMELINE)
    path = simulate(controller, OPEN, TIMELINE.get_start_s(Phase.CLOSING), TIMELINE.duration_s)
    end_of_hold_s = TIMELINE.get_end_s(Phase.HOLD) - TIMELINE.get_start_s(Phase.CLOSING)
    closed, opened = path[round(end_of_hold_s / 0.003) - 1], path[-1]
    assert (closed[~APPROACH.is_held] > OPEN[~APPROACH.is_held] + 1.0).all()
    assert np.abs(opened - OPEN).max() < 0.06
    assert np.abs(path[:, APPROACH.is_held] - OPEN[APPROACH.is_held]).max() < 0.02
