"""A grasp campaign on a physical workstation: arm, hand and skin through their interfaces, in real time."""

from __future__ import annotations

import contextlib
import functools
import os
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from taxel.campaign.grasp_control import PERIOD_S, JointLog, control_grasp
from taxel.campaign.planned_motion import MotionExecutor, Workstation, get_placement
from taxel.campaign.poll_cycles import PollCycles, group_by_poll_cycle
from taxel.campaign.progress import Progress, no_progress
from taxel.campaign.setup import Setup
from taxel.campaign.store import open_campaign_writer
from taxel.errors import TaxelError
from taxel.grasp.controller import GraspController
from taxel.grasp.plan import PlannedGrasp
from taxel.grasp.timeline import Phase, Timeline
from taxel.hand.allegro.driver import POSITION_PERIOD_MS
from taxel.hand.allegro.joints import JOINT_COUNT
from taxel.hand.control_loop import ControlLoop
from taxel.planning.plan import ARM_JOINTS
from taxel.planning.planner import replace_open_angles
from taxel.planning.timing import ARM_SPEED_RAD_S
from taxel.recording.grasp_record import GraspRecord
from taxel.skin import Skin
from taxel.stream import TaxelFrame

_T = TypeVar("_T")

RATE_HZ = 18.8
"""Nominal frame rate of 17 boards at an I2C clock of 400 kHz; the frames carry their own times."""

WITHDRAW_SHARE = 0.5
"""Share of the release phase after which the arm withdraws; the fingers are open by then."""

LATE_FRAMES_S = 0.3
"""Time after the end of a grasp in which its last frames may still arrive."""


JOIN_TIMEOUT_S = 2.0
"""Limit for the end of the reading thread, which may wait for a frame that never arrives."""


@dataclass(frozen=True)
class PhysicalSettings:
    """Settings of a campaign on a physical workstation.

    timeline: phases of a grasp. confirm_placement: called before the first grasp and whenever the object or the session
    changes; returns when the operator has placed the object. None: no confirmation.
    """

    timeline: Timeline = field(default_factory=Timeline)
    confirm_placement: Callable[[PlannedGrasp], object] | None = None


def run_physical(
    path: str | os.PathLike[str],
    plan: Sequence[PlannedGrasp],
    station: Workstation,
    settings: PhysicalSettings | None = None,
    setup: Setup | None = None,
    overwrite: bool = False,
    resume: bool = False,
    progress: Progress = no_progress,
) -> None:
    """Perform the grasps of `plan` with a physical hand, and write each finished grasp to the dataset `path`.

    station: arm, hand and skin. overwrite: replace an existing file. resume: keep the grasps that the file already
    contains. progress: called with the number of finished grasps and the total. All motions of the arm are planned
    before the arm moves, and each motion is planned again from the measured joint angles before the motion begins. An
    infeasible motion raises MotionPlanningError. Raises the errors of arm, hand and skin, with one-line messages. After
    an error the finished grasps are in the file, the torques of the hand are zero and the arm is stopped.
    """
    setup, settings = setup or Setup(), settings or PhysicalSettings()
    with open_campaign_writer(path, "real", setup, RATE_HZ, "physical hand", overwrite, resume) as out:
        missing = [planned for planned in plan if planned.id not in out.ids]
        done = len(plan) - len(missing)
        progress(done, len(plan))
        motion = MotionExecutor(setup, station)
        motion.check_campaign(missing)
        with _FrameCollector(station.skin) as collector:
            previous: PlannedGrasp | None = None
            for planned in missing:
                if previous is None or get_placement(previous) != get_placement(planned):
                    if previous is not None:
                        _run_or_stop(station, functools.partial(motion.retreat, previous))
                    _confirm_placement(station, settings, planned)
                out.add(_perform_grasp(setup, planned, station, settings.timeline, collector, motion), planned.id)
                previous, done = planned, done + 1
                progress(done, len(plan))
        motion.release()


def _run_or_stop(station: Workstation, action: Callable[[], _T]) -> _T:
    """Run an action and return its result; if it raises an error, stop the arm and set the hand's torques to zero.

    The error is raised again. Errors of the arm and the hand while they are stopped are suppressed.
    """
    try:
        return action()
    except BaseException:
        with contextlib.suppress(TaxelError):  # the first error is the more informative one
            station.arm.stop()
        with contextlib.suppress(TaxelError):
            station.hand.set_torque(np.zeros(JOINT_COUNT))
        raise


def _perform_grasp(
    setup: Setup,
    planned: PlannedGrasp,
    station: Workstation,
    timeline: Timeline,
    collector: _FrameCollector,
    motion: MotionExecutor,
) -> GraspRecord:
    """Perform one grasp with the physical hand and return its record.

    station: arm, hand and skin. collector: collects the frames of the skin in a thread. motion: plans and performs the
    motion to the pre-grasp posture. After an error the arm is stopped and the torques of the hand are zero.
    """

    def perform() -> tuple[_ArmSchedule, JointLog, list[TaxelFrame]]:
        """Move to the pre-grasp posture, and perform the grasp.

        Returns the arm's schedule with its log, the log of the hand's joint angles and the frames of the skin.
        """
        path = motion.move_to_pregrasp(planned)
        schedule = _ArmSchedule(station, timeline, path.grasping[:ARM_JOINTS], path.pregrasp[:ARM_JOINTS])
        collector.discard()
        controller = GraspController(replace_open_angles(setup.approach(planned), path), timeline)
        joints = control_grasp(
            station.hand, controller, 0.0, timeline.duration_s, schedule.wait_for_period, schedule.on_period
        )
        motion.hold(LATE_FRAMES_S)
        return schedule, joints, collector.frames()

    schedule, joints, frames = _run_or_stop(station, perform)
    start_s = schedule.start_s
    cycles = group_by_poll_cycle(setup.hand, frames).between(start_s, start_s + timeline.duration_s)
    return _make_record(setup, planned, timeline, cycles, start_s, schedule.log(), joints)


