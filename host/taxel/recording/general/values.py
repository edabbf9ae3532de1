"""Mean values of contacts without contact and in the hold phase, and the direction in which contact changes them."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from taxel.recording.general.format import Contact, Direction
from taxel.recording.general.phases import detect_phases
from taxel.recording.grasp_format import Phase
from taxel.types import FloatArray

CLEAR_SHARE: Final = 0.5
"""Smallest difference between the squared increases and the squared decreases, relative to their sum, at which contact
is taken to change the values in one direction only.
"""


@dataclass(frozen=True, eq=False)
class HoldMeans:
    """Mean values of M contacts with m components (the components of all taxels).

    rest: f64[M, m], mean in the baseline phase, without contact. change: f64[M, m], mean in the hold phase minus rest.
    NaN where a component has no value. conditions: (object, approach) of each contact. sessions: session of each.
    """

    rest: FloatArray
    change: FloatArray
    conditions: tuple[tuple[str, str], ...]
    sessions: tuple[int, ...]

    @property
    def direction(self) -> Direction:
        """Direction in which contact changes the values: `RAISES`, `LOWERS` or `SIGNED` (both directions).

        The sum of the squared increases is compared with that of the squared decreases. `SIGNED` if the two sums differ
        by less than `CLEAR_SHARE` of their total.
        """
        change = np.nan_to_num(self.change)
        balance = float((change * np.abs(change)).sum()) / max(float((change**2).sum()), 1e-300)
        if abs(balance) < CLEAR_SHARE:
            return Direction.SIGNED
        return Direction.RAISES if balance > 0 else Direction.LOWERS

    def average_conditions(self, wanted: Iterable[tuple[str, str]]) -> FloatArray:
        """Return the mean change of each wanted condition, f64[C, m]; NaN for a condition without contacts.

        wanted: C conditions, (object, approach) each.
        """
        averages = []
        for condition in wanted:
            contacts = [number for number, other in enumerate(self.conditions) if other == condition]
            averages.append(self.change[contacts].mean(axis=0) if contacts else np.full(self.change.shape[1], np.nan))
        return np.array(averages)


def with_phases(contact: Contact) -> Contact | None:
    """Return the contact with its declared phases, or with detected ones; None if the values contain no contact."""
    if contact.phase is not None:
        return contact
    values = contact.values.reshape(len(contact.values), -1)
    phase = detect_phases(np.where(contact.is_missing()[:, None], np.nan, values))
    return None if phase is None else replace(contact, phase=phase)


def compute_hold_means(contacts: Iterable[Contact]) -> HoldMeans:
    """Compute for each contact the mean values in the baseline phase, and their change in the hold phase.

    Contacts without phases, baseline frames or hold frames are left out.
    """
    rest, change, conditions, sessions = [], [], [], []
    for contact in contacts:
        phase = contact.phase
        if phase is None or not (phase == Phase.HOLD).any() or not (phase == Phase.BASELINE).any():
            continue
        values = contact.values.reshape(len(contact.values), -1)
        values = np.where(contact.is_missing()[:, None], np.nan, values)
        with np.errstate(invalid="ignore"):
            rest.append(np.nanmean(values[phase == Phase.BASELINE], axis=0))
            change.append(np.nanmean(values[phase == Phase.HOLD], axis=0) - rest[-1])
        conditions.append((contact.object, contact.approach))
        sessions.append(contact.session)
    if not rest:
        return HoldMeans(np.zeros((0, 1)), np.zeros((0, 1)), (), ())
    return HoldMeans(np.array(rest), np.array(change), tuple(conditions), tuple(sessions))
