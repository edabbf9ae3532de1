"""A campaign on a physical workstation: arm, hand and skin through their interfaces, in real time, to real.h5."""

from __future__ import annotations

import contextlib
import os
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from taxel.campaign.grasping import PERIOD_S, JointLog, perform
from taxel.campaign.progress import Progress, silent
from taxel.campaign.rows import Rows, rows_of
from taxel.campaign.setup import Setup
from taxel.campaign.store import begin_or_extend
from taxel.errors import TaxelError
from taxel.grasp.controller import GraspController
from taxel.grasp.plan import PlannedGrasp
from taxel.grasp.timeline import Phase, Timeline
from taxel.hand.allegro.driver import POSITION_PERIOD_MS, AllegroHand
from taxel.hand.arm.base import Arm
from taxel.hand.control_loop import ControlLoop
from taxel.recording.grasp_record import GraspRecord
from taxel.skin import Skin
from taxel.stream import TaxelFrame

RATE_HZ = 18.8
"""What 17 boards give at 400 kHz; the frames themselves say when they were made."""

ARM_SPEED_RAD_S = 0.5
WITHDRAW_SHARE = 0.5
"""Of the release, after which the arm withdraws: the fingers have opened."""

ARM_TIMEOUT_S = 60.0
LATE_FRAMES_S = 0.3
"""How long frames of a grasp may still be on their way when it is over."""


JOIN_TIMEOUT_S = 2.0
"""The thread that reads frames may wait for a frame that never comes."""


class ArmStuckError(TaxelError):
    """The arm did not arrive."""


@dataclass(frozen=True, eq=False)
class Workstation:
    """What a physical campaign drives. step_arm: what moves a simulated arm on by so many seconds; None: it moves by
    itself.
    """

    arm: Arm
    hand: AllegroHand
    skin: Skin
    step_arm: Callable[[float], object] | None = None


def run_physical(
    path: str | os.PathLike[str],
    plan: Sequence[PlannedGrasp],
    station: Workstation,
    timeline: Timeline | None = None,
    setup: Setup | None = None,
    ask: Callable[[PlannedGrasp], object] | None = None,
    overwrite: bool = False,
    resume: bool = False,
    progress: Progress = silent,
) -> None:
    """Make the grasps of `plan` and write each one to `path` when it is over.

    ask: called before a grasp of another object or session than the one before: somebody puts it there. Raises the
    errors of arm, hand and skin (one line); the grasps that were finished are in the file, the hand is without torque
    and the arm stands.
    """
    setup, timeline = setup or Setup(), timeline or Timeline()
    with begin_or_extend(path, "real", setup, RATE_HZ, "physical hand", overwrite, resume) as out:
        missing = [planned for planned in plan if planned.id not in out.ids]
        done = len(plan) - len(missing)
        progress(done, len(plan))
        with _FrameTap(station.skin) as tap:
            before: PlannedGrasp | None = None
            for planned in missing:
                if ask is not None and (before is None or _place(before) != _place(planned)):
                    _ask(station, ask, planned)
                out.add(_make(setup, planned, station, timeline, tap), planned.id)
                before, done = planned, done + 1
                progress(done, len(plan))


def _place(planned: PlannedGrasp) -> tuple[str, int]:
    return planned.object, planned.session


def _make(setup: Setup, planned: PlannedGrasp, station: Workstation, timeline: Timeline, tap: _FrameTap) -> GraspRecord:
    at, away = setup.arm_path(planned)
    guide = _ArmGuide(station, timeline, at, away)
    try:
        _move_arm(station, away)
        tap.forget()
        controller = GraspController(setup.approach(planned), timeline)
        joints = perform(station.hand, controller, 0.0, timeline.duration_s, guide.wait, guide.watch)
        time.sleep(LATE_FRAMES_S)
        frames = tap.frames()
    except BaseException:
        with contextlib.suppress(TaxelError):  # the error on its way out says more
            station.arm.stop()
        raise
    rows = rows_of(setup.hand, frames).between(guide.began_s, guide.began_s + timeline.duration_s)
    return _record(setup, planned, timeline, rows, guide.began_s, guide.log(), joints)


