"""The phases of one grasp and when each begins."""

from __future__ import annotations

from dataclasses import dataclass, fields
from enum import IntEnum
from functools import cached_property

import numpy as np
import numpy.typing as npt

PHASE_TOLERANCE_S = 1e-9  # a sample computed as k / rate belongs to the phase that begins there

# Chosen: shares of the closing phase in which the palm comes to the object, the torque rises, and all settles; and of
# the release phase in which the torque falls, the fingers open, and the palm withdraws.
ADVANCE_END = 0.2
GRIP_END = 0.6
RELEASE_END = 0.3
WITHDRAW_BEGIN = 0.7


class Phase(IntEnum):
    """What the hand does; the number is the one that recordings carry."""

    BASELINE = 0
    CLOSING = 1
    HOLD = 2
    RELEASE = 3
    RECOVERY = 4


@dataclass(frozen=True)
class Timeline:
    """How long each phase lasts, seconds.

    baseline_s: open, so that the taxels' rest level can be told. closing_s: the fingers close and press.
    hold_s: they press at a constant torque. release_s: they open again. recovery_s: open, while the layer recovers.
    Raises ValueError for a duration below 0 or not finite, or for no time at all.
    """

    baseline_s: float = 6.0
    closing_s: float = 2.0
    hold_s: float = 1.5
    release_s: float = 1.0
    recovery_s: float = 1.5

    def __post_init__(self) -> None:
        for item in fields(self):
            value = getattr(self, item.name)
            if not 0 <= value < np.inf:
                raise ValueError(f"{item.name}: expected seconds, at least 0, found {value}")
        if self.duration_s == 0:
            raise ValueError("timeline: expected a phase that lasts, found all at 0 s")

    @property
    def durations_s(self) -> tuple[float, ...]:
        """Seconds of each phase, in order."""
        return (self.baseline_s, self.closing_s, self.hold_s, self.release_s, self.recovery_s)

    @property
    def duration_s(self) -> float:
        """Seconds of all phases together."""
        return sum(self.durations_s)

    def begin(self, phase: int) -> float:
        """When a phase begins, seconds after the start of the grasp."""
        return self._begins[phase]

    @cached_property
    def _begins(self) -> tuple[float, ...]:
        return tuple(sum(self.durations_s[:phase]) for phase in Phase)  # a controller asks in every step

    def end(self, phase: int) -> float:
        """When a phase ends, seconds."""
        return self.begin(phase) + self.durations_s[Phase(phase)]

    def phase_at(self, t: npt.ArrayLike) -> npt.NDArray[np.uint8]:
        """The phase at times f64[...], u8[...]: it begins at its first moment; outside the grasp, the nearest."""
        begins = [self.begin(phase) for phase in list(Phase)[1:]]
        found = np.searchsorted(begins, np.asarray(t, dtype=np.float64) + PHASE_TOLERANCE_S, side="right")
        return np.asarray(found, dtype=np.uint8)

    def share_at(self, phase: int, t: float) -> float:
        """How much of a phase is over at time t, 0..1; 1 for a phase that lasts no time once it has begun."""
        passed, lasts = t - self.begin(phase), self.durations_s[phase]
        if passed < 0:
            return 0.0
        return min(passed / lasts, 1.0) if lasts > 0 else 1.0

    def grip_at(self, t: float) -> float:
        """Share of the planned torque at time t, 0..1."""
        if t >= self.begin(Phase.RELEASE):
            return 1.0 - min(self.share_at(Phase.RELEASE, t) / RELEASE_END, 1.0)
        return min(max(self.share_at(Phase.CLOSING, t) - ADVANCE_END, 0.0) / (GRIP_END - ADVANCE_END), 1.0)

    def withdrawn_at(self, t: float) -> float:
        """How far the palm is withdrawn from the object at time t: 1 in the baseline and in recovery, 0 on it."""
        if t >= self.begin(Phase.RELEASE):
            return max(self.share_at(Phase.RELEASE, t) - WITHDRAW_BEGIN, 0.0) / (1.0 - WITHDRAW_BEGIN)
        return 1.0 - min(self.share_at(Phase.CLOSING, t) / ADVANCE_END, 1.0)

    def sample_times(self, rate_hz: float) -> npt.NDArray[np.float64]:
        """Times 0, 1/rate, 2/rate ... before the end, seconds, f64[T]. Raises ValueError for a rate not above 0."""
        if not 0 < rate_hz < np.inf:
            raise ValueError(f"rate_hz: expected above 0, found {rate_hz}")
        count = int(np.ceil(self.duration_s * rate_hz - PHASE_TOLERANCE_S))
        return np.arange(count) / rate_hz
