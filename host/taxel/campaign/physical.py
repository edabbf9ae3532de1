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
from taxel.hand.allegro.driver import AllegroHand
from taxel.hand.arm.base import Arm
from taxel.hand.control_loop import ControlLoop
from taxel.recording.grasp_record import GraspRecord
from taxel.skin import Skin
from taxel.stream import TaxelFrame

RATE_HZ = 18.8
"""What 17 boards give at 400 kHz; the frames themselves say when they were made."""

ARM_SPEED_RAD_S = 0.5
ARM_TIMEOUT_S = 60.0
LATE_FRAMES_S = 0.3
"""How long frames of a grasp may still be on their way when it is over."""


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
                    ask(planned)
                out.add(_make(setup, planned, station, timeline, tap), planned.id)
                before, done = planned, done + 1
                progress(done, len(plan))


def _place(planned: PlannedGrasp) -> tuple[str, int]:
    return planned.object, planned.session


def _make(setup: Setup, planned: PlannedGrasp, station: Workstation, timeline: Timeline, tap: _FrameTap) -> GraspRecord:
    at, away = setup.arm_path(planned)
    approach = setup.approach(planned)
    loop = ControlLoop(PERIOD_S, time.monotonic)
    try:
        _move_arm(station, away)
        tap.forget()
        arm_log: list[tuple[float, NDArray[np.float64]]] = []
        steps = {"there": False, "back": False}
        began = time.monotonic() + PERIOD_S

        def watch(time_s: float) -> None:
            if not steps["there"] and time_s >= timeline.begin(Phase.CLOSING):
                steps["there"] = True
                station.arm.move_joints(at, ARM_SPEED_RAD_S)
            if not steps["back"] and timeline.share_at(Phase.RELEASE, time_s) >= 0.5 and not station.arm.is_moving:
                steps["back"] = True
                station.arm.move_joints(away, ARM_SPEED_RAD_S)
            arm_log.append((time_s, station.arm.joint_angles()))

        def wait() -> None:
            loop.wait()
            if station.step_arm is not None:
                station.step_arm(PERIOD_S)

        controller = GraspController(approach, timeline)
        joints = perform(station.hand, controller, 0.0, timeline.duration_s, wait, watch)
    except BaseException:
        station.arm.stop()
        raise
    time.sleep(LATE_FRAMES_S)
    rows = rows_of(setup.hand, tap.frames()).between(began, began + timeline.duration_s)
    arm = JointLog(np.array([moment for moment, _ in arm_log]), np.stack([angles for _, angles in arm_log]))
    return _record(setup, planned, timeline, rows, began, arm, joints)


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
    """Take the arm there and wait until it stands."""
    station.arm.move_joints(target, ARM_SPEED_RAD_S)
    end = time.monotonic() + ARM_TIMEOUT_S
    while station.arm.is_moving:
        if station.step_arm is not None:
            station.step_arm(PERIOD_S)
        else:
            time.sleep(PERIOD_S)
        if time.monotonic() > end:
            station.arm.stop()
            raise ArmStuckError(f"arm: did not arrive within {ARM_TIMEOUT_S:g} s; clear its way and start again")


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
        """Drop what has arrived so far."""
        with self._lock:
            self._frames = []

    def frames(self) -> list[TaxelFrame]:
        """What has arrived since; raises what ended the reading."""
        if self._error is not None:
            raise self._error
        with self._lock:
            return list(self._frames)

    def __enter__(self) -> _FrameTap:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stop.set()
        with contextlib.suppress(RuntimeError):
            self._thread.join(timeout=2.0)
