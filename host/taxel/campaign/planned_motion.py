"""Motions of a physical arm and hand between the grasps of a campaign: planned without collisions, then performed."""

from __future__ import annotations

import functools
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from taxel.campaign.grasp_control import PERIOD_S, SPEED_FILTER_S
from taxel.campaign.setup import Setup
from taxel.errors import TaxelError
from taxel.grasp.controller import TORQUE_LIMIT_NM
from taxel.grasp.plan import PlannedGrasp
from taxel.hand.allegro.driver import AllegroHand
from taxel.hand.allegro.joints import JOINT_COUNT
from taxel.hand.allegro.virtual import MAX_TORQUE_NM
from taxel.hand.arm.base import Arm
from taxel.planning.errors import MotionPlanningError
from taxel.planning.plan import ARM_JOINTS, MotionPlan
from taxel.planning.planner import MotionPlanner, PlannerSettings
from taxel.planning.timing import TimedPath
from taxel.skin import Skin

_T = TypeVar("_T")

ARM_TIMEOUT_S = 60.0

HOLD_NM_PER_RAD = 3.0
HOLD_NM_S_PER_RAD = 0.1
"""Stiffness and damping of the joints of the hand between two grasps (chosen).

A load of 0.05 Nm, the weight of a finger, deflects a joint by 0.017 rad. Both are lower than for the held joints in a
grasp, so that the control stays stable while a plan is computed in another thread.
"""

SETTLE_S = 0.1
"""Time after a motion of the hand in which its joints reach the end of the path, seconds (chosen)."""


class ArmTimeoutError(TaxelError):
    """The arm did not reach its target in time."""


@dataclass(frozen=True, eq=False)
class Workstation:
    """The devices of a physical campaign.

    step_arm: advances a simulated arm by a number of seconds; None for an arm that moves on its own.
    """

    arm: Arm
    hand: AllegroHand
    skin: Skin
    step_arm: Callable[[float], object] | None = None


@dataclass(frozen=True, eq=False)
class PlannedMotion:
    """The planned motion to one grasp. plan: None if the motion is infeasible. error: why it is infeasible, or None."""

    planned: PlannedGrasp
    plan: MotionPlan | None
    error: MotionPlanningError | None = None


def get_placement(planned: PlannedGrasp) -> tuple[str, int]:
    """Return the object and the session of a grasp; the operator places an object anew if one of the two changes."""
    return planned.object, planned.session


class CampaignPlanner:
    """Plans the motions of a campaign. setup: the workstation. settings: None: the defaults of the planner."""

    def __init__(self, setup: Setup, settings: PlannerSettings | None = None) -> None:
        """Create the planner of a workstation."""
        self._setup = setup
        self._planner = MotionPlanner(setup.kinematics.robot, setup.hand, setup.table_z_m, settings)

    def plan_grasp(self, planned: PlannedGrasp, start: NDArray[np.float64]) -> MotionPlan:
        """Plan the motion from a start posture f64[j] of arm and hand to a grasp. Raises MotionPlanningError."""
        setup = self._setup
        what = f"object {planned.object}, approach {planned.approach}"
        item, pose = setup.objects[planned.object], setup.object_pose(planned.object)
        return self._planner.plan(what, item, pose, setup.approach(planned), start)

    def plan_retreat(
        self, planned: PlannedGrasp, arm_angles: NDArray[np.float64], start: NDArray[np.float64]
    ) -> TimedPath:
        """Plan the motion of the arm away from the object of a grasp, to the arm angles `arm_angles` f64[6], radians.

        start: posture f64[j] of arm and hand at the start. Raises MotionPlanningError.
        """
        item, pose = self._setup.objects[planned.object], self._setup.object_pose(planned.object)
        what = f"object {planned.object}, retreat after approach {planned.approach}"
        return self._planner.plan_to_arm_posture(what, item, pose, arm_angles, start)

    def recheck(self, planned: PlannedGrasp, plan: MotionPlan, index: int, hand_angles: NDArray[np.float64]) -> None:
        """Check the plan's next motion of the arm for collisions of the hand in its measured posture.

        index: number of the waypoint at which this motion begins. hand_angles: measured angles f64[16], radians. Raises
        MotionPlanningError if the hand would collide.
        """
        item, pose = self._setup.objects[planned.object], self._setup.object_pose(planned.object)
        self._planner.recheck(plan, item, pose, index, hand_angles)

    def plan_campaign(self, grasps: Sequence[PlannedGrasp], start: NDArray[np.float64]) -> Iterator[PlannedMotion]:
        """Plan the motions of all grasps in their order, from a start posture f64[j] of arm and hand, and yield them.

        Before an object is placed anew, the arm returns to its angles at the start. An infeasible motion is yielded
        with its error; the start posture of this motion is then also the start posture of the next motion.
        """
        here, previous = start, None
        known: dict[tuple[object, ...], MotionPlan] = {}
        for planned in grasps:
            try:
                if previous is not None and get_placement(previous) != get_placement(planned):
                    here = self.plan_retreat(previous, start[:ARM_JOINTS], here).waypoints[-1]
                    previous = None
                key = (
                    planned.object,
                    planned.approach,
                    self._setup.approach(planned).open_angles.tobytes(),
                    here.tobytes(),
                )
                if key not in known:
                    known[key] = self.plan_grasp(planned, here)
            except MotionPlanningError as error:
                yield PlannedMotion(planned, None, error)
                continue
            here, previous = known[key].pregrasp, planned
            yield PlannedMotion(planned, known[key])


