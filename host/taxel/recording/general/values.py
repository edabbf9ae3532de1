"""Properties of values that a dataset does not declare: direction of the change by contact; rest and hold values."""

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
"""Share of the squared change of one sign beyond that of the other, from which the direction is clear."""


@dataclass(frozen=True, eq=False)
class HoldMeans:
    """Mean values of M contacts of m components: rest and change in the hold, f64[M, m] each, and the labels."""

    rest: FloatArray
    change: FloatArray
    conditions: tuple[tuple[str, str], ...]
    sessions: tuple[int, ...]

    @property
    def direction(self) -> Direction:
        """Change of the values by contact: of the squared changes, by sign."""
        change = np.nan_to_num(self.change)
        balance = float((change * np.abs(change)).sum()) / max(float((change**2).sum()), 1e-300)
        if abs(balance) < CLEAR_SHARE:
            return Direction.SIGNED
        return Direction.RAISES if balance > 0 else Direction.LOWERS

    def average_conditions(self, wanted: Iterable[tuple[str, str]]) -> FloatArray:
        """Mean change of each wanted condition, f64[C, m]; NaN for a condition without contacts."""
        rows = []
        for condition in wanted:
            own = [number for number, other in enumerate(self.conditions) if other == condition]
            rows.append(self.change[own].mean(axis=0) if own else np.full(self.change.shape[1], np.nan))
        return np.array(rows)


def with_phases(contact: Contact) -> Contact | None:
    """The contact with its declared phases, or with detected ones; None if the values contain no contact."""
    if contact.phase is not None:
        return contact
    values = contact.values.reshape(len(contact.values), -1)
    phase = detect_phases(np.where(contact.is_missing()[:, None], np.nan, values))
    return None if phase is None else replace(contact, phase=phase)


def compute_hold_means(contacts: Iterable[Contact]) -> HoldMeans:
    """Rest values and changes in the hold; contacts without phases, baseline or hold are left out."""
    rest, change, conditions, sessions = [], [], [], []
    for contact in contacts:
        phase = contact.phase
        if phase is None or not (phase == Phase.HOLD).any() or not (phase == Phase.BASELINE).any():
            continue
        values = contact.values.reshape(len(contact.values), -1)
        values = np.where(contact.is_missing()[:, None], np.nan, values)
        with np.errstate(invalid="ignore"):
            own = np.nanmean(values[phase == Phase.BASELINE], axis=0)
            rest.append(own)
            change.append(np.nanmean(values[phase == Phase.HOLD], axis=0) - own)
        conditions.append((contact.object, contact.approach))
        sessions.append(contact.session)
    if not rest:
        return HoldMeans(np.zeros((0, 1)), np.zeros((0, 1)), (), ())
    return HoldMeans(np.array(rest), np.array(change), tuple(conditions), tuple(sessions))
