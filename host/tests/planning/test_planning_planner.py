"""Plans of approaches: free by an independent check, within limits, and one-line errors for infeasible ones."""

from dataclasses import replace

import numpy as np
import pytest

from taxel.hand.allegro import JOINT_NAMES
from taxel.hand.transforms import make_pose
from taxel.planning.errors import BlockedPoseError, NoPathError, StartPostureError, UnreachablePoseError
from taxel.planning.plan import ARM_JOINTS
from taxel.planning.planner import CONTACT_DEPTH_M, MotionPlanner, PlannerSettings, replace_open_angles
from taxel.planning.timing import SpeedLimits, TimedPath

WHAT = "object cylinder, approach side_1"
THUMB_2 = JOINT_NAMES.index("thumb_2")


@pytest.fixture(scope="module")
def plan(setup, planner, planned, upright):
    item, pose = setup.objects["cylinder"], setup.object_pose("cylinder")
    return planner.plan(WHAT, item, pose, setup.approach(planned), upright)


def plan_with(planner, setup, planned, start, pose=None):
    """Plan the approach of a planned grasp to the cylinder at a pose; None: at its place."""
    pose = setup.object_pose("cylinder") if pose is None else pose
    return planner.plan(WHAT, setup.objects["cylinder"], pose, setup.approach(planned), start)


def test_a_plan_leads_from_the_start_to_the_palm_pose_of_the_approach(plan, setup, planned, upright):
    approach, pose = setup.approach(planned), setup.object_pose("cylinder")
    assert np.array_equal(plan.waypoints[0], upright)
    assert np.array_equal(plan.pregrasp[6:], approach.open_angles)
    palms = setup.wrist_poses(np.stack([plan.grasping[:6], plan.pregrasp[:6]]))
    assert palms[0] == pytest.approx(pose @ approach.compute_palm_pose_at(0.0), abs=1e-7)
    assert palms[1] == pytest.approx(pose @ approach.compute_palm_pose_at(1.0), abs=1e-7)


def test_each_step_moves_the_arm_or_the_hand(plan):
    for step in np.abs(np.diff(plan.waypoints, axis=0)):
        assert (step[:6] > 0).any() != (step[6:] > 0).any()


def test_a_plan_is_free_by_the_independent_check(plan, setup, independent):
    assert independent.find_overlap_on_path(plan.waypoints) is None
    depth_m = setup.hand.layer_m + CONTACT_DEPTH_M
    assert independent.find_overlap_on_path(np.stack([plan.pregrasp, plan.grasping]), depth_m) is None


def test_the_independent_check_finds_the_contact_of_the_approach(plan, independent):
    overlap = independent.find_overlap(plan.grasping)
    assert overlap is not None
    assert "object" in (overlap.first, overlap.second)


def test_equal_inputs_give_equal_plans(plan, setup, planned, upright):
    planner = MotionPlanner(setup.kinematics.robot, setup.hand, setup.table_z_m)
    assert np.array_equal(plan_with(planner, setup, planned, upright).waypoints, plan.waypoints)


def test_speeds_and_accelerations_are_within_their_limits(plan):
    speed, acceleration = plan.limits.get_joint_limits(22)
    step_s = 0.002
    angles = plan.path.sample(np.arange(0.0, plan.path.duration_s + step_s, step_s))
    speeds = np.diff(angles, axis=0) / step_s
    assert (np.abs(speeds) <= speed * (1 + 1e-6)).all()
    assert (np.abs(np.diff(speeds, axis=0)) / step_s <= acceleration * (1 + 1e-6)).all()
    assert np.array_equal(angles[0], plan.waypoints[0])
    assert np.array_equal(angles[-1], plan.pregrasp)


def test_an_unreachable_object_raises_a_one_line_error_with_object_approach_and_pose(planner, setup, planned, upright):
    pose = make_pose([1.4, 0.0, 0.03], [1.0, 0.0, 0.0, 0.0])
    with pytest.raises(UnreachablePoseError) as caught:
        plan_with(planner, setup, planned, upright, pose)
    assert str(caught.value).startswith(f"{WHAT}: unreachable: the arm cannot place the palm at (1.")
    assert "\n" not in str(caught.value)


