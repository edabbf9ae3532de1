"""How far the rig has brought the mount along its line, over the phases of a press.

Travel is metres along the approach's direction, 0 where the object would first touch; the object itself stays behind
by as much as the mount's spring is compressed.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from taxel.grasp.timeline import ADVANCE_END, GRIP_END, RELEASE_END, WITHDRAW_BEGIN, Phase, Timeline

Array = NDArray[np.float64]

AWAY_M = 0.025
"""How far the object is withdrawn in the baseline and in recovery, beyond `CLEARANCE_M` (chosen)."""

CLEARANCE_M = 0.0015
"""Where the slow part of the travel begins, before the touch: well beyond the scatter of the object (chosen)."""


def travel_at(timeline: Timeline, end_m: float, times_s: Array) -> Array:
    """Travel at `times_s` f64[k] since the press began, f64[k]. end_m: in the hold."""
    withdrawn = np.array([timeline.withdrawn_at(time) for time in times_s.tolist()])
    grip = np.array([timeline.grip_at(time) for time in times_s.tolist()])
    return np.asarray(-CLEARANCE_M - AWAY_M * withdrawn + (CLEARANCE_M + end_m) * grip)


def times_of(timeline: Timeline, end_m: float, travel_m: Array) -> tuple[Array, Array]:
    """When the mount passes `travel_m` f64[k], of at most `end_m`: on its way in and on its way back, each f64[k]."""
    withdrawn = np.clip(-(travel_m + CLEARANCE_M) / AWAY_M, 0.0, 1.0)
    grip = np.clip((travel_m + CLEARANCE_M) / (CLEARANCE_M + end_m), 0.0, 1.0)
    share_in = np.where(withdrawn > 0, ADVANCE_END * (1.0 - withdrawn), ADVANCE_END + (GRIP_END - ADVANCE_END) * grip)
    share_out = np.where(
        withdrawn > 0, WITHDRAW_BEGIN + (1.0 - WITHDRAW_BEGIN) * withdrawn, RELEASE_END * (1.0 - grip)
    )
    going = timeline.begin(Phase.CLOSING) + timeline.durations_s[Phase.CLOSING] * share_in
    coming = timeline.begin(Phase.RELEASE) + timeline.durations_s[Phase.RELEASE] * share_out
    return np.asarray(going), np.asarray(coming)
