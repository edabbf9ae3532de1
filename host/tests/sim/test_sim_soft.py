"""The elastic layer in the simulation loop: force law, loads, and equilibrium of a grasp."""

from functools import cache

import mujoco
import numpy as np
import pytest

from taxel.grasp.objects import (
    ASSUMED_SIZES,
    GRAVITY_M_PER_S2,
    STAND_FRICTION,
    compute_mass_properties,
    make_thesis_objects,
)
from taxel.grasp.plan import make_thesis_approaches
from taxel.grasp.shapes import ConvexPolytope
from taxel.grasp.timeline import Phase, Timeline
from taxel.hand import load_hand
from taxel.hand.geometry import REFERENCE_AREA_M2
from taxel.hand.sheet import build_sheet
from taxel.hand.transforms import from_rotation_vector, inverse, to_quaternion
from taxel.sim import soft_push
from taxel.sim.closing import SimulationSettings, simulate_grasp
from taxel.sim.column_division import divide_squares
from taxel.sim.native_contact import NativeContact
from taxel.sim.scene import JOINT_FRICTION_NM, build_scene
from taxel.sim.soft_contact import LayerFriction, LayerLaw, SoftContact

HAND = load_hand("allegro")
LAW = LayerLaw()
TIMELINE = Timeline(baseline_s=0.1, closing_s=2.0, release_s=0.3, recovery_s=0.1)
APPROACHES = {f"{a.object}-{a.name}": a for a in make_thesis_approaches(withdraw_m=0.02)}
ONE_SIDE_OF_EACH_OBJECT = [key for key in APPROACHES if key.rsplit("_", 1)[-1] not in {"2", "3", "4"}]


@cache
def build_object_scene(name):
    """Build the scene of the hand and the test object `name`."""
    return build_scene(HAND, make_thesis_objects(ASSUMED_SIZES)[name], "palm")


@cache
def simulate_approach(key):
    """Simulate the grasp of `APPROACHES[key]` with a soft layer."""
    return simulate_grasp(
        build_object_scene(APPROACHES[key].object), APPROACHES[key], TIMELINE, SimulationSettings(law=LAW)
    )


def test_the_stiffness_is_the_derivative_of_the_force_and_never_decreases():
    depth = np.linspace(1e-5, 4e-3, 400)
    step = 1e-9
    derivative = (LAW.compute_force(depth + step) - LAW.compute_force(depth - step)) / (2 * step)
    np.testing.assert_allclose(LAW.compute_stiffness(depth), derivative, rtol=1e-4)
    assert LAW.compute_force(np.zeros(1))[0] == 0.0
    assert (np.diff(LAW.compute_stiffness(depth)) >= 0).all()


def test_the_force_beyond_the_fitted_range_increases_linearly():
    force = LAW.compute_force(np.array([2e-3, 4e-3, 6e-3]))
    assert force[2] - force[1] == pytest.approx(force[1] - force[0])
    assert force[2] < 25e3


@pytest.mark.parametrize("key", ONE_SIDE_OF_EACH_OBJECT)
def test_taxel_forces_of_a_grasp_are_non_negative_and_below_600_n_in_sum(key):
    motion = simulate_approach(key)
    assert motion.taxel_force.min() >= 0.0
    assert motion.taxel_force.sum(axis=1).max() < 600.0


@pytest.mark.parametrize("key", ONE_SIDE_OF_EACH_OBJECT)
def test_no_taxel_has_a_force_in_the_baseline_of_a_grasp(key):
    motion = simulate_approach(key)
    assert not motion.taxel_force[motion.phase == Phase.BASELINE].any()


@pytest.mark.parametrize("key", ONE_SIDE_OF_EACH_OBJECT)
def test_the_layer_forces_carry_the_weight_that_the_stand_does_not_carry(key):
    """At the end of hold; the stand pushes upwards, and along its surface by friction."""
    motion = simulate_approach(key)
    end = int(np.flatnonzero(motion.phase == Phase.HOLD)[-1])
    shape = make_thesis_objects(ASSUMED_SIZES)[APPROACHES[key].object].shape
    weight_n = compute_mass_properties(shape).mass_kg * GRAVITY_M_PER_S2
    frames, wrench = motion.sensor_poses[end], motion.wrench[end]
    on_object = -np.einsum("sij,sj->i", frames[:, :3, :3], wrench[:, :3])
    stand_force = np.array([0.0, 0.0, weight_n]) - on_object
    assert np.linalg.norm(wrench[:, :3], axis=1).sum() > 10.0
    assert stand_force[2] > -0.05
    assert np.linalg.norm(stand_force[:2]) < STAND_FRICTION * stand_force[2] + 0.05


