"""Joint dynamics of the emulated hand: equilibrium on an object, joint limits, time step."""

from collections.abc import Iterator

import numpy as np
import pytest

from taxel.campaign import hand_in_contact
from taxel.campaign.free_object import FreeObject
from taxel.campaign.hand_in_contact import JOINT_DAMPING_NM_S, JOINT_FRICTION_NM, SUBSTEP_S, HandInContact
from taxel.emulated.contact import SkinContact
from taxel.emulated.scene import EmulatedScene, format_scene
from taxel.grasp.controller import GraspController
from taxel.grasp.timeline import Timeline
from taxel.hand.kinematics import Kinematics
from taxel.hand.transforms import from_rotation_vector, inverse, to_rotation_vector

PERIOD_S = 0.003
CLOSED = Timeline(baseline_s=0.0, closing_s=0.5, hold_s=9.0, release_s=0.0, recovery_s=0.0)
GENTLE = Timeline(baseline_s=0.0, closing_s=2.0, hold_s=9.0, release_s=0.0, recovery_s=0.0)
BRACKET_OFFSET = from_rotation_vector([0.01, -0.02, 0.015])
BRACKET_OFFSET[:3, 3] = 2e-4, -1e-4, 3e-4


@pytest.fixture(scope="module")
def contact(setup) -> Iterator[SkinContact]:
    """Yield a contact solver of the cylinder and a skin whose brackets are all displaced."""
    brackets = {board.name: BRACKET_OFFSET for board in setup.hand.boards}
    scene = EmulatedScene({"cylinder": setup.objects["cylinder"].shape}, brackets)
    with SkinContact(format_scene(setup.hand, scene)) as skin_contact:
        yield skin_contact


@pytest.fixture(scope="module")
def approach(setup, plan):
    return setup.approach(plan[0])


@pytest.fixture(scope="module")
def open_hand(setup, contact, approach):
    """Return a function that makes an open hand around the cylinder."""

    def make(index: int = 0) -> HandInContact:
        """Make the hand. index: number of the object that the skin can touch; -1: none."""
        pose = setup.object_pose("cylinder")
        wrist = pose @ approach.palm_pose
        item = FreeObject(setup.objects["cylinder"].shape, pose)
        return HandInContact(setup.hand, setup.wrist_robot, contact, index, item, wrist, approach.open_angles)

    return make


def close_hand(dynamics: HandInContact, approach, seconds: float, timeline: Timeline = CLOSED) -> np.ndarray:
    """Control the hand for a time, seconds, in which it closes and holds; return the last torques f64[16]."""
    controller, torque = GraspController(approach, timeline), np.zeros(16)
    for tick in range(round(seconds / PERIOD_S)):
        dynamics.steady_object(timeline.get_steadying(tick * PERIOD_S))
        torque = controller.compute_torque(tick * PERIOD_S, dynamics.angles, dynamics.velocities)
        dynamics.step(torque, PERIOD_S)
    return torque


@pytest.fixture(scope="module")
def hand_at_rest(open_hand, approach):
    """Return a hand that has held the cylinder long enough to come to rest, and its last torques."""
    dynamics = open_hand()
    return dynamics, close_hand(dynamics, approach, 3.5)


@pytest.fixture(scope="module")
def closed_hand(open_hand, approach):
    """Return a hand that has closed around the cylinder for 1.2 s."""
    dynamics = open_hand()
    close_hand(dynamics, approach, 1.2)
    return dynamics


def compute_forces(contact: SkinContact, dynamics: HandInContact) -> np.ndarray:
    return contact.compute_forces(0, dynamics.object_pose(), dynamics.bracket_poses())


def test_the_hand_grasps_the_object_and_comes_to_rest(hand_at_rest, contact):
    dynamics, _ = hand_at_rest
    assert dynamics.touched_count >= 4
    assert compute_forces(contact, dynamics).sum() > 5.0
    assert np.abs(dynamics.velocities).max() < 0.003


