"""Plan the motion of arm and hand from a start posture to the approach of a grasp, without collisions."""

import itertools
from collections.abc import Iterator
from dataclasses import replace
from typing import Final

import numpy as np

from taxel.grasp.objects import GraspObject
from taxel.grasp.plan import Approach
from taxel.grasp.reach import ArmReach, UnreachableError
from taxel.hand import Hand
from taxel.hand.arm.base import ARM_JOINT_NAMES, JOINT_LIMIT_RAD
from taxel.hand.kinematics import Kinematics
from taxel.hand.robot import Robot
from taxel.hand.transforms import inverse, to_rotation_vector
from taxel.planning.bodies import WRIST_LINK, BodyModel, Surroundings
from taxel.planning.clearance import FLOOR_SHARE, Clearances
from taxel.planning.errors import (
    BlockedPoseError,
    MotionPlanningError,
    StartPostureError,
    UnreachablePoseError,
)
from taxel.planning.path_search import Goal, PathSearch, PlannerSettings, describe_collision
from taxel.planning.plan import ARM_JOINTS, MotionPlan
from taxel.planning.timing import TimedPath
from taxel.types import FloatArray

START_CLEARANCE_M: Final = 0.0005
"""Smallest distance of two bodies at the start of a motion, metres (chosen); nearer bodies are treated as in collision.

A start between this distance and the clearance of a plan is accepted, because the arm must be able to leave it; the
pairs concerned keep at least their start distance.
"""

APPROACH_CLEARANCE_M: Final = 0.002
"""Smallest distance during the linear approach, metres (chosen), except between hand and object.

Below the clearance of a plan, because planned grasps are a few millimetres above stand or table.
"""

CONTACT_DEPTH_M: Final = 0.001
"""Deepest overlap of hand and object at the end of the approach beyond the soft layer, metres (chosen).

Stand and skin yield, or the object shifts. Planned palm poses reach up to 0.2 mm beyond the layer.
"""

_CONTACT_FLOOR_M: Final = 0.0005
"""Overlap beyond `CONTACT_DEPTH_M` that is excluded between the samples of the approach, metres."""

LINE_TOLERANCE_M: Final = 0.001
"""Largest deviation of the palm from the straight line of the approach, metres (chosen: the following error of an arm).

The arm moves on a straight line in joint space; over 20 mm it deviates by about 0.1 mm, except near a singularity.
"""

LINE_TOLERANCE_RAD: Final = 0.01
"""Largest rotation of the palm away from its direction during the approach, radians; 2 mm at the fingertips."""

CURL_SHARES: Final = (0.0, 0.5, 1.0)
"""Curl of the thumb that is tried in the pre-grasp posture: share of the range of its third joint, if it closes.

The open thumb of some approaches would reach below the table; the experimenters also curled it (original sources).
"""

TURNS: Final = 4
GOALS: Final = 16
"""Largest numbers of turns of an arm posture, and of goals of a search (chosen).

With one turn only, one of 27 random problems had no path; more goals cost 5 ms each.
"""

NEAR_ITERATIONS: Final = 15
"""Steps of the inverse kinematics over the 20 mm of an approach; about five suffice away from a singularity."""

_CURLED_JOINT = 14  # of the sixteen hand joints: the third joint of the thumb


