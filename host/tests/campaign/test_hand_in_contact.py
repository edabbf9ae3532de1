"""The emulated hand's joints at rest on an object, at their limits, and at other time steps."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from taxel.campaign import hand_in_contact
from taxel.campaign.hand_in_contact import JOINT_DAMPING_NM_S, JOINT_FRICTION_NM, HandInContact, Mount
from taxel.emulated.contact import SkinContact
from taxel.emulated.scene import Scene, scene_text
from taxel.grasp.controller import GraspController
from taxel.grasp.timeline import Timeline
from taxel.hand.kinematics import Kinematics
from taxel.hand.transforms import from_rotation_vector, inverse, to_rotation_vector

MOUNT = Mount(2000.0, 20.0, 0.065)
PERIOD_S = 0.003
CLOSED = Timeline(baseline_s=0.0, closing_s=0.5, hold_s=9.0, release_s=0.0, recovery_s=0.0)
REMOUNT = from_rotation_vector([0.01, -0.02, 0.015])
REMOUNT[:3, 3] = 2e-4, -1e-4, 3e-4


@pytest.fixture(scope="module")
def contact(setup) -> Iterator[SkinContact]:
    brackets = {board.name: REMOUNT for board in setup.hand.boards}
    scene = Scene({"cylinder": setup.objects["cylinder"].shape}, brackets)
    with SkinContact(scene_text(setup.hand, scene)) as opened:
        yield opened


@pytest.fixture(scope="module")
def approach(setup, plan):
    return setup.approach(plan[0])


@pytest.fixture(scope="module")
def beginning(setup, contact, approach):
    """A hand around the cylinder, open; index -1: around nothing."""

    def make(index: int = 0) -> HandInContact:
        pose = setup.object_pose("cylinder")
        wrist = pose @ approach.palm_pose
        return HandInContact(setup.hand, setup.wrist_robot, contact, index, pose, MOUNT, wrist, approach.open_angles)

    return make


def close(dynamics: HandInContact, approach, seconds: float) -> np.ndarray:
    """Close and hold; returns the last torque."""
    controller, torque = GraspController(approach, CLOSED), np.zeros(16)
    for tick in range(round(seconds / PERIOD_S)):
        torque = controller.torque(tick * PERIOD_S, dynamics.angles, dynamics.velocities)
        dynamics.step(torque, PERIOD_S)
    return torque


@pytest.fixture(scope="module")
def at_rest(beginning, approach):
    dynamics = beginning()
    return dynamics, close(dynamics, approach, 3.5)


@pytest.fixture(scope="module")
def closed(beginning, approach):
    dynamics = beginning()
    close(dynamics, approach, 1.2)
    return dynamics


def forces(contact: SkinContact, dynamics: HandInContact) -> np.ndarray:
    return contact.forces(0, dynamics.object_pose(), dynamics.bracket_poses())


def test_it_grasps_and_comes_to_rest(at_rest, contact):
    """Fingers slide on the object without friction until they bear on it: only friction in the joints ends it."""
    dynamics, _ = at_rest
    assert dynamics.touched >= 4
    assert forces(contact, dynamics).sum() > 5.0
    assert np.abs(dynamics.velocities).max() < 0.03


def test_at_rest_contact_balances_the_torques_to_within_friction(at_rest, contact, setup, approach):
    """Virtual work: what contact does on each board while one joint turns a little."""
    dynamics, torque = at_rest
    kinematics = Kinematics(setup.wrist_robot, setup.hand)
    wrist = setup.object_pose("cylinder") @ approach.palm_pose
    load = contact.load(0, dynamics.object_pose(), dynamics.bracket_poses())
    step, work = 1e-6, np.zeros(16)
    for joint in range(16):
        true = []
        for sign in (1, -1):
            angles = dynamics.angles
            angles[joint] += sign * step
            true.append(wrist @ kinematics.sensor_poses(angles) @ REMOUNT)
        for board, (plus, minus) in enumerate(zip(*true, strict=True)):
            motion = inverse(minus) @ plus
            twist = np.r_[motion[:3, 3], to_rotation_vector(motion)] / (2 * step)
            work[joint] += twist @ load.wrench[board]
    inside = (dynamics.angles > setup.wrist_robot.lower) & (dynamics.angles < setup.wrist_robot.upper)
    assert np.abs(work).max() > 0.1
    resisted = JOINT_FRICTION_NM + JOINT_DAMPING_NM_S * np.abs(dynamics.velocities)
    assert (np.abs(work + torque) < 1.05 * resisted)[inside].all()


def test_at_rest_the_mount_balances_the_net_force(at_rest, contact, setup):
    dynamics, _ = at_rest
    load = contact.load(0, dynamics.object_pose(), dynamics.bracket_poses())
    true = dynamics.bracket_poses() @ REMOUNT
    on_object = -np.einsum("sij,sj->i", true[:, :3, :3], load.wrench[:, :3])
    held = np.array([0.0, 0.0, MOUNT.height_m, 1.0])
    gives_way = ((dynamics.object_pose() - setup.object_pose("cylinder")) @ held)[:3]
    assert np.linalg.norm(on_object) > 0.5
    assert on_object == pytest.approx(MOUNT.n_per_m * gives_way, abs=0.05)


def test_the_same_torques_give_the_same_bits(closed, beginning, approach):
    again = beginning()
    close(again, approach, 1.2)
    assert again.angles.tobytes() == closed.angles.tobytes()
    assert again.object_pose().tobytes() == closed.object_pose().tobytes()


def test_half_the_time_step_changes_the_final_forces_little(closed, beginning, approach, contact, monkeypatch):
    coarse = forces(contact, closed)
    monkeypatch.setattr(hand_in_contact, "SUBSTEP_S", hand_in_contact.SUBSTEP_S / 2)
    dynamics = beginning()
    close(dynamics, approach, 1.2)
    fine = forces(contact, dynamics)
    assert fine.sum() == pytest.approx(coarse.sum(), rel=0.03)
    assert np.abs(fine - coarse).max() < 0.05 * coarse.max()


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_a_free_joint_stops_at_its_limit(beginning, setup, direction):
    dynamics, robot = beginning(-1), setup.wrist_robot
    limit = robot.upper if direction > 0 else robot.lower
    for _ in range(700):
        dynamics.step(np.full(16, 0.3 * direction), PERIOD_S)
        assert (dynamics.angles >= robot.lower).all()
        assert (dynamics.angles <= robot.upper).all()
    assert dynamics.angles == pytest.approx(limit)
    assert not dynamics.velocities.any()
    assert dynamics.touched == 0


def test_without_torque_and_contact_nothing_moves(beginning, setup):
    dynamics = beginning(-1)
    before = dynamics.angles
    dynamics.step(np.zeros(16), 0.3)
    assert dynamics.angles == pytest.approx(before, abs=1e-12)
    assert dynamics.object_pose() == pytest.approx(setup.object_pose("cylinder"))


def test_an_object_that_was_pushed_swings_back(beginning, approach, setup):
    dynamics = beginning()
    close(dynamics, approach, 0.8)
    far = setup.object_pose("cylinder") @ approach.palm_pose
    far[2, 3] += 1.0
    dynamics.hold_wrist(far)
    for _ in range(200):
        dynamics.step(np.zeros(16), PERIOD_S)
    assert dynamics.touched == 0
    assert dynamics.object_pose() == pytest.approx(setup.object_pose("cylinder"), abs=1e-6)
