import numpy as np
import pytest

from taxel.grasp.controller import TORQUE_LIMIT_NM, GraspController
from taxel.grasp.plan import thesis_approaches
from taxel.grasp.timeline import Phase, Timeline
from taxel.hand.allegro.dynamics import FreeJoints

APPROACH = thesis_approaches()[0]
LINE = Timeline()
STILL = np.zeros(16)
OPEN = np.where(APPROACH.held, APPROACH.base_targets, APPROACH.open_angles)


def run(controller, angles, begin, end, step=0.003):
    """The angles that joints without load take from `begin` to `end` seconds, f64[steps, 16]."""
    joints = FreeJoints(angles)
    path = []
    for t in np.arange(begin, end, step):
        path.append(joints.step(controller.torque(t, joints.angles, joints.velocities), step))
    return np.array(path)


def test_at_rest_in_the_hold_phase_the_closing_joints_have_exactly_the_planned_torque():
    torque = GraspController(APPROACH, LINE).torque(LINE.begin(Phase.HOLD) + 0.5, OPEN + 0.7, STILL)
    closing = ~APPROACH.held
    assert np.array_equal(torque[closing], APPROACH.torque[closing])


def test_the_scale_multiplies_the_grip():
    t = LINE.begin(Phase.HOLD)
    torque = GraspController(APPROACH, LINE, torque_scale=0.5).torque(t, OPEN, STILL)
    assert np.allclose(torque, 0.5 * APPROACH.torque)
    with pytest.raises(ValueError, match="torque_scale"):
        GraspController(APPROACH, LINE, torque_scale=-1.0)


@pytest.mark.parametrize("t", [0.0, 3.0, LINE.begin(Phase.RECOVERY), 11.9])
def test_in_baseline_and_recovery_a_hand_at_its_open_angles_needs_no_torque(t):
    assert np.array_equal(GraspController(APPROACH, LINE).torque(t, OPEN, STILL), STILL)


def test_the_torque_rises_without_a_jump_and_never_exceeds_the_limit():
    controller = GraspController(APPROACH, LINE)
    torques = np.array([controller.torque(t, OPEN + 0.01, STILL) for t in np.arange(0, LINE.duration_s, 0.003)])
    assert np.abs(np.diff(torques, axis=0)).max() < 0.01
    wild = controller.torque(0.0, OPEN + 100.0, STILL + 100.0)
    assert np.abs(wild).max() == TORQUE_LIMIT_NM


def test_held_joints_resist_a_push_all_the_time():
    controller = GraspController(APPROACH, LINE)
    for phase in Phase:
        torque = controller.torque(LINE.begin(phase), OPEN + 0.01, STILL)
        assert (torque[APPROACH.held] < -0.05).all()


def test_a_free_hand_closes_to_its_stops_and_opens_again_at_the_control_period_of_the_real_one():
    controller = GraspController(APPROACH, LINE)
    path = run(controller, OPEN, LINE.begin(Phase.CLOSING), LINE.duration_s)
    closed, opened = path[round(3.4 / 0.003)], path[-1]
    assert (closed[~APPROACH.held] > OPEN[~APPROACH.held] + 1.0).all()
    assert np.abs(opened - OPEN).max() < 0.06
    assert np.abs(path[:, APPROACH.held] - OPEN[APPROACH.held]).max() < 0.02