class _ArmSchedule:
    """Moves the arm to the object and back while the hand is controlled, and logs the joint angles of the arm.

    start_s: start of the grasp's timeline on the clock of the skin's frames.
    """

    def __init__(
        self,
        station: Workstation,
        timeline: Timeline,
        grasping: NDArray[np.float64],
        withdrawn: NDArray[np.float64],
    ) -> None:
        """Create the schedule of the two moves of the arm in one grasp.

        The arm moves to the object at the start of closing, and away from the object during release. grasping,
        withdrawn: joint angles of the arm at the object and withdrawn from it, f64[6] radians.
        """
        self._station = station
        self._moves = [(timeline.get_start_s(Phase.CLOSING), grasping)]
        self._moves += [(timeline.get_start_s(Phase.RELEASE) + WITHDRAW_SHARE * timeline.release_s, withdrawn)]
        self._loop = ControlLoop(PERIOD_S, time.monotonic)
        self._period = 0
        self._times: list[float] = []
        self._angles: list[NDArray[np.float64]] = []
        self.start_s = 0.0

    def wait_for_period(self) -> int:
        """Wait for the next control period and return its number; a simulated arm is advanced by the elapsed time."""
        previous, self._period = self._period, self._loop.wait()
        if self._station.step_arm is not None:
            self._station.step_arm((self._period - previous) * PERIOD_S)
        return self._period

    def on_period(self, time_s: float) -> None:
        """Start the next scheduled move of the arm if it is due and the arm is at rest; log the angles of the arm.

        time_s: seconds since the start of the grasp. The first call also sets `start_s`.
        """
        if not self._times:
            self.start_s = time.monotonic() - time_s
        arm = self._station.arm
        if self._moves and time_s >= self._moves[0][0] and not arm.is_moving:
            arm.move_joints(self._moves.pop(0)[1], ARM_SPEED_RAD_S)
        self._times.append(time_s)
        self._angles.append(arm.read_joint_angles())

    def log(self) -> JointLog:
        """Return the measured joint angles of the arm with their times."""
        return JointLog(np.array(self._times), np.stack(self._angles))


def _make_record(
    setup: Setup,
    planned: PlannedGrasp,
    timeline: Timeline,
    cycles: PollCycles,
    start_s: float,
    arm: JointLog,
    joints: JointLog,
) -> GraspRecord:
    """Make the dataset record of a grasp from the frames of the skin and the measured joint angles.

    cycles: frames of the skin during the grasp. start_s: start of the grasp on the clock of the frames. arm, joints:
    measured joint angles of arm and hand. Raises TaxelError if there are no frames.
    """
    elapsed = cycles.time_s - start_s
    phase = timeline.find_phases(elapsed)
    angles = np.hstack([arm.interpolate(elapsed), joints.interpolate(elapsed)])
    hold = angles[phase == Phase.HOLD]
    if not len(elapsed):
        raise TaxelError(
            f"grasp {planned.id}: expected frames of the skin, found none; check that the hub is streaming"
        )
    return GraspRecord(
        object=planned.object,
        approach=planned.approach,
        iteration=planned.iteration,
        session=planned.session,
        timestamp=cycles.time_s,
        phase=phase,
        raw_counts=cycles.raw_counts,
        valid=cycles.valid,
        sensor_pose=setup.kinematics.compute_sensor_poses(hold.mean(axis=0) if len(hold) else angles[-1]),
        object_pose=setup.object_pose(planned.object),
        sensor_time=cycles.sensor_time,
        joint_position=angles,
    )


def _confirm_placement(station: Workstation, settings: PhysicalSettings, planned: PlannedGrasp) -> None:
    """Wait until the operator has placed the object of a grasp; return at once if `confirm_placement` is not set.

    The periodic reports of the hand are off during the wait, because nothing reads them.
    """
    if settings.confirm_placement is None:
        return
    station.hand.set_period(0)
    settings.confirm_placement(planned)
    station.hand.set_period(POSITION_PERIOD_MS)


class _FrameCollector:
    """Reads the skin in a separate thread, so that the control loop never waits for frames."""

    def __init__(self, skin: Skin) -> None:
        """Create the collector of a skin; its thread runs from the beginning to the end of the `with` block."""
        self._skin = skin
        self._frames: list[TaxelFrame] = []
        self._lock = threading.Lock()
        self._stop = threading.Event()
        self._error: Exception | None = None
        self._thread = threading.Thread(target=self._read, daemon=True)

    def _read(self) -> None:
        """Collect frames of the skin until the collector is stopped; runs in the thread of the collector."""
        try:
            for frame in self._skin:
                with self._lock:
                    self._frames.append(frame)
                if self._stop.is_set():
                    return
        except Exception as error:  # raised again by the thread that calls `discard` or `frames`
            self._error = error

    def discard(self) -> None:
        """Discard the frames collected so far. Raises the error that ended the collecting thread."""
        self._check()
        with self._lock:
            self._frames = []

    def frames(self) -> list[TaxelFrame]:
        """Return the frames collected since the last `discard`. Raises the error that ended the collecting thread."""
        self._check()
        with self._lock:
            return list(self._frames)

    def _check(self) -> None:
        """Raise the error that ended the collecting thread, if any."""
        if self._error is not None:
            raise self._error

    def __enter__(self) -> _FrameCollector:
        """Start the thread that collects the frames of the skin."""
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        """Stop the thread that collects the frames of the skin."""
        self._stop.set()
        self._thread.join(timeout=JOIN_TIMEOUT_S)
