from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from taxel.grasp.objects import (
    MOUNT_STIFFNESS_N_PER_M,
    MOUNT_STIFFNESS_NM_PER_RAD,
    GraspObject,
    make_standing_pose,
    make_thesis_objects,
)
from taxel.grasp.plan import Approach, make_thesis_approaches
from taxel.grasp.shapes import ConvexPolytope
from taxel.grasp.timeline import Phase, Timeline
from taxel.hand import load_hand
from taxel.hand.kinematics import build_kinematics
from taxel.hand.transforms import inverse, make_pose, to_rotation_vector
from taxel.sim.closing import simulate_grasp
from taxel.sim.scene import JOINT_FRICTION_NM, build_scene

HAND = load_hand("allegro")
LINE = Timeline(baseline_s=0.5, recovery_s=0.5)
APPROACHES = {f"{a.object}-{a.name}": a for a in make_thesis_approaches(withdraw_m=0.02)}
SIDES = [key for key in APPROACHES if not key.endswith("-top")]
FIRST = APPROACHES["rectangular_prism-wide_side_1"]


@cache
def scene_of(name):
    return build_scene(HAND, make_thesis_objects()[name], "palm")


@cache
def motion_of(key):
    return simulate_grasp(scene_of(APPROACHES[key].object), APPROACHES[key], LINE)


def last(motion, phase):
    return int(np.flatnonzero(motion.phase == phase)[-1])


def force_on_boards(motion, sample):
    return dict(zip((b.name for b in HAND.boards), np.linalg.norm(motion.wrench[sample, :, :3], axis=1), strict=True))


def force_at_hold(key):
    """Newtons on every board that touches."""
    motion = motion_of(key)
    force = force_on_boards(motion, last(motion, Phase.HOLD))
    return {name: newtons for name, newtons in force.items() if newtons > 0.2}


@pytest.mark.parametrize("key", SIDES)
def test_every_side_is_grasped_by_fingers_and_thumb_against_the_palm(key):
    force = force_at_hold(key)
    assert len(force) >= 5
    assert {"palm", "fingertip_thumb"} <= force.keys()
    assert len({name.rsplit("_", 1)[-1] for name in force} & {"index", "middle", "pinkie"}) >= 2


@pytest.mark.parametrize("key", APPROACHES)
def test_in_every_approach_the_palm_is_pressed_on_and_a_finger_or_the_thumb_bears_too(key):
    """On top of an object the thumb may pass beside it, or fingers close in the air."""
    force = force_at_hold(key)
    assert 3.0 < force.pop("palm") < 60.0
    assert 3.0 < max(force.values()) < 15.0


@pytest.mark.parametrize("key", APPROACHES)
def test_the_hand_is_nearly_at_rest_at_the_end_of_hold(key):
    motion = motion_of(key)
    end = last(motion, Phase.HOLD)
    speed = np.abs(motion.joint_angles[end] - motion.joint_angles[end - 4]) / 0.2
    assert speed.max() < 0.1


@pytest.mark.parametrize("key", ["rectangular_prism-wide_side_1", "cylinder-side_2", "triangular_prism-side_1"])
def test_the_contact_forces_balance_the_mounts_springs(key):
    motion = motion_of(key)
    end = last(motion, Phase.HOLD)
    here = motion.contacts.sample == end
    force, position = -motion.contacts.force[here], motion.contacts.position[here]
    middle = np.array([0.0, 0.0, make_thesis_objects()[APPROACHES[key].object].shape.height / 2, 1.0])
    moved, rest = motion.object_pose[end] @ middle, make_standing_pose() @ middle
    assert np.allclose(force.sum(axis=0), MOUNT_STIFFNESS_N_PER_M * (moved - rest)[:3], atol=0.2)
    moment = np.cross(position - moved[:3], force).sum(axis=0)
    turned = to_rotation_vector(motion.object_pose[end] @ inverse(make_standing_pose()))
    assert np.allclose(moment, MOUNT_STIFFNESS_NM_PER_RAD * turned, atol=0.02)


