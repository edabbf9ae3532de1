"""The elastic layer in the loop: its law, its loads, and the rest that a grasp comes to."""

from functools import cache

import mujoco
import numpy as np
import pytest

from taxel.grasp.objects import (
    MOUNT_STIFFNESS_N_PER_M,
    MOUNT_STIFFNESS_NM_PER_RAD,
    make_standing_pose,
    make_thesis_objects,
)
from taxel.grasp.plan import make_thesis_approaches
from taxel.grasp.shapes import ConvexPolytope
from taxel.grasp.timeline import Phase, Timeline
from taxel.hand import load_hand
from taxel.hand.transforms import from_rotation_vector, inverse, to_quaternion, to_rotation_vector
from taxel.sim import soft_push
from taxel.sim.closing import simulate_grasp
from taxel.sim.native_contact import NativeContact
from taxel.sim.scene import JOINT_FRICTION_NM, build_scene
from taxel.sim.soft_contact import LayerLaw, SoftContact

HAND = load_hand("allegro")
LAW = LayerLaw()
LINE = Timeline(baseline_s=0.5, recovery_s=0.5)
APPROACHES = {f"{a.object}-{a.name}": a for a in make_thesis_approaches(withdraw_m=0.02)}
ONE_OF_EACH = [key for key in APPROACHES if key.rsplit("_", 1)[-1] not in {"2", "3", "4"}]


@cache
def scene_of(name):
    return build_scene(HAND, make_thesis_objects()[name], "palm")


@cache
def motion_of(key):
    return simulate_grasp(scene_of(APPROACHES[key].object), APPROACHES[key], LINE, law=LAW)


def test_the_stiffness_is_the_rise_of_the_force():
    depth = np.linspace(1e-5, 4e-3, 400)
    step = 1e-9
    rise = (LAW.force(depth + step) - LAW.force(depth - step)) / (2 * step)
    np.testing.assert_allclose(LAW.stiffness(depth), rise, rtol=1e-4)
    assert LAW.force(np.zeros(1))[0] == 0.0
    assert (np.diff(LAW.stiffness(depth)) >= 0).all()


@pytest.mark.parametrize("newtons", [0.05, 0.5, 5.0])
def test_the_secant_is_force_over_depth(newtons):
    depth = newtons / LAW.secant(newtons)
    assert float(LAW.force(np.array(depth))) == pytest.approx(newtons, rel=1e-9)


def test_forces_stay_bounded_however_deep_a_piece_is():
    assert float(LAW.force(np.array(6e-3))) < 1000.0


@pytest.mark.parametrize("key", ONE_OF_EACH)
def test_no_frame_of_a_grasp_has_a_force_that_no_hand_exerts(key):
    motion = motion_of(key)
    assert motion.taxel_force.min() >= 0.0
    assert motion.taxel_force.sum(axis=1).max() < 600.0
    assert not motion.taxel_force[motion.phase == Phase.BASELINE].any()


@pytest.mark.parametrize("key", ONE_OF_EACH)
def test_the_layers_forces_balance_the_mounts_springs(key):
    """At the moment of hold at which the object moves least: frictionless fingers may creep on an inclined face."""
    motion = motion_of(key)
    hold = np.flatnonzero(motion.phase == Phase.HOLD)[4:]
    moves = np.abs(motion.object_pose[hold] - motion.object_pose[hold - 1]).max(axis=(1, 2))
    end = int(hold[moves.argmin()])
    slack = 0.5  # N; a finger creeps in the hold: the step lags by h K v
    frames, wrench = motion.sensor_poses[end], motion.wrench[end]
    force = np.einsum("sij,sj->si", frames[:, :3, :3], wrench[:, :3])
    moment = np.einsum("sij,sj->si", frames[:, :3, :3], wrench[:, 3:])
    middle = np.array([0.0, 0.0, make_thesis_objects()[APPROACHES[key].object].shape.height / 2, 1.0])
    moved, rest = motion.object_pose[end] @ middle, make_standing_pose() @ middle
    np.testing.assert_allclose(-force.sum(axis=0), MOUNT_STIFFNESS_N_PER_M * (moved - rest)[:3], atol=slack)
    about = moment + np.cross(frames[:, :3, 3] - moved[:3], force)
    turned = to_rotation_vector(motion.object_pose[end] @ inverse(make_standing_pose()))
    np.testing.assert_allclose(-about.sum(axis=0), MOUNT_STIFFNESS_NM_PER_RAD * turned, atol=0.05)