def test_a_start_posture_in_collision_raises_a_one_line_error_with_the_pair(planner, setup, planned, upright):
    start = upright.copy()
    start[:6] = 0.0  # with all joint angles 0, the arm is horizontal and the hand reaches into the table
    with pytest.raises(StartPostureError) as caught:
        plan_with(planner, setup, planned, start)
    assert str(caught.value).startswith(f"{WHAT}: start posture in collision: ")
    assert "and table overlap by" in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(("joint", "value"), [(2, 3.3), (0, -6.4), (5, np.nan)])
def test_a_start_posture_that_is_not_finite_or_outside_the_arm_limits_raises_a_one_line_error(
    joint, value, planner, setup, planned, upright
):
    start = upright.copy()
    start[joint] = value
    with pytest.raises(StartPostureError, match=r"^object cylinder, approach side_1: start posture: .*$"):
        plan_with(planner, setup, planned, start)


def test_an_object_below_the_table_raises_a_one_line_error_with_a_colliding_pair(planner, setup, planned, upright):
    pose = setup.object_pose("cylinder").copy()
    pose[2, 3] -= 0.12
    with pytest.raises(BlockedPoseError, match=r"approach in collision: .* and table overlap by .* mm .*$"):
        plan_with(planner, setup, planned, upright, pose)


def test_a_motion_without_a_path_raises_a_one_line_error(plan, setup, planned):
    """From one side of the cylinder to the next, no straight segment is free, and no random posture is permitted."""
    planner = MotionPlanner(
        setup.kinematics.robot, setup.hand, setup.table_z_m, PlannerSettings(iterations=0, via_postures=0)
    )
    with pytest.raises(NoPathError, match=r"no collision-free path .* within 0 random postures; .*$") as caught:
        plan_with(planner, setup, replace(planned, approach="side_2"), plan.pregrasp)
    assert "\n" not in str(caught.value)


def test_a_thumb_that_would_reach_below_the_table_is_curled(planner, setup, planned, upright):
    blocked = replace(planned, object="rectangular_prism", approach="narrow_side_2")
    approach, pose = setup.approach(blocked), setup.object_pose("rectangular_prism")
    plan = planner.plan("curled", setup.objects["rectangular_prism"], pose, approach, upright)
    assert plan.pregrasp[ARM_JOINTS:][THUMB_2] > approach.open_angles[THUMB_2]


def test_closing_starts_from_the_hand_posture_of_the_plan(plan, setup, planned):
    open_angles = replace_open_angles(setup.approach(planned), plan).open_angles
    assert np.array_equal(open_angles, plan.pregrasp[ARM_JOINTS:])


def test_a_hand_posture_that_would_collide_on_the_way_is_found_before_the_arm_moves(plan, planner, setup):
    item, pose = setup.objects["cylinder"], setup.object_pose("cylinder")
    last_motion = len(plan.waypoints) - 2
    planned_hand = plan.pregrasp[ARM_JOINTS:]
    planner.recheck(plan, item, pose, last_motion, planned_hand)
    folded = planned_hand.copy()
    # Index finger and thumb are bent towards each other, so that they collide.
    folded[[JOINT_NAMES.index(name) for name in ("index_1", "index_2", "index_3", "thumb_2", "thumb_3")]] = 1.5
    with pytest.raises(BlockedPoseError, match=r"with the measured hand posture the planned motion collides: .*$"):
        planner.recheck(plan, item, pose, last_motion, folded)


def test_a_path_rests_at_every_waypoint_and_lasts_the_sum_of_its_segments():
    waypoints = np.zeros((3, 22))
    waypoints[1:, 0] = 1.0  # an arm joint moves by 1 rad in the first segment
    waypoints[2, ARM_JOINTS] = 0.5  # a hand joint moves by 0.5 rad in the second segment
    path = TimedPath(waypoints, SpeedLimits(arm_speed=0.5, arm_acceleration=1.4, hand_speed=1.0, hand_acceleration=5.0))
    # Duration of a trapezoidal profile: distance / speed + speed / acceleration.
    assert path.durations_s == pytest.approx([1.0 / 0.5 + 0.5 / 1.4, 0.5 / 1.0 + 1.0 / 5.0])
    times = np.cumsum(path.durations_s)
    assert path.sample(np.array([-1.0, times[0], 99.0])) == pytest.approx(waypoints)


@pytest.mark.parametrize("arguments", [{"arm_speed": 0.0}, {"arm_speed": 4.0}, {"hand_acceleration": np.inf}])
def test_limits_outside_their_range_are_refused(arguments):
    with pytest.raises(ValueError, match=next(iter(arguments))):
        SpeedLimits(**arguments)
