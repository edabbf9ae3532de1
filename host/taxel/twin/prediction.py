"""Predicted frame of a twin, and the difference between the measured and the predicted frame."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from taxel.twin.comparison import Twin
from taxel.types import BoolArray, CountArray, FloatArray

LEAST_FLOOR: Final = 1.0
"""Smallest floor of a taxel (standard deviation of its signal between repeats), counts: the converter's resolution."""


@dataclass(frozen=True, eq=False)
class TwinFrame:
    """One frame of n taxels beside its prediction.

    time_s: time of the frame. raw_counts: u16[n]. measured, predicted: f64[n], signal, counts; NaN where unknown.
    residual: f64[n], measured minus predicted signal, in floors (standard deviation between repeats of the contact).
    condition: object and approach of the announced contact; "" without a contact; "unknown: " and the condition if the
    reference cannot predict it.
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

    raw_counts: u16[n]. valid: bool[s], whether each board delivered its frame. The residual, measured minus predicted
    signal, is in floors: standard deviations of the signal between repeats. Prediction and residual are NaN in a
    contact that the reference cannot predict.
    """
    known = valid[twin.reference.places.board]
    measured = np.where(known, twin.compute_baseline() - raw_counts, np.nan)
    contact = twin.contact
    noise = twin.noise.variance
    if contact is None or not contact.start_s <= time_s < contact.end_s:
        floor = np.maximum(np.sqrt(noise), LEAST_FLOOR)
        return TwinFrame(time_s, raw_counts, measured, np.zeros_like(measured), measured / floor, "")
    name = " ".join(contact.condition)
    expected = twin.reference.expect_frame(twin.live, contact, time_s, measured)
    if expected is None:
        unknown = np.full_like(measured, np.nan)
        return TwinFrame(time_s, raw_counts, measured, unknown, unknown, f"unknown: {name}")
    predicted, variance = expected
    floor = np.maximum(np.sqrt(variance + noise), LEAST_FLOOR)
    return TwinFrame(time_s, raw_counts, measured, predicted, (measured - predicted) / floor, name)