def test_the_contact_forces_on_a_finger_balance_its_joints_torques():
    """J^T f = torque for the middle finger, within the joints' friction."""
    approach, motion = APPROACHES["cylinder-side_1"], motion_of("cylinder-side_1")
    scene, end = scene_of("cylinder"), last(motion, Phase.HOLD)
    on_board = {i for i, board in enumerate(HAND.boards) if board.link_name and board.link_name.startswith("mf_")}
    for index, name in enumerate(("mf_j1", "mf_j2", "mf_j3")):
        joint = next(j for j in scene.robot.joints if j.name == name)
        below = [f"mf_{part}" for part in ("proximal", "medial", "distal")][index:]
        boards = [i for i in on_board if HAND.boards[i].link_name in below]
        here = (motion.contacts.sample == end) & np.isin(motion.contacts.board, boards)
        frame = motion.link_poses[end, scene.links.index(joint.child)]
        moment = np.cross(motion.contacts.position[here] - frame[:3, 3], motion.contacts.force[here]).sum(axis=0)
        torque = approach.torque[scene.joint_names.index(name)]
        assert moment @ (frame[:3, :3] @ joint.axis) == pytest.approx(-torque, abs=JOINT_FRICTION_NM + 0.005), name


def test_a_boards_wrench_is_that_of_its_contact_points():
    """Over the last second of hold: contacts chatter, a wrench is a mean over some steps, contacts are of one."""
    motion = motion_of("cylinder-side_1")
    samples = np.flatnonzero(motion.phase == Phase.HOLD)[-20:]
    contacts = motion.contacts
    for board in range(len(HAND.boards)):
        summed = np.zeros(6)
        for sample in samples:
            here = (contacts.sample == sample) & (contacts.board == board)
            frame = motion.sensor_poses[sample, board]
            moment = np.cross(contacts.position[here] - frame[:3, 3], contacts.force[here]).sum(axis=0)
            summed += [*(contacts.force[here].sum(axis=0) @ frame[:3, :3]), *(moment @ frame[:3, :3])]
        assert np.allclose(motion.wrench[samples, board].mean(axis=0), summed / len(samples), atol=0.15, rtol=0.02)


def test_contact_points_push_without_friction_along_the_normal_and_hardly_overlap():
    motion = motion_of("cylinder-side_1")
    held = motion.phase[motion.contacts.sample] == Phase.HOLD
    normal, force = motion.contacts.normal[held], motion.contacts.force[held]
    assert np.allclose(np.cross(normal, force), 0.0, atol=1e-6)
    assert (np.sum(normal * force, axis=1) >= -1e-9).all()
    assert motion.contacts.depth[held].max() < 1e-3


@pytest.mark.parametrize("key", APPROACHES)
def test_the_baseline_and_recovery_are_still_and_without_load(key):
    motion = motion_of(key)
    for phase in (Phase.BASELINE, Phase.RECOVERY):
        part = motion.phase == phase
        assert not motion.wrench[part].any()
        assert (np.ptp(motion.joint_angles[part], axis=0) == 0).all()


def test_a_palm_that_withdraws_feels_nothing_before_it_comes_to_an_object_that_stands_too_near():
    offset = make_pose([0.0, 0.002, 0.0], [1, 0, 0, 0])
    for approach in (replace(FIRST, withdraw_m=0.0), FIRST):
        motion = simulate_grasp(scene_of("rectangular_prism"), approach, LINE, object_offset=offset)
        assert (np.abs(motion.wrench[0]).max() == 0.0) == (approach.withdraw_m > 0)
        assert force_on_boards(motion, last(motion, Phase.HOLD))["palm"] > 1.0


