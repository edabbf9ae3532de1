"""Evidence from a comparison of candidate sets: for each effect, and for a cause outside the catalogue."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from taxel.gap.calibration.calibration import SMALLEST_CAUSE
from taxel.gap.comparison.candidates import Candidate, Sets
from taxel.gap.comparison.consistency import Consistency, compute_session_consistency
from taxel.gap.comparison.density import BlockDensity
from taxel.gap.comparison.remainder import predict_remainder
from taxel.gap.effects.catalogue import INSPECTED_EFFECTS
from taxel.gap.features.metric import Gap, compute_gap_of_change, measure_gap
from taxel.gap.fitting.composite import CompositeModel
from taxel.gap.fitting.fit_data import FitData
from taxel.types import FloatArray

SMALLEST_RATIO = 0.02
"""Lower limit of ratios before logarithms are taken (chosen): a smaller effect is not resolved in any dataset."""

SMALLEST_FLOOR = 0.1
"""Lower limit of the floor, counts, for datasets with an unknown variance, such as one session without repeats. Chosen:
rounding of counts alone produces such a floor in the mean of a few frames."""

LOADED_SHARE = 0.02
"""Share of the largest simulated signal of a board in a condition, above which a board in a condition is treated as
loaded (chosen)."""

ABSENT = Consistency(0.0, 0.0)
"""Consistency of an effect that does not improve the held-out prediction."""

FORM_ERROR = 0.05
"""Error of the functional forms of the catalogue, relative to the gap (chosen): a form approximates a cause, so that a
remainder of a few per cent of a large gap is no evidence for an unknown cause."""

USUAL_BLOCKS = 20.0
"""Number of loaded blocks of a usual dataset (chosen). Gains in log density are scaled to this number, because small
systematic errors of the simulator add up over the blocks of a large dataset."""


@dataclass(frozen=True)
class EffectEvidence:
    """Evidence for one effect.

    Attributes:
        weight: sum of the weights of all sets with the effect.
        gain: largest held-out log density (with the log prior) of a set with the effect, minus the largest of a set
            without it.
        size: gap that the fitted effect alone produces, divided by the floor.
        share: this gap divided by the largest such gap of the effects of the same set.
        parameters: number of fitted values of the effect, 1 for an effect that is found by inspection. Many values fit
            many deviations.
        sessions: evidence for the change by the effect from its consistency over the sessions (`compute_consistency`);
            0 for an effect that does not increase the density.
        amplitude: amplitude of the change in sessions that the fit did not use; 1 for a correct change, less if the fit
            follows random deviations.
        blocks: number of loaded blocks.
    """

    weight: float
    gain: float
    size: float
    share: float
    parameters: int
    sessions: float
    amplitude: float
    blocks: int

    def to_inputs(self) -> FloatArray:
        """Return the eight inputs of the calibration, f64[8].

        They are the log odds of the weight; the logarithms of gain, size and share; the logarithm of the size relative
        to the smallest cause, at most 0; the logarithms of the number of parameters and of the evidence from the
        sessions; the distance of the amplitude from 1, at most 1. The gain is scaled to `USUAL_BLOCKS` loaded blocks,
        because the gain grows with the size of the dataset.
        """
        # The term 1e-3 keeps the log odds finite for the weights 0 and 1.
        odds = np.log((self.weight + 1e-3) / (1.0 - self.weight + 1e-3))
        gain = np.log1p(max(self.gain, 0.0) * USUAL_BLOCKS / max(self.blocks, 1))
        size, share = (np.log(max(value, SMALLEST_RATIO)) for value in (self.size, self.share))
        too_small = min(0.0, size - np.log(SMALLEST_CAUSE))
        sessions, misfit = np.log(max(self.sessions, SMALLEST_RATIO)), min(abs(self.amplitude - 1.0), 1.0)
        return np.array([odds, gain, size, share, too_small, np.log(max(self.parameters, 1)), sessions, misfit])


@dataclass(frozen=True)
class RemainderEvidence:
    """Evidence for a cause outside the catalogue, from the remainder of the best set.

    Attributes:
        before, after: root of the excess without effects and with the best set, divided by the floor. The variance of
            the simulated mean is treated as a part of the floor here.
        deviation: mean deviation (`BlockDensity`) of the signal from the best set, over the blocks, weighted by the
            simulated signal.
        common: second largest share of a condition in the remaining excess of the signal. It is small if only one
            condition shows the remainder.
        gain: held-out log density of the generic remainder beyond the best set, minus that of the best set.
        size: gap that the generic remainder alone produces, divided by the floor.
        whole: evidence for a difference between the real and the simulated features, from its consistency over the
            sessions (`compute_consistency`).
        blocks: number of loaded blocks.
    """

    before: float
    after: float
    deviation: float
    common: float
    gain: float
    size: float
    whole: float
    blocks: int

    def to_inputs(self) -> FloatArray:
        """Return the seven inputs of the calibration, f64[7].

        They are the logarithms of before, after, deviation, common, size, gain and whole. The first and the last input
        are inputs of the probability of any cause. After and size are divided by their resolution in floors, the root
        of 1 + (`FORM_ERROR` * before)^2. The gain is scaled to `USUAL_BLOCKS` loaded blocks, because the gain grows
        with the size of the dataset.
        """
        resolution = np.hypot(1.0, FORM_ERROR * self.before)
        after, size = self.after / resolution, self.size / resolution
        ratios = np.array([self.before, after, self.deviation, self.common, size])
        gain = np.log1p(max(self.gain, 0.0) * USUAL_BLOCKS / max(self.blocks, 1))
        whole = np.log(max(self.whole, SMALLEST_RATIO))
        return np.concatenate([np.log(np.maximum(ratios, SMALLEST_RATIO)), [gain, whole]])


def collect_effects(
    fit_data: FitData, gap: Gap, sets: Sets, weights: Mapping[frozenset[str], float]
) -> dict[str, EffectEvidence]:
    """Collect the evidence for every effect that is part of a candidate set, by name.

    The evidence compares the best set with the effect and the best set without it. An effect that does not increase the
    density has no consistency. weights: weight of each set.
    """
    names = sorted({name for key in sets for name in key})
    density = {key: one.value for key, one in sets.items()}
    floor = max(gap.floor, SMALLEST_FLOOR)
    blocks = int(_compute_loads(fit_data)[1].sum())

    @lru_cache(maxsize=2)  # one of both sets is the best set of all for most effects; a prediction is large
    def predict_sessions(key: frozenset[str]) -> list[FloatArray]:
        """Predict the features for each session with a set of effects, by the fit without this session."""
        return sets[key].predict_sessions(fit_data)

    evidence = {}
    for name in names:
        best = max((key for key in sets if name in key), key=lambda key: density[key])
        without = max((key for key in sets if name not in key), key=lambda key: density[key])
        sizes = {effect: compute_single_gap(fit_data, sets[best].composite, effect) for effect in best}
        share = sizes[name] / max(*sizes.values(), np.finfo(float).tiny) if len(sizes) > 1 else 1.0
        gain = density[best] - density[without]
        consistency = ABSENT
        if gain > 0.0:
            consistency = compute_session_consistency(fit_data, predict_sessions(best), predict_sessions(without))
        evidence[name] = EffectEvidence(
            weight=float(sum(weights[key] for key in sets if name in key)),
            gain=gain,
            size=sizes[name] / floor,
            share=share,
            parameters=1 if name in INSPECTED_EFFECTS else sets[best].composite.get(name).values.size,
            sessions=consistency.evidence,
            amplitude=consistency.amplitude,
            blocks=blocks,
        )
    return evidence


def collect_remainder(fit_data: FitData, gap: Gap, best: Candidate, density: BlockDensity) -> RemainderEvidence:
    """Collect the evidence for a cause outside the catalogue. best: set with the largest weight. density: predictive
    density without model error, which would hide the remainder of an unknown cause.
    """
    after = measure_gap(fit_data.sessions, best.features, fit_data.layout)
    repeats2 = density.compute_simulated_floor2()
    floor = max(float(np.hypot(gap.floor, np.sqrt(repeats2))), SMALLEST_FLOOR)
    before_floors, after_floors = (np.sqrt(max(one.excess.value - repeats2, 0.0)) / floor for one in (gap, after))
    deviations = density.compute_deviations(best.features)[..., 0]  # family 0: signal
    load, is_loaded = _compute_loads(fit_data)
    deviation = float((deviations * load).sum() / max(load.sum(), np.finfo(float).tiny))
    excess = after.terms.excess[:, : fit_data.layout.bins].sum(axis=(1, 2))
    order = np.sort(np.maximum(excess, 0.0))[::-1]
    # second largest share: small if the remainder occurs in one condition only
    common = float(order[1] / order.sum()) if len(order) > 1 and order.sum() > 0.0 else 0.0
    held_out = best.prediction.features
    generic = predict_remainder(fit_data, best.features, held_out)
    compute = density.compute_log_density
    gain = float(compute(generic).sum() - compute(held_out).sum())
    targets = fit_data.targets_without_session
    return RemainderEvidence(
        before=float(before_floors),
        after=float(after_floors),
        deviation=deviation,
        common=common,
        gain=gain,
        size=_compute_size(fit_data, generic - held_out) / floor,
        whole=compute_session_consistency(fit_data, targets, [fit_data.state.mean] * len(targets)).evidence,
        blocks=int(is_loaded.sum()),
    )


def compute_single_gap(fit_data: FitData, composite: CompositeModel, name: str) -> float:
    """Compute the gap in counts that one fitted effect of a composite model alone produces in the simulation."""
    return _compute_size(
        fit_data, CompositeModel((composite.get(name),)).predict_features(fit_data.state) - fit_data.state.mean
    )


def _compute_size(fit_data: FitData, change: FloatArray) -> float:
    """Compute the gap, counts, that a change f64[C, F, n] (C conditions, F features, n taxels) of the features causes.
    Features that are unknown in the real data are omitted.
    """
    return compute_gap_of_change(np.where(fit_data.sessions.is_known.any(axis=1), change, 0.0), fit_data.layout)


def _compute_loads(fit_data: FitData) -> tuple[FloatArray, FloatArray]:
    """Compute for each board in each condition the sum of the simulated signal, counts, and whether the board is
    loaded, [C, s] (C conditions) each.
    """
    signal = np.abs(fit_data.state.mean[:, : fit_data.layout.bins]).sum(axis=1)
    sensor = fit_data.state.pair.groups.sensor
    boards = np.arange(int(sensor.max()) + 1)[:, None] == sensor
    load = signal @ boards.T.astype(np.float64)
    return load, load > LOADED_SHARE * load.max()
