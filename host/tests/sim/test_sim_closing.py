"""A simulated grasp of rigid boards: contact, equilibrium in hold, and motion of palm and object."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from taxel.grasp.objects import (
    ASSUMED_SIZES,
    GRAVITY_M_PER_S2,
    SKIN_FRICTION,
    STAND_FRICTION,
    GraspObject,
    compute_mass_properties,
    make_standing_pose,
    make_thesis_objects,
)
from taxel.grasp.plan import Approach, make_thesis_approaches
from taxel.grasp.shapes import ConvexPolytope
from taxel.grasp.timeline import Phase, Timeline
from taxel.hand import load_hand
from taxel.hand.kinematics import build_kinematics
from taxel.hand.transforms import inverse, make_pose
from taxel.sim.closing import SimulationSettings, simulate_grasp
from taxel.sim.scene import JOINT_FRICTION_NM, build_scene

HAND = load_hand("allegro")
TIMELINE = Timeline(baseline_s=0.5, recovery_s=0.5)
APPROACHES = {f"{a.object}-{a.name}": a for a in make_thesis_approaches(withdraw_m=0.02)}
SIDES = [key for key in APPROACHES if not key.endswith("-top")]
FIRST_APPROACH = APPROACHES["rectangular_prism-wide_side_1"]


@cache
def build_object_scene(name):
    """Build the scene of the hand and the test object `name`."""
    return build_scene(HAND, make_thesis_objects(ASSUMED_SIZES)[name], "palm")


@cache
def simulate_approach(key):
    """Simulate the grasp of `APPROACHES[key]` with default settings."""
    return simulate_grasp(build_object_scene(APPROACHES[key].object), APPROACHES[key], TIMELINE)


def last_sample(motion, phase):
    """Return the index of the last sample of a phase."""
    return int(np.flatnonzero(motion.phase == phase)[-1])


def compute_board_forces(motion, sample):
    """Return the force in N on every board at a sample, by board name."""
    return dict(zip((b.name for b in HAND.boards), np.linalg.norm(motion.wrench[sample, :, :3], axis=1), strict=True))


def compute_hold_forces(key):
    """Return the force in N on every touched board at the end of hold, by board name; at most 0.2 N is ignored."""
    motion = simulate_approach(key)
    force = compute_board_forces(motion, last_sample(motion, Phase.HOLD))
    return {name: newtons for name, newtons in force.items() if newtons > 0.2}


@pytest.mark.parametrize("key", SIDES)
def test_in_every_side_grasp_two_fingers_the_thumb_and_the_palm_touch_the_object(key):
    force = compute_hold_forces(key)
    assert len(force) >= 5
    assert {"palm", "fingertip_thumb"} <= force.keys()
    assert len({name.rsplit("_", 1)[-1] for name in force} & {"index", "middle", "pinkie"}) >= 2


@pytest.mark.parametrize("key", APPROACHES)
def test_in_every_approach_the_palm_and_a_finger_or_the_thumb_carry_load(key):
    """At least one finger or the thumb must carry load, because from the top the other fingers can miss the object.

    Limits are in N.
    """
    force = compute_hold_forces(key)
    assert 3.0 < force.pop("palm") < 150.0
    assert 3.0 < max(force.values()) < 15.0


@pytest.mark.parametrize("key", APPROACHES)
def test_the_hand_is_nearly_at_rest_at_the_end_of_hold(key):
    motion = simulate_approach(key)
    end = last_sample(motion, Phase.HOLD)
    speed_rad_s = np.abs(motion.joint_angles[end] - motion.joint_angles[end - 4]) / 0.2  # four samples of 0.05 s
    assert speed_rad_s.max() < 0.2


@pytest.mark.parametrize("key", ["rectangular_prism-wide_side_1", "cylinder-side_2", "triangular_prism-side_1"])
def test_the_contact_forces_carry_the_weight_that_the_stand_does_not_carry(key):
    motion = simulate_approach(key)
    end = last_sample(motion, Phase.HOLD)
    on_object = -motion.contacts.force[motion.contacts.sample == end].sum(axis=0)
    shape = make_thesis_objects(ASSUMED_SIZES)[APPROACHES[key].object].shape
    weight_n = compute_mass_properties(shape).mass_kg * GRAVITY_M_PER_S2
    stand_force = np.array([0.0, 0.0, weight_n]) - on_object
    # The stand pushes upwards, and along its surface by friction; rigid contact vibrates, hence the tolerances in N.
    assert stand_force[2] > -0.1
    assert np.linalg.norm(stand_force[:2]) < STAND_FRICTION * stand_force[2] + 0.5


def test_the_contact_forces_on_a_finger_balance_its_joint_torques():
    """J^T f equals the torque of each joint of the middle finger, within the joint friction."""
    approach, motion = APPROACHES["cylinder-side_1"], simulate_approach("cylinder-side_1")
    scene, end = build_object_scene("cylinder"), last_sample(motion, Phase.HOLD)
    on_board = {i for i, board in enumerate(HAND.boards) if board.link_name and board.link_name.startswith("mf_")}
    for index, name in enumerate(("mf_j1", "mf_j2", "mf_j3")):
        joint = next(j for j in scene.robot.joints if j.name == name)
        distal_links = [f"mf_{part}" for part in ("proximal", "medial", "distal")][index:]
        boards = [i for i in on_board if HAND.boards[i].link_name in distal_links]
        is_distal_contact = (motion.contacts.sample == end) & np.isin(motion.contacts.board, boards)
        frame = motion.link_poses[end, scene.links.index(joint.child)]
        moment = np.cross(
            motion.contacts.position[is_distal_contact] - frame[:3, 3], motion.contacts.force[is_distal_contact]
        ).sum(axis=0)
        torque = approach.torque[scene.joint_names.index(name)]
        assert moment @ (frame[:3, :3] @ joint.axis) == pytest.approx(-torque, abs=JOINT_FRICTION_NM + 0.015), name


def test_the_wrench_of_a_board_is_the_sum_over_its_contact_points():
    """The wrench and the sum are averaged over the last second of hold, in N and Nm.

    The wrench of a sample is a mean over several time steps, but the contact points of a sample are those of one step.
    """
    motion = simulate_approach("cylinder-side_1")
    samples = np.flatnonzero(motion.phase == Phase.HOLD)[-20:]
    contacts = motion.contacts
    for board in range(len(HAND.boards)):
        summed_wrench = np.zeros(6)
        for sample in samples:
            is_on_board = (contacts.sample == sample) & (contacts.board == board)
            frame = motion.sensor_poses[sample, board]
            moment = np.cross(contacts.position[is_on_board] - frame[:3, 3], contacts.force[is_on_board]).sum(axis=0)
            summed_wrench += [*(contacts.force[is_on_board].sum(axis=0) @ frame[:3, :3]), *(moment @ frame[:3, :3])]
        assert np.allclose(
            motion.wrench[samples, board].mean(axis=0), summed_wrench / len(samples), atol=0.15, rtol=0.02
        )


def test_contact_forces_lie_in_the_friction_cone_with_less_than_1_mm_overlap():
    motion = simulate_approach("cylinder-side_1")
    in_hold = motion.phase[motion.contacts.sample] == Phase.HOLD
    normal, force = motion.contacts.normal[in_hold], motion.contacts.force[in_hold]
    pressing = np.sum(normal * force, axis=1)
    assert (pressing >= -1e-9).all()
    assert (np.linalg.norm(np.cross(normal, force), axis=1) <= SKIN_FRICTION * pressing * 1.001 + 1e-6).all()
    assert motion.contacts.depth[in_hold].max() < 1e-3


@pytest.mark.parametrize("key", APPROACHES)
def test_in_baseline_and_recovery_the_hand_is_at_rest_without_load(key):
    motion = simulate_approach(key)
    for phase in (Phase.BASELINE, Phase.RECOVERY):
        in_phase = motion.phase == phase
        assert not motion.wrench[in_phase].any()
        assert (np.ptp(motion.joint_angles[in_phase], axis=0) == 0).all()


def test_only_a_withdrawn_palm_has_no_load_before_it_approaches_an_object_displaced_towards_it():
    """The object is displaced towards the palm. It loads the palm at the start, unless the palm is withdrawn."""
    offset = make_pose([0.0, 0.002, 0.0], [1, 0, 0, 0])  # 2 mm towards the palm, which touches the object there
    for approach in (replace(FIRST_APPROACH, withdraw_m=0.0), FIRST_APPROACH):
        motion = simulate_grasp(
            build_object_scene("rectangular_prism"), approach, TIMELINE, SimulationSettings(object_offset=offset)
        )
        assert (np.abs(motion.wrench[0]).max() == 0.0) == (approach.withdraw_m > 0)


def test_a_palm_that_is_not_withdrawn_is_loaded_in_the_baseline():
    approach = replace(APPROACHES["rectangular_prism-narrow_side_1"], withdraw_m=0.0)
    motion = simulate_grasp(build_object_scene("rectangular_prism"), approach, TIMELINE)
    assert compute_board_forces(motion, last_sample(motion, Phase.BASELINE))["palm"] > 0.05
    for phase in (Phase.BASELINE, Phase.RECOVERY):
        assert (np.ptp(motion.joint_angles[motion.phase == phase], axis=0) == 0).all()


def test_poses_agree_with_forward_kinematics():
    motion = simulate_approach("cylinder-top")
    kinematics = build_kinematics(HAND)
    angles = np.zeros((len(motion.time_s), 22))  # the first six joints are those of the arm
    angles[:, 6:] = motion.joint_angles
    expected_poses = kinematics.compute_link_poses(angles)
    palm = build_object_scene("cylinder").robot.get_link_index("palm")
    # Transform from the palm of an arm with all angles at 0 to the simulated palm, which moves without an arm.
    wrist_motion = motion.link_poses[:, :1] @ inverse(expected_poses[:, palm : palm + 1])
    assert np.allclose(wrist_motion @ expected_poses[:, palm:], motion.link_poses, atol=1e-9)
    assert np.allclose(wrist_motion @ kinematics.compute_sensor_poses(angles), motion.sensor_poses, atol=1e-9)


def test_equal_arguments_give_equal_bytes_and_another_seed_differs():
    scene = build_object_scene("cylinder")
    a, b, c = (
        simulate_grasp(scene, APPROACHES["cylinder-side_1"], TIMELINE, SimulationSettings(seed=seed))
        for seed in (7, 7, 8)
    )
    assert a.wrench.tobytes() == b.wrench.tobytes()
    assert a.contacts.position.tobytes() == b.contacts.position.tobytes()
    assert a.joint_angles.tobytes() != c.joint_angles.tobytes()


def test_the_palm_pushes_a_displaced_object_back_to_its_surface():
    """In hold, the displaced object touches the palm, and it is at its place in a grasp without a displacement."""
    offset = make_pose([0.0, 0.002, 0.0], [1, 0, 0, 0])  # 2 mm towards the palm
    moved = simulate_grasp(
        build_object_scene("rectangular_prism"), FIRST_APPROACH, TIMELINE, SimulationSettings(object_offset=offset)
    )
    nominal = simulate_approach("rectangular_prism-wide_side_1")
    assert np.allclose(moved.object_pose[0], make_standing_pose() @ offset, atol=1e-4)
    end = last_sample(nominal, Phase.HOLD)
    # The object was displaced along y; in hold, its y coordinate differs from the nominal grasp by less than 1 mm.
    assert abs((moved.object_pose - nominal.object_pose)[end, 1, 3]) < 0.001
    assert compute_board_forces(moved, end)["palm"] > 1.0


def test_half_the_torque_gives_about_half_the_fingertip_forces():
    scene, key = build_object_scene("rectangular_prism"), "rectangular_prism-wide_side_1"
    half, full = (
        simulate_grasp(scene, FIRST_APPROACH, TIMELINE, SimulationSettings(torque_scale=0.5)),
        simulate_approach(key),
    )
    end = last_sample(full, Phase.HOLD)
    tips = [i for i, board in enumerate(HAND.boards) if board.name.startswith("fingertip")]
    fingertip_forces = [np.linalg.norm(motion.wrench[end, tips, :3], axis=1).sum() for motion in (half, full)]
    assert 0.3 < fingertip_forces[0] / fingertip_forces[1] < 0.7


def test_a_hand_of_one_board_on_one_hinge_is_simulated():
    """The simulator contains no code for particular hands; `flat8` has one board on one hinge."""
    hand = load_hand("flat8")
    scene = build_scene(hand, GraspObject("brick", ConvexPolytope.box(0.02, 0.02, 0.02), ""), "world")
    approach = Approach(
        object="brick",
        name="under",
        palm_pose=np.eye(4),
        open_angles=np.array([0.3]),
        base_targets=np.array([np.nan]),  # the hinge closes
        torque=np.array([0.2]),
    )
    object_offset = make_pose([0.02, 0.0, 0.125], [1, 0, 0, 0])
    motion = simulate_grasp(
        scene, approach, TIMELINE, SimulationSettings(object_pose=np.eye(4), object_offset=object_offset)
    )
    assert motion.joint_angles.shape[1] == 1
    assert motion.wrench.shape[1:] == (len(hand.boards), 6)


def test_an_approach_to_another_object_and_an_invalid_rate_are_refused():
    with pytest.raises(ValueError, match="'cylinder'"):
        simulate_grasp(build_object_scene("cylinder"), FIRST_APPROACH, TIMELINE)
    with pytest.raises(ValueError, match="rate_hz"):
        simulate_grasp(
            build_object_scene("rectangular_prism"), FIRST_APPROACH, TIMELINE, SimulationSettings(rate_hz=1e4)
        )
