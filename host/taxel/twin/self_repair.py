"""Corrections that follow from the active alarms of a twin."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

import numpy as np

from taxel.twin.events import Alarm
from taxel.twin.reference import Reference
from taxel.twin.repair import Repair

WEAKEST: Final = 0.3
"""Smallest response to contact, relative to the reference, that is corrected by division. The correction of a weaker
response would amplify the noise more than threefold; such a taxel is interpolated instead."""

STUCK_LN: Final = -3.0
"""Natural logarithm of the noise variance relative to the reference below which a taxel is treated as stuck: less than
5 % of the variance remain."""


@dataclass(frozen=True, eq=False)
class SelfRepair:
    """Corrections of a skin, and their description: one sentence for each alarm that led to a correction."""

    repair: Repair
    corrections: tuple[str, ...]


def plan_repair(reference: Reference, alarms: Iterable[Alarm]) -> SelfRepair:
    """Derive the corrections from active alarms.

    A changed response is corrected by division by its gain, or by interpolation if almost no response is left
    (`WEAKEST`). A taxel without noise is stuck (`STUCK_LN`) and is interpolated. A delay is corrected in the time
    stamps. Other changes are not corrected.
    """
    n = reference.taxels.n
    masked, gain, delay_s = np.zeros(n, bool), np.ones(n), np.zeros(n)
    found = []
    for alarm in alarms:
        taxels = reference.places.find_members(alarm.place)
        if alarm.quantity == "gain" and 1.0 + alarm.amplitude < WEAKEST:
            masked |= taxels
            found.append(f"alarm {alarm.number}: {alarm.place} is interpolated")
        elif alarm.quantity == "gain":
            gain = np.where(taxels, gain * (1.0 + alarm.amplitude), gain)
            found.append(f"alarm {alarm.number}: signals of {alarm.place} are divided by {1.0 + alarm.amplitude:.3f}")
        elif alarm.quantity == "noise" and alarm.amplitude < STUCK_LN:
            masked |= taxels
            found.append(f"alarm {alarm.number}: {alarm.place} is stuck and interpolated")
        elif alarm.quantity == "delay":
            delay_s = np.where(taxels, delay_s + alarm.amplitude, delay_s)
            found.append(f"alarm {alarm.number}: times of {alarm.place} are {1e3 * alarm.amplitude:+.0f} ms late")
    repair = Repair.make(masked, gain, delay_s, reference.taxels.position, reference.places.board)
    return SelfRepair(repair, tuple(found))
