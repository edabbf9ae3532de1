import pickle
from functools import cache

import numpy as np
import pytest

from taxel.grasp.objects import standing_pose
from taxel.grasp.plan import thesis_approaches
from taxel.grasp.reach import ArmReach, UnreachableError
from taxel.hand.errors import UnknownLinkError
from taxel.hand.kinematics import Kinematics
from taxel.hand.robot import load_robot
from taxel.hand.transforms import make_pose

ROBOT = load_robot("ur5e_allegro")
REACH = ArmReach(ROBOT)
APPROACHES = {f"{a.object}-{a.name}": a for a in thesis_approaches(withdraw_m=0.02)}


@cache
def arm_of(key):
    """Angles of the arm that bring the palm to an approach, [6]."""
    return REACH.solve(standing_pose() @ APPROACHES[key].palm_pose)


def palm_at(arm):
    angles = np.zeros(len(ROBOT.joint_names))
    angles[: len(arm)] = arm
    return Kinematics(ROBOT).compute_link_poses(angles)[ROBOT.get_link_index("palm")]


def test_it_solves_for_the_six_joints_of_the_arm():
    assert REACH.joint_names == ROBOT.joint_names[:6]


@pytest.mark.parametrize("key", APPROACHES)
def test_every_approach_is_within_reach_and_so_is_its_withdrawn_palm(key):
    approach, arm = APPROACHES[key], arm_of(key)
    assert ((arm >= ROBOT.lower[:6]) & (arm <= ROBOT.upper[:6])).all()
    found = palm_at(arm)
    assert np.abs(found[:3, 3] - (standing_pose() @ approach.palm_pose)[:3, 3]).max() < 1e-9
    assert np.abs(found - standing_pose() @ approach.palm_pose).max() < 1e-7
    withdrawn = REACH.solve(standing_pose() @ approach.palm_pose_at(1.0), near=arm)
    assert np.abs(withdrawn - arm).max() < 0.3


def test_the_arm_stays_above_the_table():
    kinematics = Kinematics(ROBOT)
    for key in APPROACHES:
        angles = np.zeros(len(ROBOT.joint_names))
        angles[:6] = arm_of(key)
        moving = kinematics.compute_link_poses(angles)[ROBOT.get_link_index("upper_arm") : ROBOT.get_link_index("palm")]
        assert moving[:, 2, 3].min() > 0.02


def test_the_same_pose_gives_the_same_bytes():
    key = list(APPROACHES)[3]
    again = ArmReach(ROBOT).solve(standing_pose() @ APPROACHES[key].palm_pose)
    assert arm_of(key).tobytes() == again.tobytes()


def test_random_poses_that_the_arm_took_are_found_again():
    seed = 20
    rng = np.random.default_rng(seed)
    for _ in range(5):
        target = palm_at(rng.uniform(-np.pi, np.pi, 6))
        assert np.abs(palm_at(REACH.solve(target)) - target).max() < 1e-7, f"seed {seed}"


def test_a_pose_out_of_reach_is_one_line_that_says_what_to_do():
    with pytest.raises(UnreachableError) as caught:
        REACH.solve(make_pose([2.0, 0.0, 0.3], [1, 0, 0, 0]))
    text = str(caught.value)
    assert "'ur5e_allegro'" in text
    assert "(2.000, 0.000, 0.300)" in text
    assert "\n" not in text
    assert str(pickle.loads(pickle.dumps(caught.value))) == text


def test_an_unknown_link_is_refused():
    with pytest.raises(UnknownLinkError):
        ArmReach(ROBOT, "tentacle")