def test_at_rest_contact_and_torques_balance_within_joint_friction(hand_at_rest, contact, setup, approach):
    """The contact torque about each joint is computed from the virtual work of a small rotation of this joint."""
    dynamics, torque = hand_at_rest
    kinematics = Kinematics(setup.wrist_robot, setup.hand)
    wrist = setup.object_pose("cylinder") @ approach.palm_pose
    load = contact.compute_load(0, dynamics.object_pose(), dynamics.bracket_poses())
    step, work = 1e-6, np.zeros(16)
    for joint in range(16):
        bracket_poses = []
        for sign in (1, -1):
            angles = dynamics.angles
            angles[joint] += sign * step
            bracket_poses.append(wrist @ kinematics.compute_sensor_poses(angles) @ BRACKET_OFFSET)
        for board, (plus, minus) in enumerate(zip(*bracket_poses, strict=True)):
            motion = inverse(minus) @ plus
            twist = np.r_[motion[:3, 3], to_rotation_vector(motion)] / (2 * step)
            work[joint] += twist @ load.wrench[board]
    is_within_limits = (dynamics.angles > setup.wrist_robot.lower) & (dynamics.angles < setup.wrist_robot.upper)
    assert np.abs(work).max() > 0.1
    resistance = JOINT_FRICTION_NM + JOINT_DAMPING_NM_S * np.abs(dynamics.velocities)
    assert (np.abs(work + torque) < 1.05 * resistance)[is_within_limits].all()


def test_at_rest_weight_and_stand_balance_the_net_force_of_the_hand(hand_at_rest, contact):
    dynamics, _ = hand_at_rest
    load = contact.compute_load(0, dynamics.object_pose(), dynamics.bracket_poses())
    bracket_poses = dynamics.bracket_poses() @ BRACKET_OFFSET
    on_object = -np.einsum("sij,sj->i", bracket_poses[:, :3, :3], load.wrench[:, :3])
    support, _ = dynamics._item.compute_support()
    assert np.abs(load.wrench[:, :3]).sum() > 10.0
    assert on_object + support[:3] == pytest.approx(np.zeros(3), abs=0.02)


def test_the_same_torques_give_bit_identical_motion(closed_hand, open_hand, approach):
    repeated = open_hand()
    close_hand(repeated, approach, 1.2)
    assert repeated.angles.tobytes() == closed_hand.angles.tobytes()
    assert repeated.object_pose().tobytes() == closed_hand.object_pose().tobytes()


def test_halving_the_time_step_hardly_changes_the_final_forces(open_hand, approach, contact, monkeypatch):
    """The fingers close as slowly as in a grasp, because fingers that strike an object slip unpredictably."""
    forces = []
    for divisor in (1, 2):
        monkeypatch.setattr(hand_in_contact, "SUBSTEP_S", SUBSTEP_S / divisor)
        dynamics = open_hand()
        close_hand(dynamics, approach, 2.1, GENTLE)
        forces.append(compute_forces(contact, dynamics))
    coarse, fine = forces
    assert fine.sum() == pytest.approx(coarse.sum(), rel=0.03)
    assert np.abs(fine - coarse).max() < 0.15 * coarse.max()


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_a_free_joint_stops_at_its_limit(open_hand, setup, direction):
    dynamics, robot = open_hand(-1), setup.wrist_robot  # -1: the skin touches no object
    limit = robot.upper if direction > 0 else robot.lower
    for _ in range(700):
        dynamics.step(np.full(16, 0.3 * direction), PERIOD_S)
        assert (dynamics.angles >= robot.lower - 0.04).all()  # the stops are springs
        assert (dynamics.angles <= robot.upper + 0.04).all()
    assert dynamics.angles == pytest.approx(limit, abs=0.002)
    assert np.abs(dynamics.velocities).max() < 1e-3
    assert dynamics.touched_count == 0


def test_without_torque_and_contact_neither_hand_nor_object_moves(open_hand, setup):
    dynamics = open_hand(-1)  # -1: the skin touches no object
    initial_angles = dynamics.angles
    dynamics.step(np.zeros(16), 0.3)
    assert dynamics.angles == pytest.approx(initial_angles, abs=1e-12)
    assert dynamics.object_pose() == pytest.approx(setup.object_pose("cylinder"), abs=1e-4)


def test_an_object_that_nothing_touches_stands_still_without_a_hand_that_steadies_it(open_hand, setup):
    dynamics = open_hand()
    away = setup.object_pose("cylinder").copy()
    away[2, 3] += 1.0
    dynamics.hold_wrist(away)
    dynamics.hold_wrist(away)  # twice, so that the wrist does not move there during the first step
    dynamics.steady_object(0.0)
    for _ in range(100):
        dynamics.step(np.zeros(16), PERIOD_S)
    assert dynamics.touched_count == 0
    assert dynamics.object_pose() == pytest.approx(setup.object_pose("cylinder"), abs=2e-5)
