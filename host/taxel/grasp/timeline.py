"""Phases of a grasp and their times."""

from dataclasses import dataclass, fields
from enum import IntEnum
from functools import cached_property

import numpy as np
import numpy.typing as npt

PHASE_TOLERANCE_S = 1e-9
"""Tolerance of phase boundaries: a sample at k / rate belongs to the phase that starts at this time."""

# Assumed fractions of the closing phase: ADVANCE_END, end of the palm motion, when the fingers start to close;
# GRIP_START_END, end of the transition from the open angles to the closing motion; CLOSING_END, end of the motion
# without an object; TIGHTENING_END, time from which the full torque is permitted. Assumed fractions of the release
# phase: RELEASE_END, end of the torque decrease; WITHDRAW_START, start of the palm withdrawal.
ADVANCE_END = 0.2
GRIP_START_END = 0.3
CLOSING_END = 0.5
TIGHTENING_END = 0.6
CONTACT_TORQUE = 0.4
"""Permitted part of the planned torque until the fingers have closed: they are laid on the object before they grip, as
by hand in the original procedure (docs/assumptions.md). A larger part makes the fingers strike and slip.
"""
RELEASE_END = 0.3
WITHDRAW_START = 0.7

# Assumed fractions of the closing phase between which the experimenter lets go of the object, and assumed fraction of
# the release phase in which the experimenter takes hold of the object again.
LET_GO_START = 0.6
LET_GO_END = 0.7
TAKE_HOLD_END = 0.2


class Phase(IntEnum):
    """Phase of a grasp; recordings contain its number."""

    BASELINE = 0
    CLOSING = 1
    HOLD = 2
    RELEASE = 3
    RECOVERY = 4


