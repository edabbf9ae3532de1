"""Estimate of the target in front of one board at one time."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from taxel.proximity.motion_filter import MotionFilter
from taxel.proximity.motion_grid import CENTRES_M, EDGES_M, SPEEDS_M_S, WIDTHS_M, compute_speed_widths
from taxel.types import FloatArray

INTERVAL = (0.025, 0.975)
"""Quantiles that bound a 95 % interval."""

HIDDEN_PARTS_M = ((0.65, 1.2e-4), (0.35, 7.5e-4))
"""By how much the nearest part of a target is nearer than its template (the modelled shape): probabilities and mean
values (metres) of two exponential distributions. An edge or a corner that covers a small part of a taxel hardly changes
the taxel's signal, so that a target can only be nearer than its template. The values were fitted by maximum likelihood
to the true distances on four emulated skins with the seed 9001 (plates, boxes, cylinders and spheres), and rounded. The
check in docs/proximity.md uses other seeds."""

PRESENT_PROBABILITY = 0.9
"""Probability of a target above which its distance is reported. With a smaller value, farther targets are reported, but
more often also targets that do not exist."""

TARGET_PROBABILITY = 0.9
"""Probability of a calibrated target above which its name is reported; otherwise the target is not identifiable."""

NOT_IDENTIFIABLE = "not identifiable"
UNKNOWN = "unknown"


@dataclass(frozen=True)
class Range:
    """Median of a quantity, and the bounds `low` and `high` of its 95 % interval."""

    median: float
    low: float
    high: float


@dataclass(frozen=True)
class ProximityEstimate:
    """Estimate for one board at the scan time of one frame.

    Attributes:
        address, board: I2C address and name of the board.
        time_s: start of the scan, seconds of the stream's clock.
        is_ready: whether the baseline is complete.
        present: probability of a target in range that does not touch the board. contact: probability of a contact.
        distance_m, speed_m_s: distance and approach speed of the target; None unless `present` exceeds
            `PRESENT_PROBABILITY`. The distance decreases at a positive speed.
        contact_soon: probability that a contact exists or begins within `horizon_s` after `time_s`.
        time_to_contact_s: time until contact at the present speed; None without a target that approaches.
        targets: probabilities of the calibrated targets, by name; empty without a target.
        target: name of the most probable target; "not identifiable" if no target is probable enough; "unknown" if no
            calibrated target fits the signals; None without a target.
        centre: index of the board's taxel that is nearest to the target; None without a target.
    """

    address: int
    board: str
    time_s: float
    is_ready: bool
    present: float
    contact: float
    distance_m: Range | None
    speed_m_s: Range | None
    contact_soon: float
    horizon_s: float
    time_to_contact_s: Range | None
    targets: dict[str, float]
    target: str | None
    centre: int | None

    def as_dict(self) -> dict[str, Any]:
        """Convert the estimate to JSON values; lengths in millimetres, times in seconds."""
        return {
            "time_s": round(self.time_s, 6),
            "address": self.address,
            "board": self.board,
            "ready": self.is_ready,
            "present": round(self.present, 4),
            "contact": round(self.contact, 4),
            "distance_mm": _scale(self.distance_m, 1e3),
            "speed_mm_s": _scale(self.speed_m_s, 1e3),
            "contact_soon": round(self.contact_soon, 4),
            "horizon_s": round(self.horizon_s, 4),
            "time_to_contact_s": _scale(self.time_to_contact_s, 1.0),
            "target": self.target,
            "targets": {name: round(value, 4) for name, value in self.targets.items()},
            "taxel": self.centre,
        }


def _scale(value: Range | None, factor: float) -> dict[str, float | None] | None:
    """Convert a range times `factor` to JSON values; infinite values, and a missing range, become None."""
    if value is None:
        return None
    pairs = (("median", value.median), ("low", value.low), ("high", value.high))
    return {key: round(factor * each, 4) if math.isfinite(each) else None for key, each in pairs}


def compute_quantiles(mass: FloatArray, edges: FloatArray) -> Range:
    """Compute the median and the 95 % interval of a histogram with uniform density in each bin.

    mass: f64[bins], not normalised. edges: f64[bins + 1], bounds of the bins.
    """
    cumulative = np.concatenate([[0.0], np.cumsum(mass)]) / mass.sum()
    low, median, high = np.interp((INTERVAL[0], 0.5, INTERVAL[1]), cumulative, edges).tolist()
    return Range(median, low, high)


def _compute_hidden_shift() -> FloatArray:
    """Compute for each distance of a template the distribution of the distance of the target's nearest part, f64[G, G].

    A template is a modelled shape of a target at one distance. A part of the target that the template does not contain
    can be nearer than the template. The excess, the distance of the template minus the distance of this part, is
    distributed as the mixture of exponential distributions `HIDDEN_PARTS_M` (probability and mean of each). Rows: bin
    of the template's distance; columns: bin of the nearest part's distance; each row adds up to 1.
    """
    shift = np.zeros((len(CENTRES_M), len(CENTRES_M)))
    excess = CENTRES_M[:, None] - EDGES_M  # template at the centre of a bin, nearest part at the edge of a bin
    for probability, mean in HIDDEN_PARTS_M:
        survival = np.where(excess > 0.0, np.exp(-np.maximum(excess, 0.0) / mean), 1.0)
        survival[:, 0] = 0.0  # a larger excess would be a contact: the nearest bin has its probability
        shift += probability * np.diff(survival, axis=1)
    return np.asarray(shift / shift.sum(axis=1, keepdims=True))


_HIDDEN_SHIFT = _compute_hidden_shift()


def compute_nearest_motion(state: MotionFilter) -> FloatArray:
    """Compute the joint probabilities of V speeds and G distances of a target's nearest part, f64[V, G]."""
    return np.asarray(state.motion @ _HIDDEN_SHIFT)


