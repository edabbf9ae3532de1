"""Inverse kinematics of the arm for all approaches."""

import pickle
from functools import cache

import numpy as np
import pytest

from taxel.grasp.objects import make_standing_pose
from taxel.grasp.plan import make_thesis_approaches
from taxel.grasp.reach import ArmReach, UnreachableError
from taxel.hand.errors import UnknownLinkError
from taxel.hand.kinematics import Kinematics
from taxel.hand.robot import load_robot
from taxel.hand.transforms import make_pose

ROBOT = load_robot("ur5e_allegro")
REACH = ArmReach(ROBOT)
APPROACHES = {f"{a.object}-{a.name}": a for a in make_thesis_approaches(withdraw_m=0.02)}


@cache
def solve_arm(key):
    """Solve for the arm angles of an approach, f64[6]."""
    return REACH.solve(make_standing_pose() @ APPROACHES[key].palm_pose)


def compute_palm_pose(arm):
    """Compute the pose of the palm in the robot's base frame, f64[4, 4], from arm angles f64[6]."""
    angles = np.zeros(len(ROBOT.joint_names))
    angles[: len(arm)] = arm
    return Kinematics(ROBOT).compute_link_poses(angles)[ROBOT.get_link_index("palm")]


def test_the_solved_joints_are_the_six_arm_joints():
    assert REACH.joint_names == ROBOT.joint_names[:6]


@pytest.mark.parametrize("key", APPROACHES)
def test_every_approach_and_its_withdrawn_pose_are_within_reach(key):
    """The solved joint angles are within the limits and place the palm as planned.

    Between this pose and the withdrawn pose, every joint turns by less than 0.3 rad.
    """
    approach, arm = APPROACHES[key], solve_arm(key)
    assert ((arm >= ROBOT.lower[:6]) & (arm <= ROBOT.upper[:6])).all()
    pose = compute_palm_pose(arm)
    assert np.abs(pose[:3, 3] - (make_standing_pose() @ approach.palm_pose)[:3, 3]).max() < 1e-9
    assert np.abs(pose - make_standing_pose() @ approach.palm_pose).max() < 1e-7
    withdrawn = REACH.solve(make_standing_pose() @ approach.compute_palm_pose_at(1.0), near=arm)
    assert np.abs(withdrawn - arm).max() < 0.3


def test_the_arm_stays_above_the_table():
    kinematics = Kinematics(ROBOT)
    for key in APPROACHES:
        angles = np.zeros(len(ROBOT.joint_names))
        angles[:6] = solve_arm(key)
        links = kinematics.compute_link_poses(angles)[ROBOT.get_link_index("upper_arm") : ROBOT.get_link_index("palm")]
        assert links[:, 2, 3].min() > 0.02


def test_the_solution_is_deterministic():
    key = list(APPROACHES)[3]
    repeated = ArmReach(ROBOT).solve(make_standing_pose() @ APPROACHES[key].palm_pose)
    assert solve_arm(key).tobytes() == repeated.tobytes()


def test_random_reachable_poses_are_solved():
    seed = 20
    rng = np.random.default_rng(seed)
    for _ in range(5):
        target = compute_palm_pose(rng.uniform(-np.pi, np.pi, 6))
        assert np.abs(compute_palm_pose(REACH.solve(target)) - target).max() < 1e-7, f"seed {seed}"


def test_an_unreachable_pose_raises_a_one_line_error_with_a_remedy():
    with pytest.raises(UnreachableError) as caught:
        REACH.solve(make_pose([2.0, 0.0, 0.3], [1, 0, 0, 0]))
    text = str(caught.value)
    assert "'ur5e_allegro'" in text
    assert "(2.000, 0.000, 0.300)" in text
    assert "\n" not in text
    assert str(pickle.loads(pickle.dumps(caught.value))) == text


def test_an_unknown_link_is_rejected():
    with pytest.raises(UnknownLinkError):
        ArmReach(ROBOT, "tentacle")