class MotionExecutor:
    """Performs planned motions at a workstation. The fingers are held in their posture while the arm moves."""

    def __init__(self, setup: Setup, station: Workstation) -> None:
        """Create the executor. The measured posture of the arm at this time becomes the target of all retreats."""
        self._station = station
        self._planner = CampaignPlanner(setup)
        self._hand = _HandHolder(station.hand)
        self._start = self._measure()
        self._fingers: NDArray[np.float64] | None = None  # the held hand posture; None: no torques

    def check_campaign(self, grasps: Sequence[PlannedGrasp]) -> None:
        """Plan the motions of all grasps, before anything moves.

        Raises MotionPlanningError for the first infeasible motion.
        """
        for motion in self._planner.plan_campaign(grasps, self._start):
            self._update_hand()  # the reports of the hand are read meanwhile, so that they do not accumulate
            if motion.error is not None:
                raise motion.error

    def move_to_pregrasp(self, planned: PlannedGrasp) -> MotionPlan:
        """Move arm and hand from their measured posture to the pre-grasp posture of a grasp, and return the plan.

        Raises MotionPlanningError before the motion, and the errors of arm and hand.
        """
        self._wait_for_arm()
        start = self._measure()
        plan = self._hold_during(lambda: self._planner.plan_grasp(planned, start))
        for index, segment in enumerate(zip(plan.waypoints[:-1], plan.waypoints[1:], strict=True)):
            if not np.array_equal(segment[0][:ARM_JOINTS], segment[1][:ARM_JOINTS]):
                fingers = self._measure()[ARM_JOINTS:]
                self._hold_during(functools.partial(self._planner.recheck, planned, plan, index, fingers))
            self._perform_segment(TimedPath(np.stack(segment), plan.limits))
        self._fingers = plan.pregrasp[ARM_JOINTS:]
        return plan

    def retreat(self, planned: PlannedGrasp) -> None:
        """Move the arm from the object of a grasp to its posture at the start, and then release the fingers.

        Raises MotionPlanningError before the motion, and the errors of arm and hand.
        """
        self._wait_for_arm()
        start = self._measure()
        path = self._hold_during(lambda: self._planner.plan_retreat(planned, self._start[:ARM_JOINTS], start))
        for segment in zip(path.waypoints[:-1], path.waypoints[1:], strict=True):
            self._perform_segment(TimedPath(np.stack(segment), path.limits))
        self.release()

    def release(self) -> None:
        """Stop holding the fingers: set their torques to zero."""
        self._fingers = None
        self._station.hand.set_torque(np.zeros(JOINT_COUNT))

    def hold(self, duration_s: float) -> None:
        """Hold the fingers in the pre-grasp posture of the last plan for `duration_s` seconds."""
        self._hold_during(functools.partial(time.sleep, duration_s))

    def _hold_during(self, action: Callable[[], _T]) -> _T:
        """Run an action in another thread while the fingers hold their posture; return the result of the action.

        If no posture is held, the reports of the hand are only read, so that they do not accumulate.
        """
        with ThreadPoolExecutor(1) as pool:
            future = pool.submit(action)
            while not future.done():
                self._update_hand()
                time.sleep(PERIOD_S)
            return future.result()

    def _update_hand(self) -> None:
        """Read the reports of the hand, and command the torques of the held posture if there is one.

        Reading the reports raises the errors of the hand.
        """
        if self._fingers is None:
            self._station.hand.update()
        else:
            self._hand.step(self._fingers)

    def _measure(self) -> NDArray[np.float64]:
        """Measure the joint angles of arm and hand, f64[22], radians; waits for the first reports of the fingers."""
        while True:
            self._station.hand.update()
            fingers = self._station.hand.read_joint_angles().angles
            if np.isfinite(fingers).all():
                return np.concatenate([self._station.arm.read_joint_angles(), fingers])
            time.sleep(PERIOD_S)

    def _perform_segment(self, path: TimedPath) -> None:
        """Perform one straight segment of a path, in which either the arm or the hand moves, and wait for its end.

        In a segment of the arm, the fingers hold the segment's posture.
        """
        arm, fingers = path.waypoints[:, :ARM_JOINTS], path.waypoints[:, ARM_JOINTS:]
        if not np.array_equal(arm[0], arm[1]):
            self._fingers = fingers[1]
            self._station.arm.move_joints(arm[1], path.limits.arm_speed)
            self._wait_for_arm()
            return
        begin_s = time.monotonic()
        while (elapsed_s := time.monotonic() - begin_s) < path.duration_s + SETTLE_S:
            self._fingers = path.sample(np.array([elapsed_s]))[0, ARM_JOINTS:]
            self._update_hand()
            time.sleep(PERIOD_S)

    def _wait_for_arm(self) -> None:
        """Wait until the arm is at rest. Raises ArmTimeoutError if it is still moving after `ARM_TIMEOUT_S`."""
        end = time.monotonic() + ARM_TIMEOUT_S
        while self._station.arm.is_moving:
            self._update_hand()
            if self._station.step_arm is not None:
                self._station.step_arm(PERIOD_S)
            else:
                time.sleep(PERIOD_S)
            if time.monotonic() > end:
                raise ArmTimeoutError(
                    f"arm: expected to reach its target within {ARM_TIMEOUT_S:g} s, found it still moving; clear its "
                    "path and start again"
                )