class _ArmGuide:
    """Sends the arm to the object and back while the hand is controlled, and remembers where it was.

    began_s: when the grasp's time was 0, on the clock of the skin's frames.
    """

    def __init__(
        self, station: Workstation, timeline: Timeline, at: NDArray[np.float64], away: NDArray[np.float64]
    ) -> None:
        self._station, self._timeline = station, timeline
        self._ways = [(timeline.begin(Phase.CLOSING), at)]
        self._ways += [(timeline.begin(Phase.RELEASE) + WITHDRAW_SHARE * timeline.release_s, away)]
        self._loop = ControlLoop(PERIOD_S, time.monotonic)
        self._period = 0
        self._times: list[float] = []
        self._angles: list[NDArray[np.float64]] = []
        self.began_s = 0.0

    def wait(self) -> int:
        """Wait for the next control period; returns its number."""
        before, self._period = self._period, self._loop.wait()
        if self._station.step_arm is not None:
            self._station.step_arm((self._period - before) * PERIOD_S)
        return self._period

    def watch(self, time_s: float) -> None:
        """Start the arm's next way when it is time and the arm stands."""
        if not self._times:
            self.began_s = time.monotonic() - time_s
        arm = self._station.arm
        if self._ways and time_s >= self._ways[0][0] and not arm.is_moving:
            arm.move_joints(self._ways.pop(0)[1], ARM_SPEED_RAD_S)
        self._times.append(time_s)
        self._angles.append(arm.joint_angles())

    def log(self) -> JointLog:
        """What the arm's encoders said."""
        return JointLog(np.array(self._times), np.stack(self._angles))


def _record(
    setup: Setup,
    planned: PlannedGrasp,
    timeline: Timeline,
    rows: Rows,
    began: float,
    arm: JointLog,
    joints: JointLog,
) -> GraspRecord:
    since = rows.time_s - began
    phase = timeline.phase_at(since)
    angles = np.hstack([arm.at(since), joints.at(since)])
    hold = angles[phase == Phase.HOLD]
    if not len(since):
        raise TaxelError(f"grasp {planned.id}: no frame of the skin arrived; is the hub streaming?")
    return GraspRecord(
        object=planned.object,
        approach=planned.approach,
        iteration=planned.iteration,
        session=planned.session,
        timestamp=rows.time_s,
        phase=phase,
        raw_counts=rows.raw_counts,
        valid=rows.valid,
        sensor_pose=setup.kinematics.sensor_poses(hold.mean(axis=0) if len(hold) else angles[-1]),
        object_pose=setup.object_pose(planned.object),
        sensor_time=rows.sensor_time,
        joint_position=angles,
    )


def _move_arm(station: Workstation, target: NDArray[np.float64]) -> None:
    """Take the arm there, from wherever it still goes, and wait until it stands."""
    _wait_for_arm(station)
    station.arm.move_joints(target, ARM_SPEED_RAD_S)
    _wait_for_arm(station)


def _wait_for_arm(station: Workstation) -> None:
    end = time.monotonic() + ARM_TIMEOUT_S
    while station.arm.is_moving:
        station.hand.update()  # its reports are taken and its faults are seen meanwhile
        if station.step_arm is not None:
            station.step_arm(PERIOD_S)
        else:
            time.sleep(PERIOD_S)
        if time.monotonic() > end:
            raise ArmStuckError(f"arm: did not arrive within {ARM_TIMEOUT_S:g} s; clear its way and start again")


def _ask(station: Workstation, ask: Callable[[PlannedGrasp], object], planned: PlannedGrasp) -> None:
    """Ask somebody; nobody reads the hand's reports meanwhile, so it sends none."""
    station.hand.set_period(0)
    ask(planned)
    station.hand.set_period(POSITION_PERIOD_MS)


class _FrameTap:
    """Reads the skin in a thread of its own, so that the control loop never waits for it."""

    def __init__(self, skin: Skin) -> None:
        self._skin = skin
        self._frames: list[TaxelFrame] = []
        self._lock = threading.Lock()
        self._stop = threading.Event()
        self._error: Exception | None = None
        self._thread = threading.Thread(target=self._read, daemon=True)

    def _read(self) -> None:
        try:
            for frame in self._skin:
                with self._lock:
                    self._frames.append(frame)
                if self._stop.is_set():
                    return
        except Exception as error:  # kept for the thread that asks
            self._error = error

    def forget(self) -> None:
        """Drop what has arrived so far; raises what ended the reading."""
        self._check()
        with self._lock:
            self._frames = []

    def frames(self) -> list[TaxelFrame]:
        """What has arrived since; raises what ended the reading."""
        self._check()
        with self._lock:
            return list(self._frames)

    def _check(self) -> None:
        if self._error is not None:
            raise self._error

    def __enter__(self) -> _FrameTap:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stop.set()
        self._thread.join(timeout=JOIN_TIMEOUT_S)