@dataclass(frozen=True)
class Timeline:
    """Durations of the phases, seconds.

    baseline_s: open hand, baseline of the taxels. closing_s: the fingers close. hold_s: constant torque. release_s: the
    fingers open. recovery_s: open hand, recovery of the dielectric. Raises ValueError for a duration below 0 or not
    finite, or if all durations are 0.
    """

    baseline_s: float = 6.0
    closing_s: float = 3.0
    hold_s: float = 1.5
    release_s: float = 1.0
    recovery_s: float = 1.5

    def __post_init__(self) -> None:
        """Check that all durations are finite and not negative, and not all 0. Raises ValueError."""
        for item in fields(self):
            value = getattr(self, item.name)
            if not 0 <= value < np.inf:
                raise ValueError(f"{item.name}: expected a finite number of seconds of at least 0, found {value}")
        if self.duration_s == 0:
            raise ValueError("timeline: expected a duration above 0, found 0 s for all phases")

    @property
    def durations_s(self) -> tuple[float, ...]:
        """Duration of each phase of the grasp, seconds, in order."""
        return (self.baseline_s, self.closing_s, self.hold_s, self.release_s, self.recovery_s)

    @property
    def duration_s(self) -> float:
        """Total duration of the grasp, seconds."""
        return sum(self.durations_s)

    def get_start_s(self, phase: int) -> float:
        """Return the start of a phase, seconds after the start of the grasp. phase: number."""
        return self._start_times_s[phase]

    @cached_property
    def _start_times_s(self) -> tuple[float, ...]:
        """Start of each phase, seconds after the start of the grasp."""
        return tuple(sum(self.durations_s[:phase]) for phase in Phase)  # cached, since controllers use it in every step

    def get_end_s(self, phase: int) -> float:
        """Return the end of a phase, seconds after the start of the grasp."""
        return self.get_start_s(phase) + self.durations_s[Phase(phase)]

    def find_phases(self, t: npt.ArrayLike) -> npt.NDArray[np.uint8]:
        """Return the phases of a grasp at times f64[...], u8[...]; outside the grasp, the nearest phase.

        t: seconds after the start of the grasp.
        """
        starts = [self.get_start_s(phase) for phase in list(Phase)[1:]]
        phases = np.searchsorted(starts, np.asarray(t, dtype=np.float64) + PHASE_TOLERANCE_S, side="right")
        return np.asarray(phases, dtype=np.uint8)

    def get_phase_progress(self, phase: int, t: float) -> float:
        """Return the elapsed fraction of a phase at time t, 0..1; 1 after the start of a phase of duration 0.

        t: seconds after the start of the grasp.
        """
        elapsed_s, duration_s = t - self.get_start_s(phase), self.durations_s[phase]
        if elapsed_s < 0:
            return 0.0
        return min(elapsed_s / duration_s, 1.0) if duration_s > 0 else 1.0

    def get_grip_fraction(self, t: float) -> float:
        """Return the share of the closing motion and torque at time t: 0 for the open hand, 1 in the hold.

        In the closing phase, the palm first advances to the object (until `ADVANCE_END` of the phase); then the share
        rises linearly until `GRIP_START_END`. In the release phase the share falls linearly until `RELEASE_END`.
        t: seconds after the start of the grasp.
        """
        if t >= self.get_start_s(Phase.RELEASE):
            return 1.0 - min(self.get_phase_progress(Phase.RELEASE, t) / RELEASE_END, 1.0)
        progress = self.get_phase_progress(Phase.CLOSING, t)
        return min(max(progress - ADVANCE_END, 0.0) / (GRIP_START_END - ADVANCE_END), 1.0)

    def get_tightening(self, t: float) -> float:
        """Return the permitted part of the planned finger torque at time t, `CONTACT_TORQUE` to 1.

        The part is smaller until the fingers have closed (`CLOSING_END` of the closing phase), so that they touch the
        object gently, and then rises linearly until `TIGHTENING_END`.
        t: seconds after the start of the grasp.
        """
        progress = self.get_phase_progress(Phase.CLOSING, t)
        tightening = min(max(progress - CLOSING_END, 0.0) / (TIGHTENING_END - CLOSING_END), 1.0)
        return CONTACT_TORQUE + (1.0 - CONTACT_TORQUE) * tightening

    def get_closing_fraction(self, t: float) -> float:
        """Return how far fingers without an obstacle have closed at time t: 0 (open) to 1 (closed).

        They start when the palm is at the object (`ADVANCE_END` of the closing phase) and end at `CLOSING_END`.
        t: seconds after the start of the grasp.
        """
        progress = self.get_phase_progress(Phase.CLOSING, t)
        return min(max(progress - ADVANCE_END, 0.0) / (CLOSING_END - ADVANCE_END), 1.0)

    def get_withdrawal(self, t: float) -> float:
        """Return how far the palm is withdrawn at time t: 1 in baseline and recovery, 0 at the object.

        The palm advances until `ADVANCE_END` of the closing phase and withdraws from `WITHDRAW_START` of the release
        phase on.
        t: seconds after the start of the grasp.
        """
        if t >= self.get_start_s(Phase.RELEASE):
            return max(self.get_phase_progress(Phase.RELEASE, t) - WITHDRAW_START, 0.0) / (1.0 - WITHDRAW_START)
        return 1.0 - min(self.get_phase_progress(Phase.CLOSING, t) / ADVANCE_END, 1.0)

    def get_steadying(self, t: float) -> float:
        """Return how firmly the experimenter steadies the object at time t: 1 while the hand closes, 0 in the hold.

        The original procedure closes and opens the hand on the object by hand. t: seconds after the start of the grasp.
        """
        if t >= self.get_start_s(Phase.RELEASE):
            return min(self.get_phase_progress(Phase.RELEASE, t) / TAKE_HOLD_END, 1.0)
        progress = self.get_phase_progress(Phase.CLOSING, t)
        return 1.0 - min(max(progress - LET_GO_START, 0.0) / (LET_GO_END - LET_GO_START), 1.0)

    def make_sample_times(self, rate_hz: float) -> npt.NDArray[np.float64]:
        """Return the sample times 0, 1/rate, 2/rate ... before the end of the grasp, seconds, f64[T].

        Raises ValueError for a rate that is not above 0.
        """
        if not 0 < rate_hz < np.inf:
            raise ValueError(f"rate_hz: expected a finite number above 0, found {rate_hz}")
        count = int(np.ceil(self.duration_s * rate_hz - PHASE_TOLERANCE_S))
        return np.arange(count) / rate_hz