def test_the_layers_forces_on_a_finger_balance_its_joints_torques():
    """J^T f = torque for the middle finger, within the joints' friction."""
    key = "cylinder-side_1"
    approach, motion, scene = APPROACHES[key], motion_of(key), scene_of("cylinder")
    end = int(np.flatnonzero(motion.phase == Phase.HOLD)[-1])
    for index, name in enumerate(("mf_j1", "mf_j2", "mf_j3")):
        joint = next(j for j in scene.robot.joints if j.name == name)
        below = [f"mf_{part}" for part in ("proximal", "medial", "distal")][index:]
        frame = motion.link_poses[end, scene.links.index(joint.child)]
        moment = np.zeros(3)
        for i, board in enumerate(HAND.boards):
            if board.link_name in below:
                pose, wrench = motion.sensor_poses[end, i], motion.wrench[end, i]
                force = pose[:3, :3] @ wrench[:3]
                moment += pose[:3, :3] @ wrench[3:] + np.cross(pose[:3, 3] - frame[:3, 3], force)
        torque = approach.torque[scene.joint_names.index(name)]
        assert moment @ (frame[:3, :3] @ joint.axis) == pytest.approx(-torque, abs=JOINT_FRICTION_NM + 0.01), name


def test_half_the_step_comes_to_the_same_rest(monkeypatch):
    key = "rectangular_prism-wide_side_1"
    whole = motion_of(key)
    monkeypatch.setattr(soft_push, "SOFT_STEP_S", soft_push.SOFT_STEP_S / 2)
    half = simulate_grasp(scene_of("rectangular_prism"), APPROACHES[key], LINE, law=LAW)
    hold = np.flatnonzero(whole.phase == Phase.HOLD)[-5:]
    a, b = (m.taxel_force[hold].mean(axis=0) for m in (whole, half))
    assert np.corrcoef(a, b)[0, 1] > 0.98
    assert a.sum() == pytest.approx(b.sum(), rel=0.02)


def test_how_fast_a_piece_sinks_in_is_its_speed_along_its_normal():
    """By finite differences of every degree of freedom, seen from the object: force and motion do the same work."""
    key, scene = "cylinder-side_1", scene_of("cylinder")
    motion = motion_of(key)
    end = int(np.flatnonzero(motion.phase == Phase.HOLD)[-1])
    soft = SoftContact(HAND, make_thesis_objects()["cylinder"].shape, LAW)
    push = soft_push.SoftPush(scene, soft)
    data = mujoco.MjData(scene.model)
    for name, angle in zip(scene.joint_names, motion.joint_angles[end], strict=True):
        data.qpos[scene.model.joint(name).qposadr[0]] = angle
    places = {scene.model.body("mount").id: make_standing_pose(), scene.link_bodies[0]: motion.link_poses[end, 0]}
    for body, place in places.items():
        index = scene.model.body_mocapid[body]
        data.mocap_pos[index], data.mocap_quat[index] = place[:3, 3], to_quaternion(place)

    def moved_to(qpos):
        moved = mujoco.MjData(scene.model)
        moved.qpos[:], moved.mocap_pos[:], moved.mocap_quat[:] = qpos, data.mocap_pos, data.mocap_quat
        mujoco.mj_fwdPosition(scene.model, moved)
        poses = push._sensor_poses(moved)
        return moved, poses, inverse(push._object_pose(moved)) @ poses

    at, poses, in_object = moved_to(data.qpos)
    square, _ = soft._pressed(in_object)
    assert len(square) > 50
    points, normals = soft._lines(in_object, square)
    board = soft.sheet.board_index[square]
    normal, arm = (
        np.einsum("mij,mj->mi", poses[board, :3, :3], part[square]) for part in (soft.sheet.normal, soft.sheet.position)
    )
    speed = np.einsum("mi,mij->mj", np.hstack([normal, np.cross(arm, normal)]), push._motion(at, poses)[board])
    step = 1e-7
    for column in range(scene.model.nv):
        velocity = np.zeros(scene.model.nv)
        velocity[column] = 1.0
        there = data.qpos.copy()
        mujoco.mj_integratePos(scene.model, there, velocity, step)
        after, _ = soft._lines(moved_to(there)[2], square)
        expected = np.sum((after - points) / step * normals, axis=1)
        np.testing.assert_allclose(speed[:, column], expected, atol=1e-5)


@pytest.mark.parametrize("contact", [SoftContact, NativeContact])
def test_pieces_that_are_left_out_do_not_bear(contact):
    """While a box comes, turns and goes, the pieces that were looked at give what all would."""
    hand, shape = load_hand("flat8"), ConvexPolytope.box(0.03, 0.02, 0.03).rounded(0.002)
    rng = np.random.default_rng(5)
    tracked = contact(hand, shape, LAW)
    item, pressed = np.eye(4), 0
    for height in np.concatenate([np.linspace(0.02, 0.001, 40), np.linspace(0.001, 0.02, 15)]):
        item = item @ from_rotation_vector(rng.normal(0.0, 0.01, 3))
        item[:3, 3] = [*rng.normal(0.0, 0.0005, 2), height]
        got, wanted = (each.load(np.eye(4)[None], item) for each in (tracked, contact(hand, shape, LAW)))
        np.testing.assert_array_equal(got.wrench, wanted.wrench)
        np.testing.assert_array_equal(got.stiffness, wanted.stiffness)
        pressed += int(wanted.wrench.any())
    assert pressed > 5
    assert not wanted.wrench.any()


def test_rigid_solids_do_not_meet_where_the_layer_bears():
    assert len(motion_of(ONE_OF_EACH[0]).contacts.board) == 0