def test_the_layer_forces_on_a_finger_balance_its_joint_torques():
    """J^T f equals the torque of each joint of the middle finger, within the joint friction."""
    key = "cylinder-side_1"
    approach, motion, scene = APPROACHES[key], simulate_approach(key), build_object_scene("cylinder")
    end = int(np.flatnonzero(motion.phase == Phase.HOLD)[-1])
    for index, name in enumerate(("mf_j1", "mf_j2", "mf_j3")):
        joint = next(j for j in scene.robot.joints if j.name == name)
        distal_links = [f"mf_{part}" for part in ("proximal", "medial", "distal")][index:]
        frame = motion.link_poses[end, scene.links.index(joint.child)]
        moment = np.zeros(3)
        for i, board in enumerate(HAND.boards):
            if board.link_name in distal_links:
                pose, wrench = motion.sensor_poses[end, i], motion.wrench[end, i]
                force = pose[:3, :3] @ wrench[:3]
                moment += pose[:3, :3] @ wrench[3:] + np.cross(pose[:3, 3] - frame[:3, 3], force)
        torque = approach.torque[scene.joint_names.index(name)]
        assert moment @ (frame[:3, :3] @ joint.axis) == pytest.approx(-torque, abs=JOINT_FRICTION_NM + 0.01), name


def test_half_the_time_step_gives_nearly_the_same_hold_forces():
    key = "rectangular_prism-wide_side_1"
    reference = simulate_approach(key)
    settings = SimulationSettings(law=LAW, soft_step_s=soft_push.SOFT_STEP_S / 2)
    half_step = simulate_grasp(build_object_scene("rectangular_prism"), APPROACHES[key], TIMELINE, settings)
    hold = np.flatnonzero(reference.phase == Phase.HOLD)[-5:]
    reference_forces, half_step_forces = (motion.taxel_force[hold].mean(axis=0) for motion in (reference, half_step))
    assert np.corrcoef(reference_forces, half_step_forces)[0, 1] > 0.98
    assert reference_forces.sum() == pytest.approx(half_step_forces.sum(), rel=0.02)


def test_the_penetration_rate_of_a_layer_piece_is_the_derivative_of_its_depth():
    """The reference is a finite difference for every degree of freedom, in the frame of the object.

    A piece is a column of the soft layer of a board; `rate` is the change of its depth in the object per unit of the
    velocity of each degree of freedom.
    """
    key, scene = "cylinder-side_1", build_object_scene("cylinder")
    motion = simulate_approach(key)
    end = int(np.flatnonzero(motion.phase == Phase.HOLD)[-1])
    soft = SoftContact(HAND, make_thesis_objects(ASSUMED_SIZES)["cylinder"].shape, LAW)
    push = soft_push.SoftPush(scene, soft)
    data = mujoco.MjData(scene.model)
    for name, angle in zip(scene.joint_names, motion.joint_angles[end], strict=True):
        data.qpos[scene.model.joint(name).qposadr[0]] = angle
    scene.place_object(data, motion.object_pose[end])
    index, pose = scene.model.body_mocapid[scene.link_bodies[0]], motion.link_poses[end, 0]
    data.mocap_pos[index], data.mocap_quat[index] = pose[:3, 3], to_quaternion(pose)

    def compute_poses_at(qpos):
        """Return MuJoCo's data at the coordinates `qpos`, and the poses of the brackets in world and object frame."""
        data_at = mujoco.MjData(scene.model)
        data_at.qpos[:], data_at.mocap_pos[:], data_at.mocap_quat[:] = qpos, data.mocap_pos, data.mocap_quat
        mujoco.mj_fwdPosition(scene.model, data_at)
        poses = push._read_sensor_poses(data_at)
        return data_at, poses, inverse(push._read_object_pose(data_at)) @ poses

    initial_data, poses, in_object = compute_poses_at(data.qpos)
    piece = soft._find_columns(in_object).piece
    assert len(piece) > 50
    points, normals = soft._compute_lines(in_object, piece)
    board = soft.sheet.board_index[piece]
    normal, arm = (
        np.einsum("mij,mj->mi", poses[board, :3, :3], part[piece]) for part in (soft.sheet.normal, soft.sheet.position)
    )
    rate = np.einsum(
        "mi,mij->mj", np.hstack([normal, np.cross(arm, normal)]), push._compute_jacobian(initial_data, poses)[board]
    )
    step = 1e-7
    for column in range(scene.model.nv):
        velocity = np.zeros(scene.model.nv)
        velocity[column] = 1.0
        displaced_qpos = data.qpos.copy()
        mujoco.mj_integratePos(scene.model, displaced_qpos, velocity, step)
        displaced_points, _ = soft._compute_lines(compute_poses_at(displaced_qpos)[2], piece)
        expected = np.sum((displaced_points - points) / step * normals, axis=1)
        np.testing.assert_allclose(rate[:, column], expected, atol=1e-5)