class MotionPlanner:
    """Planner for one robot with its skin. Not thread-safe.

    robot: arm and hand; its first six revolute joints are those of the arm. hand: the skin. table_z_m: height of the
    table in the frame of the robot's root.
    """

    def __init__(
        self, robot: Robot, hand: Hand, table_z_m: float = 0.0, settings: PlannerSettings | None = None
    ) -> None:
        """Create a planner. table_z_m: height of the table in the frame of the robot's root, metres."""
        self.robot, self.hand, self.table_z_m = robot, hand, table_z_m
        self.settings = settings or PlannerSettings()
        self._reach = ArmReach(robot, WRIST_LINK)
        self._kinematics = Kinematics(robot)
        self._lower = np.r_[np.maximum(robot.lower[:ARM_JOINTS], -np.array(JOINT_LIMIT_RAD)), robot.lower[ARM_JOINTS:]]
        self._upper = np.r_[np.minimum(robot.upper[:ARM_JOINTS], np.array(JOINT_LIMIT_RAD)), robot.upper[ARM_JOINTS:]]
        self._clearances: dict[tuple[str, bytes], Clearances] = {}
        self._solutions: dict[bytes, list[tuple[FloatArray, FloatArray]]] = {}

    def plan(
        self, what: str, grasp_object: GraspObject, object_pose: FloatArray, approach: Approach, start: FloatArray
    ) -> MotionPlan:
        """Plan the motion from a start posture f64[j] to an approach of an object.

        what: name of the motion in messages. object_pose: f64[4, 4] in the frame of the robot's root. Raises
        StartPostureError, UnreachablePoseError, BlockedPoseError or NoPathError, each with one line.
        """
        clearances = self.get_clearances(grasp_object, object_pose)
        start = np.asarray(start, dtype=np.float64)
        self._check_start(what, clearances, start)
        goals = self._find_goals(what, clearances, object_pose, approach, start)
        search = PathSearch(clearances, self._make_requirement(clearances, start), self._lower, self._upper, start)
        path, goal = search.run(what, goals, self.settings)
        return MotionPlan(what, path, np.r_[goal.grasping, goal.hand], self.settings.limits)

    def plan_to_arm_posture(
        self, what: str, grasp_object: GraspObject, object_pose: FloatArray, arm_angles: FloatArray, start: FloatArray
    ) -> TimedPath:
        """Plan the motion of the arm from a start posture f64[j] to arm angles f64[6], with a constant hand posture.

        Arguments and errors as for `plan`.
        """
        clearances = self.get_clearances(grasp_object, object_pose)
        self._check_start(what, clearances, start)
        required = self._make_requirement(clearances, start)
        goal = Goal(arm_angles, arm_angles, start[ARM_JOINTS:])
        if (collision := clearances.find_collision(np.r_[arm_angles, goal.hand], required)) is not None:
            raise BlockedPoseError(
                what,
                f"posture in collision: {describe_collision(clearances, collision)}; choose another posture of the arm",
            )
        search = PathSearch(clearances, required, self._lower, self._upper, start)
        path, _ = search.run(what, [goal], self.settings)
        return TimedPath(path, self.settings.limits)

    def recheck(
        self, plan: MotionPlan, grasp_object: GraspObject, object_pose: FloatArray, index: int, hand_angles: FloatArray
    ) -> None:
        """Check the next motion of the arm, from waypoint `index` on, with measured hand angles f64[j - 6].

        The check ends where the plan moves the hand again. Raises BlockedPoseError if the measured posture of the hand
        would collide.
        """
        clearances = self.get_clearances(grasp_object, object_pose)
        required = np.full(len(clearances.all_pairs), START_CLEARANCE_M)
        waypoints = plan.waypoints[index:].copy()
        waypoints[:, ARM_JOINTS:] = hand_angles
        for begin, end in itertools.pairwise(waypoints):
            if np.array_equal(begin[:ARM_JOINTS], end[:ARM_JOINTS]):
                break  # the hand moves again; the next check uses its next measured angles
            if (collision := clearances.check_segment(begin, end, required)) is not None:
                raise BlockedPoseError(
                    plan.what,
                    "with the measured hand posture the planned motion collides: "
                    f"{describe_collision(clearances, collision)}; check the fingers for an obstacle and start again",
                )

    def get_clearances(self, grasp_object: GraspObject, object_pose: FloatArray) -> Clearances:
        """Return the distance computation of the workstation with an object at a pose f64[4, 4]; cached."""
        key = grasp_object.name, object_pose.tobytes()
        if key not in self._clearances:
            around = Surroundings(self.table_z_m, grasp_object, object_pose)
            self._clearances[key] = Clearances(BodyModel(self.robot, self.hand, around))
        return self._clearances[key]

    def _check_start(self, what: str, clearances: Clearances, start: FloatArray) -> None:
        """Check the start posture: number, finiteness, limits of the arm, collisions. Raises StartPostureError.

        Hand joints may be outside their range: the zero of an encoder is uncertain by some degrees.
        """
        if start.shape != (len(self.robot.joint_names),) or not np.isfinite(start).all():
            raise StartPostureError(
                what, f"start posture: expected {len(self.robot.joint_names)} finite joint angles, found {start.shape}"
            )
        for j in range(ARM_JOINTS):
            if not self._lower[j] <= start[j] <= self._upper[j]:
                raise StartPostureError(
                    what,
                    f"start posture: {ARM_JOINT_NAMES[j]}: expected {self._lower[j]:.3f} to {self._upper[j]:.3f} rad, "
                    f"found {start[j]:.3f}; move the arm within its limits by hand",
                )
        collision = clearances.find_collision(start, np.full(len(clearances.all_pairs), START_CLEARANCE_M))
        if collision is not None:
            raise StartPostureError(
                what,
                f"start posture in collision: {describe_collision(clearances, collision)}; nothing has moved; "
                "move arm or fingers by hand until they are free",
            )

    def _make_requirement(self, clearances: Clearances, start: FloatArray) -> FloatArray:
        """Make the required distance of each pair, f64[p], metres: the clearance of a plan, or the start distance.

        The smaller of the two is required, so that the arm can leave a narrow start posture. A tenth of
        `START_CLEARANCE_M` is subtracted from the start distance, so that rounding does not reject the start posture.
        """
        wanted = clearances.bodies.clearance
        return np.minimum(wanted, clearances.measure(start, wanted) - START_CLEARANCE_M / 10)

    def _find_goals(
        self, what: str, clearances: Clearances, object_pose: FloatArray, approach: Approach, start: FloatArray
    ) -> list[Goal]:
        """Find the free pre-grasp postures, nearest to the start first, with the least curl of the thumb.

        Raises UnreachablePoseError or BlockedPoseError.
        """
        solutions = self._solve_arm(what, object_pose, approach)
        problems: list[tuple[float, str]] = []
        for hand in self._make_open_postures(approach):
            goals = []
            for grasping, pregrasp in solutions:
                if (problem := self._find_problem(clearances, Goal(pregrasp, grasping, hand))) is not None:
                    problems.append(problem)
                    continue
                for turns in self._find_turns(start[:ARM_JOINTS], grasping, pregrasp):
                    goals.append(Goal(pregrasp + turns, grasping + turns, hand))
            if goals:
                return sorted(goals, key=lambda goal: float(np.abs(goal.pregrasp - start[:ARM_JOINTS]).max()))[:GOALS]
        raise BlockedPoseError(
            what,
            f"approach in collision: {max(problems)[1]} ({len(solutions)} postures of the arm were tried); "
            "move the object or change the approach",
        )

    def _solve_arm(self, what: str, object_pose: FloatArray, approach: Approach) -> list[tuple[FloatArray, FloatArray]]:
        """Solve for the arm postures of an approach: pairs (posture at the object, pre-grasp posture), f64[6] each.

        The result is cached. Raises UnreachablePoseError if there is no such pair.
        """
        poses = [object_pose @ approach.compute_palm_pose_at(withdrawal) for withdrawal in (0.0, 1.0)]
        key = np.stack(poses).tobytes()
        if key not in self._solutions:
            found = []
            try:
                for grasping in self._reach.solve_all(poses[0]):
                    pregrasp = self._solve_near(poses[1], grasping)
                    if pregrasp is not None:
                        found.append((grasping, pregrasp))
                if not found:
                    self._reach.solve(poses[1])  # names the pose out of reach
            except UnreachableError as error:
                x, y, z = error.position
                raise UnreachablePoseError(
                    what,
                    f"unreachable: the arm cannot place the palm at ({x:.3f}, {y:.3f}, {z:.3f}) m, it misses the pose "
                    f"by {error.miss_m * 1e3:.2g} mm, the rotation error included; move the object towards the arm or "
                    "change the approach",
                ) from error
            self._solutions[key] = found
        if not self._solutions[key]:
            raise UnreachablePoseError(
                what,
                "unreachable: no posture of the arm reaches both ends of the linear approach; "
                "move the object towards the arm or change the approach",
            )
        return self._solutions[key]

    def _solve_near(self, palm_pose: FloatArray, near: FloatArray) -> FloatArray | None:
        """Solve for the arm posture f64[6] of a palm pose near another posture; None if the pose is out of reach."""
        try:
            return self._reach.solve(palm_pose, near=near, iterations=NEAR_ITERATIONS)
        except UnreachableError:
            return None

    def _make_open_postures(self, approach: Approach) -> Iterator[FloatArray]:
        """Yield the hand postures that are tried before the approach, f64[16]: with increasing curl of the thumb."""
        is_closing = len(approach.open_angles) > _CURLED_JOINT and not approach.is_held[_CURLED_JOINT]
        for share in CURL_SHARES if is_closing else CURL_SHARES[:1]:
            posture = approach.open_angles.copy()
            if share:
                upper = self._upper[ARM_JOINTS + _CURLED_JOINT]
                posture[_CURLED_JOINT] += share * (upper - posture[_CURLED_JOINT])
            yield posture

    def _find_turns(self, start: FloatArray, grasping: FloatArray, pregrasp: FloatArray) -> FloatArray:
        """Find the full turns f64[k, 6], radians, of an arm posture within the limits, nearest to the start first.

        At most `TURNS` of them. A joint that is a turn away gives the same pose, but may be reached on a freer path.
        """
        turns = 2 * np.pi * np.array(list(itertools.product((-1, 0, 1), repeat=ARM_JOINTS)))
        is_inside = (np.minimum(grasping, pregrasp) + turns >= self._lower[:ARM_JOINTS]).all(axis=1)
        is_inside &= (np.maximum(grasping, pregrasp) + turns <= self._upper[:ARM_JOINTS]).all(axis=1)
        distance = np.abs(pregrasp + turns - start).sum(axis=1)[is_inside]
        return np.asarray(turns[is_inside][np.argsort(distance, kind="stable")[:TURNS]])

    def _find_problem(self, clearances: Clearances, goal: Goal) -> tuple[float, str] | None:
        """Find the problem that prevents an approach: (distance in metres, description); None if the approach is free.

        A larger distance is less severe; -1 if the palm would leave the straight line.
        """
        before, at_object = np.r_[goal.pregrasp, goal.hand], np.r_[goal.grasping, goal.hand]
        collision = clearances.find_collision(before, clearances.bodies.clearance)
        if collision is None:
            if not self._is_straight(goal):
                return -1.0, "the palm leaves the straight line of the approach near a singularity of the arm"
            collision = clearances.check_segment(before, at_object, *self._make_approach_requirement(clearances))
        if collision is None:
            return None
        return collision.distance_m, describe_collision(clearances, collision)

    def _make_approach_requirement(self, clearances: Clearances) -> tuple[FloatArray, FloatArray]:
        """Make the required distances of each pair in the linear approach: at samples and between them, f64[p] each.

        Metres. A negative distance permits an overlap: the hand may compress its soft layer at the object.
        """
        bodies = clearances.bodies
        required = np.minimum(bodies.clearance, APPROACH_CLEARANCE_M)
        depth_m = (self.hand.layer_m or 0.0) + CONTACT_DEPTH_M
        is_contact = bodies.is_contact_pair
        floor = np.where(is_contact, -depth_m - _CONTACT_FLOOR_M, FLOOR_SHARE * required)
        return np.where(is_contact, -depth_m, required), floor

    def _is_straight(self, goal: Goal) -> bool:
        """Return whether the palm stays near the straight line of the approach, and nearly keeps its orientation."""
        shares = np.linspace(0, 1, 9)[:, None]
        angles = np.zeros((len(shares), len(self.robot.joint_names)))
        angles[:, :ARM_JOINTS] = goal.pregrasp + shares * (goal.grasping - goal.pregrasp)
        poses = self._kinematics.compute_link_poses(angles)[:, self.robot.get_link_index(WRIST_LINK)]
        line = poses[0, :3, 3] + shares * (poses[-1, :3, 3] - poses[0, :3, 3])
        turn = np.linalg.norm(to_rotation_vector(inverse(poses[:1]) @ poses), axis=-1)
        deviation = np.linalg.norm(poses[:, :3, 3] - line, axis=-1)
        return bool(deviation.max() <= LINE_TOLERANCE_M and turn.max() <= LINE_TOLERANCE_RAD)


def replace_open_angles(approach: Approach, plan: MotionPlan) -> Approach:
    """Return an approach whose open hand posture is that of a plan; closing starts from it."""
    return replace(approach, open_angles=plan.grasping[ARM_JOINTS:])


__all__ = ["MotionPlanner", "MotionPlanningError", "PlannerSettings", "replace_open_angles"]