class _HandHolder:
    """Holds the joints of the hand at target angles with a proportional and damping (PD) torque."""

    def __init__(self, hand: AllegroHand) -> None:
        """Create the controller, which keeps the fingers of a hand at target angles."""
        self._hand = hand
        self._angles: NDArray[np.float64] | None = None
        self._speeds = np.zeros(JOINT_COUNT)
        self._time_s = 0.0

    def step(self, target: NDArray[np.float64]) -> None:
        """Read the latest reports of the hand and command the torques that hold it at `target` f64[16], radians.

        After a pause of more than ten control periods the estimated joint speeds restart at 0.
        """
        self._hand.update()
        angles, now_s = self._hand.read_joint_angles().angles, time.monotonic()
        elapsed_s = now_s - self._time_s
        if self._angles is None or elapsed_s > 10 * PERIOD_S:
            self._angles, self._time_s, self._speeds = angles, now_s, np.zeros(JOINT_COUNT)
        elif elapsed_s >= PERIOD_S:
            share = min(elapsed_s / SPEED_FILTER_S, 1.0)
            self._speeds += share * ((angles - self._angles) / elapsed_s - self._speeds)
            self._angles, self._time_s = angles, now_s
        torque = HOLD_NM_PER_RAD * (target - angles) - HOLD_NM_S_PER_RAD * self._speeds
        self._hand.set_torque(torque.clip(-TORQUE_LIMIT_NM, TORQUE_LIMIT_NM) / MAX_TORQUE_NM)