def summarise_distance(motion: FloatArray) -> Range:
    """Return median and 95 % interval of the distance, metres.

    motion: f64[V, G], joint probabilities of speed and distance.
    """
    return compute_quantiles(motion.sum(axis=0), EDGES_M)


def summarise_speed(motion: FloatArray) -> Range:
    """Return median and 95 % interval of the approach speed, metres per second.

    motion: f64[V, G], joint probabilities of speed and distance.
    """
    widths = compute_speed_widths()
    edges = np.concatenate([[SPEEDS_M_S[0] - 0.5 * widths[0]], 0.5 * (SPEEDS_M_S[1:] + SPEEDS_M_S[:-1])])
    edges = np.append(edges, SPEEDS_M_S[-1] + 0.5 * widths[-1])
    return compute_quantiles(motion.sum(axis=1), edges)


def summarise_time_to_contact(motion: FloatArray) -> Range | None:
    """Return median and 95 % interval of the time until contact at constant speed, seconds.

    motion: f64[V, G], joint probabilities of speed and distance. A target that does not approach has an infinite time;
    the result is None if the median is infinite.
    """
    approaching = SPEEDS_M_S > 0
    with np.errstate(divide="ignore"):
        time = np.where(approaching[:, None], CENTRES_M / np.where(approaching, SPEEDS_M_S, 1.0)[:, None], np.inf)
    order = np.argsort(time, axis=None)
    cumulative = np.cumsum(motion.ravel()[order]) / motion.sum()
    index = np.minimum(np.searchsorted(cumulative, (INTERVAL[0], 0.5, INTERVAL[1])), len(order) - 1)
    low, median, high = time.ravel()[order][index].tolist()
    return Range(median, low, high) if np.isfinite(median) else None


def compute_contact_probability(motion: FloatArray, contact: float, horizon_s: float) -> float:
    """Compute the probability that a contact exists now or begins within `horizon_s` at constant speed.

    motion: f64[V, G], joint probabilities of speed and distance without contact. contact: probability of a contact now.
    """
    reached = np.clip((SPEEDS_M_S[:, None] * horizon_s - EDGES_M[:-1]) / WIDTHS_M, 0.0, 1.0)
    return float((motion * reached).sum() + contact)
