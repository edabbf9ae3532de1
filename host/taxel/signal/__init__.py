"""Baseline, signal, activation and noise of raw counts."""

from taxel.signal.activation import ACTIVATION_THRESHOLD_COUNTS, Activation, ActivationFrame
from taxel.signal.baseline import (
    BASELINE_SAMPLES,
    Baseline,
    BaselineResult,
    compute_baseline,
)
from taxel.signal.disturbance import DISTURBANCE_LIMIT_COUNTS, MEDIAN_WINDOW_SAMPLES, find_disturbed_taxels
from taxel.signal.errors import DisturbedBaselineError, TooFewSamplesError
from taxel.signal.events import ActivationTracker, ContactEvent
from taxel.signal.noise import NoiseReport, measure_noise, snr, snr_db
from taxel.signal.tracked_baseline import TrackedBaseline, TrackedState

__all__ = [
    "ACTIVATION_THRESHOLD_COUNTS",
    "BASELINE_SAMPLES",
    "DISTURBANCE_LIMIT_COUNTS",
    "MEDIAN_WINDOW_SAMPLES",
    "Activation",
    "ActivationFrame",
    "ActivationTracker",
    "Baseline",
    "BaselineResult",
    "ContactEvent",
    "DisturbedBaselineError",
    "NoiseReport",
    "TooFewSamplesError",
    "TrackedBaseline",
    "TrackedState",
    "compute_baseline",
    "find_disturbed_taxels",
    "measure_noise",
    "snr",
    "snr_db",
]
