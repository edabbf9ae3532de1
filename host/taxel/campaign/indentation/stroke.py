"""Travel of the mount along its line over the phases of an indentation.

Travel is measured in metres along the approach's direction; travel 0 is the nominal first contact. The object lags
behind the mount by the compression of the mount's spring.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from taxel.grasp.timeline import ADVANCE_END, RELEASE_END, WITHDRAW_START, Phase, Timeline
from taxel.types import FloatArray

PRESS_END = 0.6
"""Fraction of the closing phase at which the mount reaches the end of its travel (chosen)."""

AWAY_M = 0.025
"""Distance of the object in the baseline and in recovery, in addition to `CLEARANCE_M` (chosen)."""

CLEARANCE_M = 0.0015
"""Distance before the first contact at which the slow part of the travel begins; well above the variation of the
object's position (chosen)."""

MIN_CLEARANCE_M = 0.0005
"""Smallest such distance before the true first contact, which an offset of the object can make earlier than planned."""


class Stroke(NamedTuple):
    """Travel of the mount over the phases of an indentation.

    The mount moves fast from far away to `start_m`, then slowly to `end_m`, where it is held; it returns the same way.
    Both values are travels in metres.
    """

    timeline: Timeline
    start_m: float
    end_m: float

    @classmethod
    def through(cls, timeline: Timeline, touch_m: float, end_m: float) -> Stroke:
        """Make the stroke of a mount whose object has its true first contact at `touch_m` and its hold at `end_m`.

        The two values are travels of the mount in metres.
        """
        return cls(timeline, min(-CLEARANCE_M, touch_m - MIN_CLEARANCE_M), end_m)

    def travel_at(self, times_s: FloatArray) -> FloatArray:
        """Compute the travel of the mount f64[k], metres, at `times_s` f64[k] since the start of the indentation."""
        withdrawn = np.array([self.timeline.get_withdrawal(time) for time in times_s.tolist()])
        grip = np.array([self._get_slow_share(time) for time in times_s.tolist()])
        return np.asarray(self.start_m - AWAY_M * withdrawn + (self.end_m - self.start_m) * grip)

    def _get_slow_share(self, time_s: float) -> float:
        """Return the covered share of the slow travel, from `start_m` (0) to `end_m` (1).

        time_s: seconds since the start of the indentation.
        """
        if time_s >= self.timeline.get_start_s(Phase.RELEASE):
            return self.timeline.get_grip_fraction(time_s)
        progress = self.timeline.get_phase_progress(Phase.CLOSING, time_s)
        return min(max(progress - ADVANCE_END, 0.0) / (PRESS_END - ADVANCE_END), 1.0)

    def times_of(self, travel_m: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Compute the times at which the mount passes the travels `travel_m` f64[k], metres.

        Returns the times on the way inwards f64[k] and on the way back f64[k], in seconds since the indentation's
        start. No travel exceeds `end_m`.
        """
        withdrawn = np.clip((self.start_m - travel_m) / AWAY_M, 0.0, 1.0)
        grip = np.clip((travel_m - self.start_m) / (self.end_m - self.start_m), 0.0, 1.0)
        slow_in, slow_out = ADVANCE_END + (PRESS_END - ADVANCE_END) * grip, RELEASE_END * (1.0 - grip)
        share_in = np.where(withdrawn > 0, ADVANCE_END * (1.0 - withdrawn), slow_in)
        share_out = np.where(withdrawn > 0, WITHDRAW_START + (1.0 - WITHDRAW_START) * withdrawn, slow_out)
        start_of, duration_s = self.timeline.get_start_s, self.timeline.durations_s
        inwards = start_of(Phase.CLOSING) + duration_s[Phase.CLOSING] * share_in
        outwards = start_of(Phase.RELEASE) + duration_s[Phase.RELEASE] * share_out
        return np.asarray(inwards), np.asarray(outwards)