@pytest.mark.parametrize("contact_class", [SoftContact, NativeContact])
def test_the_load_is_proportional_to_the_covered_area_wherever_an_edge_crosses_the_columns(contact_class):
    """The edge of a box without friction moves across the board: each step changes the load by an equal strip."""
    hand, depth_m, step_m = load_hand("flat8"), 0.0008, 0.13e-3
    contact = contact_class(hand, ConvexPolytope.box(0.2, 0.2, 0.03), LAW, LayerFriction(0.0))
    object_pose, forces, taxel_forces = np.eye(4), [], []
    object_pose[2, 3] = hand.layer_m - depth_m
    for step in range(60):
        object_pose[0, 3] = 0.1 - 0.01 + step * step_m  # the edge, 0.1 m beside the centre, starts at x = -10 mm
        forces.append(contact.compute_load(np.eye(4)[None], object_pose).wrench[0, 2])
        taxel_forces.append(contact.compute_taxel_forces(np.eye(4)[None], object_pose))
    pressure = float(LAW.compute_force(np.array(depth_m))) / REFERENCE_AREA_M2
    height_m = np.ptp(build_sheet(hand).position[:, 1]) + hand.pitch_m  # with the margin beside the taxels
    np.testing.assert_allclose(np.diff(forces), pressure * height_m * step_m, rtol=1e-6)
    assert np.abs(np.diff(taxel_forces, axis=0)).max() < 1.01 * pressure * hand.pitch_m * step_m


def test_squares_are_divided_into_parts_that_add_up_to_the_covered_area():
    """The parts of one square agree with the depths of 400 x 400 samples.

    Two of the three faces form a ridge across the square. A corner of the square lies outside the third face.
    """
    depth, depth_change = np.array([1.0, 1.2, 0.1]), np.array([[0.9, 0.0], [-0.9, 0.1], [0.4, 0.4]])
    parts = divide_squares(depth[None], depth_change[None])
    # Points of a grid in the square from -1 to 1; a point is as deep in the solid as below its nearest face.
    samples = (np.stack(np.meshgrid(*2 * [np.arange(400) / 200 - 0.9975]), axis=-1)).reshape(-1, 2)
    depths = depth + samples @ depth_change.T
    lowest, face = depths.min(axis=1), depths.argmin(axis=1)
    for index, share, depth, deviation in zip(parts.face, parts.share, parts.depth, parts.deviation, strict=True):
        is_part = (face == index) & (lowest > 0.0)
        assert share == pytest.approx(is_part.mean(), abs=1e-3)
        assert depth == pytest.approx(lowest[is_part].mean(), rel=5e-3)
        assert deviation == pytest.approx(lowest[is_part].std(), rel=2e-2)
    assert parts.share.sum() == pytest.approx((lowest > 0.0).mean(), abs=1e-3)


@pytest.mark.parametrize("contact_class", [SoftContact, NativeContact])
def test_skipping_distant_layer_pieces_does_not_change_the_load(contact_class):
    """A box approaches, turns and withdraws; a model that skips distant pieces agrees with one that does not."""
    hand, shape = load_hand("flat8"), ConvexPolytope.box(0.03, 0.02, 0.03).rounded(0.002)
    rng = np.random.default_rng(5)
    tracked = contact_class(hand, shape, LAW)
    object_pose, contact_count = np.eye(4), 0
    for height in np.concatenate([np.linspace(0.02, 0.001, 40), np.linspace(0.001, 0.02, 15)]):
        object_pose = object_pose @ from_rotation_vector(rng.normal(0.0, 0.01, 3))
        object_pose[:3, 3] = [*rng.normal(0.0, 0.0005, 2), height]
        result, expected = (
            model.compute_load(np.eye(4)[None], object_pose) for model in (tracked, contact_class(hand, shape, LAW))
        )
        np.testing.assert_array_equal(result.wrench, expected.wrench)
        np.testing.assert_array_equal(result.stiffness, expected.stiffness)
        contact_count += int(expected.wrench.any())
    assert contact_count > 5
    assert not expected.wrench.any()


def test_a_grasp_with_a_soft_layer_has_no_rigid_contacts():
    assert len(simulate_approach(ONE_SIDE_OF_EACH_OBJECT[0]).contacts.board) == 0
