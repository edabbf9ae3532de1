"""How far the rig has brought the mount along its line, over the phases of a press.

Travel is metres along the approach's direction, 0 where the object would first touch; the object itself stays behind
by as much as the mount's spring is compressed.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from taxel.grasp.timeline import ADVANCE_END, GRIP_END, RELEASE_END, WITHDRAW_BEGIN, Phase, Timeline
from taxel.types import FloatArray

AWAY_M = 0.025
"""How far the object is withdrawn in the baseline and in recovery, beyond `CLEARANCE_M` (chosen)."""

CLEARANCE_M = 0.0015
"""Where the slow part of the travel begins, before the touch: well beyond the scatter of the object (chosen)."""

LEAST_CLEARANCE_M = 0.0005
"""The same where something is so far from where it is believed to be that the touch comes early."""


class Stroke(NamedTuple):
    """Travel over the phases: quickly from afar to `start_m`, slowly on to `end_m`, where it is held."""

    timeline: Timeline
    start_m: float
    end_m: float

    @classmethod
    def through(cls, timeline: Timeline, touch_m: float, end_m: float) -> Stroke:
        """For a press that truly touches at `touch_m` and is held at `end_m`."""
        return cls(timeline, min(-CLEARANCE_M, touch_m - LEAST_CLEARANCE_M), end_m)

    def travel_at(self, times_s: FloatArray) -> FloatArray:
        """Travel at `times_s` f64[k] since the press began, f64[k]."""
        withdrawn = np.array([self.timeline.withdrawn_at(time) for time in times_s.tolist()])
        grip = np.array([self.timeline.grip_at(time) for time in times_s.tolist()])
        return np.asarray(self.start_m - AWAY_M * withdrawn + (self.end_m - self.start_m) * grip)

    def times_of(self, travel_m: FloatArray) -> tuple[FloatArray, FloatArray]:
        """When the mount passes `travel_m` f64[k], at most `end_m`: on its way in, and on its way back, each f64[k]."""
        withdrawn = np.clip((self.start_m - travel_m) / AWAY_M, 0.0, 1.0)
        grip = np.clip((travel_m - self.start_m) / (self.end_m - self.start_m), 0.0, 1.0)
        slow_in, slow_out = ADVANCE_END + (GRIP_END - ADVANCE_END) * grip, RELEASE_END * (1.0 - grip)
        share_in = np.where(withdrawn > 0, ADVANCE_END * (1.0 - withdrawn), slow_in)
        share_out = np.where(withdrawn > 0, WITHDRAW_BEGIN + (1.0 - WITHDRAW_BEGIN) * withdrawn, slow_out)
        begins, lasts = self.timeline.begin, self.timeline.durations_s
        going = begins(Phase.CLOSING) + lasts[Phase.CLOSING] * share_in
        coming = begins(Phase.RELEASE) + lasts[Phase.RELEASE] * share_out
        return np.asarray(going), np.asarray(coming)
