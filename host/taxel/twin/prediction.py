"""Predicted frame of a twin, and the difference between the measured and the predicted frame."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np

from taxel.twin.comparison import Twin
from taxel.twin.schedule import Contact
from taxel.twin.steps import BINS_PER_PHASE
from taxel.types import BoolArray, CountArray, FloatArray

LEAST_FLOOR: Final = 1.0
"""Smallest floor of a taxel, counts: the resolution of the converter."""


@dataclass(frozen=True, eq=False)
class TwinFrame:
    """One frame beside its prediction; n taxels.

    time_s: of the frame. raw_counts: u16[n]. measured, predicted: f64[n], signal, counts; NaN where unknown. residual:
    f64[n], measured minus predicted, in floors (standard deviation between repeats of the contact). condition: of the
    announced contact, "" without one, "unknown" for one that the reference does not have.
    """

    time_s: float
    raw_counts: CountArray
    measured: FloatArray
    predicted: FloatArray
    residual: FloatArray
    condition: str

    @property
    def rms(self) -> float:
        """Root mean square of the residual, in floors; NaN without data."""
        known = self.residual[np.isfinite(self.residual)]
        return float(np.sqrt(np.mean(known**2))) if known.size else float("nan")


def predict_frame(twin: Twin, time_s: float, raw_counts: CountArray, valid: BoolArray) -> TwinFrame:
    """Compare one frame u16[n] with its prediction. valid: bool[s]."""
    level = np.where(twin.level.is_known, twin.level.level, twin.reference.rest)
    known = valid[twin.reference.places.board]
    measured = np.where(known, level - raw_counts, np.nan)
    contact = twin.contact
    noise = twin.noise.variance
    if contact is None or not contact.start_s <= time_s < contact.end_s:
        floor = np.maximum(np.sqrt(noise), LEAST_FLOOR)
        return TwinFrame(time_s, raw_counts, measured, np.zeros_like(measured), measured / floor, "")
    name = " ".join(contact.condition)
    own = twin.reference.conditions.get(contact.condition)
    if own is None:
        unknown = np.full_like(measured, np.nan)
        return TwinFrame(time_s, raw_counts, measured, unknown, unknown, f"unknown: {name}")
    mean, _ = twin.live.predict(contact.condition, own.mean, own.repeats)
    position = _find_position(contact, time_s)
    low = int(np.clip(np.floor(position), 0, len(mean) - 2))
    share = float(np.clip(position - low, 0.0, 1.0))
    predicted = (1.0 - share) * mean[low] + share * mean[low + 1]
    spread = twin.reference.relative_variance[low] * own.scale[low] ** 2 + noise
    floor = np.maximum(np.sqrt(spread), LEAST_FLOOR)
    return TwinFrame(time_s, raw_counts, measured, predicted, (measured - predicted) / floor, name)


def _find_position(contact: Contact, time_s: float) -> float:
    """Position of a time between the middles of the bins of a contact, in bins."""
    edges = [contact.times_s[0] - 1e-9]
    for begin, end, parts in zip(contact.times_s[:-1], contact.times_s[1:], BINS_PER_PHASE[1:], strict=True):
        edges += [begin + (end - begin) * (part + 1) / parts for part in range(parts)]
    # The bin before the first edge is the baseline; its middle counts as the start of the contact.
    middles = [edges[0], *(0.5 * (low + high) for low, high in pairwise(edges))]
    return float(np.interp(time_s, middles, np.arange(len(middles))))