def test_a_palm_that_does_not_withdraw_presses_on_the_object_from_the_beginning():
    approach = replace(APPROACHES["rectangular_prism-narrow_side_1"], withdraw_m=0.0)
    motion = simulate_grasp(scene_of("rectangular_prism"), approach, LINE)
    for phase in (Phase.BASELINE, Phase.RECOVERY):
        assert force_on_boards(motion, last(motion, phase))["palm"] > 1.0
        assert (np.ptp(motion.joint_angles[motion.phase == phase], axis=0) == 0).all()


def test_poses_agree_with_forward_kinematics():
    motion = motion_of("cylinder-top")
    kinematics = build_kinematics(HAND)
    angles = np.zeros((len(motion.time_s), 22))
    angles[:, 6:] = motion.joint_angles
    wanted = kinematics.compute_link_poses(angles)
    palm = scene_of("cylinder").robot.get_link_index("palm")
    step = motion.link_poses[:, :1] @ inverse(wanted[:, palm : palm + 1])
    assert np.allclose(step @ wanted[:, palm:], motion.link_poses, atol=1e-9)
    assert np.allclose(step @ kinematics.compute_sensor_poses(angles), motion.sensor_poses, atol=1e-9)


def test_the_same_arguments_give_the_same_bytes_and_seeds_differ():
    scene = scene_of("cylinder")
    a, b, c = (simulate_grasp(scene, APPROACHES["cylinder-side_1"], LINE, seed=seed) for seed in (7, 7, 8))
    assert a.wrench.tobytes() == b.wrench.tobytes()
    assert a.contacts.position.tobytes() == b.contacts.position.tobytes()
    assert a.joint_angles.tobytes() != c.joint_angles.tobytes()


def test_an_object_that_stands_elsewhere_than_planned_is_pressed_where_it_stands():
    offset = make_pose([0.0, 0.002, 0.0], [1, 0, 0, 0])  # 2 mm towards the palm
    moved = simulate_grasp(scene_of("rectangular_prism"), FIRST, LINE, object_offset=offset)
    nominal = motion_of("rectangular_prism-wide_side_1")
    assert np.allclose(moved.object_pose[0], make_standing_pose() @ offset, atol=1e-6)
    end = last(nominal, Phase.HOLD)
    assert force_on_boards(moved, end)["palm"] > force_on_boards(nominal, end)["palm"] + 1.0


def test_half_the_torque_presses_less():
    scene, key = scene_of("rectangular_prism"), "rectangular_prism-wide_side_1"
    half, full = simulate_grasp(scene, FIRST, LINE, torque_scale=0.5), motion_of(key)
    end = last(full, Phase.HOLD)
    tips = [i for i, board in enumerate(HAND.boards) if board.name.startswith("fingertip")]
    total = [np.linalg.norm(m.wrench[end, tips, :3], axis=1).sum() for m in (half, full)]
    assert 0.3 < total[0] / total[1] < 0.7


def test_one_hinge_closes_on_a_brick():
    """A hand of one board, described in a file like any other, needs no code of its own."""
    hand = load_hand("flat8")
    scene = build_scene(hand, GraspObject("brick", ConvexPolytope.box(0.02, 0.02, 0.02), ""), "world")
    swing = Approach("brick", "under", np.eye(4), np.array([0.3]), np.array([np.nan]), np.array([0.2]))
    place = make_pose([0.02, 0.0, 0.125], [1, 0, 0, 0])
    above = simulate_grasp(scene, swing, LINE, object_pose=np.eye(4), object_offset=place)
    assert above.joint_angles.shape[1] == 1
    assert above.wrench.shape[1:] == (len(hand.boards), 6)


def test_a_grasp_of_another_object_or_hand_is_refused():
    with pytest.raises(ValueError, match="'cylinder'"):
        simulate_grasp(scene_of("cylinder"), FIRST, LINE)
    with pytest.raises(ValueError, match="rate_hz"):
        simulate_grasp(scene_of("rectangular_prism"), FIRST, LINE, rate_hz=1e4)
