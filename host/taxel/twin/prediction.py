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
"""Smallest floor of a taxel (standard deviation of its signal between repeats), counts: the converter's resolution."""


@dataclass(frozen=True, eq=False)
class TwinFrame:
    """One frame of n taxels beside its prediction.

    time_s: time of the frame. raw_counts: u16[n]. measured, predicted: f64[n], signal, counts; NaN where unknown.
    residual: f64[n], measured minus predicted signal, in floors (standard deviation between repeats of the contact).
    condition: object and approach of the announced contact; "" without a contact; "unknown: " and the condition if the
    reference does not contain it.
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
    """Compare one frame with its prediction: a signal of 0 outside contacts, the expected contact otherwise.

    raw_counts: u16[n]. valid: bool[s], whether each board delivered its frame. The prediction and the residual are NaN
    in a contact whose condition the reference does not contain.
    """
    level = np.where(twin.level.is_known, twin.level.level, twin.reference.rest)
    known = valid[twin.reference.places.board]
    measured = np.where(known, level - raw_counts, np.nan)
    contact = twin.contact
    noise = twin.noise.variance
    if contact is None or not contact.start_s <= time_s < contact.end_s:
        floor = np.maximum(np.sqrt(noise), LEAST_FLOOR)
        return TwinFrame(time_s, raw_counts, measured, np.zeros_like(measured), measured / floor, "")
    name = " ".join(contact.condition)
    known_condition = twin.reference.conditions.get(contact.condition)
    if known_condition is None:
        unknown = np.full_like(measured, np.nan)
        return TwinFrame(time_s, raw_counts, measured, unknown, unknown, f"unknown: {name}")
    mean, _ = twin.live.predict(contact.condition, known_condition.mean, known_condition.repeats)
    position = _find_bin_position(contact, time_s)
    low = int(np.clip(np.floor(position), 0, len(mean) - 2))
    share = float(np.clip(position - low, 0.0, 1.0))
    predicted = (1.0 - share) * mean[low] + share * mean[low + 1]
    variance = twin.reference.relative_variance[low] * known_condition.scale[low] ** 2 + noise
    floor = np.maximum(np.sqrt(variance), LEAST_FLOOR)
    return TwinFrame(time_s, raw_counts, measured, predicted, (measured - predicted) / floor, name)


def _find_bin_position(contact: Contact, time_s: float) -> float:
    """Return the position of a time among the middles of a contact's time bins: 2.5 is midway between bins 2 and 3."""
    edges = [contact.times_s[0] - 1e-9]
    for begin, end, parts in zip(contact.times_s[:-1], contact.times_s[1:], BINS_PER_PHASE[1:], strict=True):
        edges += [begin + (end - begin) * (part + 1) / parts for part in range(parts)]
    # The bin before the first edge is the baseline; the start of the contact stands for its middle.
    middles = [edges[0], *(0.5 * (low + high) for low, high in pairwise(edges))]
    return float(np.interp(time_s, middles, np.arange(len(middles))))
