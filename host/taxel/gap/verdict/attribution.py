"""Attribution of the shrink on held-out sessions to the named effects: Shapley shares, waterfall and ablation."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations
from math import factorial

import numpy as np

from taxel.gap.features.metric import (
    Interval,
    compute_jackknife_interval,
    compute_root_interval,
    compute_shrink,
    make_leave_one_out_masks,
)
from taxel.gap.fitting.composite import CompositeModel
from taxel.gap.fitting.fit_data import FitData
from taxel.gap.verdict.held_out import HeldOut, compute_session_variance
from taxel.types import FloatArray

EffectNames = frozenset[str]
"""A subset of the named effects."""


@dataclass(frozen=True, eq=False)
class Attribution:
    """Gap of the held-out sessions for each subset of the named effects.

    names: names of the effects, in the order of the waterfall. gap2: by subset, squared gap in each held-out session,
    counts^2, f64[S]. predicted_shrink: by subset, shrink in each held-out session that the other sessions predict,
    f64[S].
    """

    names: tuple[str, ...]
    gap2: dict[EffectNames, FloatArray]
    predicted_shrink: dict[EffectNames, FloatArray]

    def compute_shapley_shares(self) -> dict[str, float]:
        """Compute the share of each effect in the reduction of the squared gap by all effects (Shapley 1953).

        The shares add up to 1. All shares are 0 if the effects together do not reduce the gap.
        """
        count = len(self.names)
        reduction: dict[str, float] = {}
        for name in self.names:
            others = [other for other in self.names if other != name]
            total = 0.0
            for size in range(count):
                weight = factorial(size) * factorial(count - size - 1) / factorial(count)
                for chosen in combinations(others, size):
                    without = frozenset(chosen)
                    total += weight * float((self.gap2[without] - self.gap2[without | {name}]).mean())
            reduction[name] = total
        whole = sum(reduction.values())
        return {name: value / whole if whole > 0 else 0.0 for name, value in reduction.items()}

    def build_waterfall(self) -> list[dict[str, object]]:
        """Return the gap in counts after each effect is added to the previous effects, as entries of the report."""
        steps: list[dict[str, object]] = []
        for number, name in enumerate(self.names):
            gap2 = self.gap2[frozenset(self.names[: number + 1])]
            masks = make_leave_one_out_masks(len(gap2)) if len(gap2) > 2 else []
            replicates = np.array([gap2[mask].mean() for mask in masks])
            value = compute_root_interval(compute_jackknife_interval(replicates, float(gap2.mean())))
            steps.append({"effect": name, "gap": value.value, "ci95": value.ci95})
        return steps

    def build_ablation(self) -> list[dict[str, object]]:
        """Return for each effect the gap in counts with all other effects, as entries of the report."""
        return [
            {"without": name, "gap": float(np.sqrt(self.gap2[frozenset(self.names) - {name}].mean()))}
            for name in self.names
        ]

    def compute_shrink_alone(self, name: str) -> Interval:
        """Compute the shrink of the gap by one effect alone, with its interval over the sessions."""
        before, after = self.gap2[frozenset()], self.gap2[frozenset({name})]
        masks = make_leave_one_out_masks(len(before)) if len(before) > 2 else []
        replicates = np.array([compute_shrink(float(before[k].mean()), float(after[k].mean())) for k in masks])
        return compute_jackknife_interval(replicates, compute_shrink(float(before.mean()), float(after.mean())))


def compute_attribution(fit_data: FitData, names: tuple[str, ...], held_out: HeldOut) -> Attribution:
    """Compute the gap of the held-out sessions with every subset of the named effects.

    In each session, the effects have the values that were fitted without this session. names: names of the effects.
    held_out: evaluation of the set of all named effects.
    """
    real, state = fit_data.sessions, fit_data.state
    count = real.value.shape[1]
    scale = fit_data.layout.compute_scale(real.value.shape[0], real.value.shape[3])
    without_session = (
        [FitData(state, real.select_sessions(mask), fit_data.layout) for mask in make_leave_one_out_masks(count)]
        if count > 1
        else [fit_data]
    )
    floor = [compute_session_variance(data.sessions, scale) for data in without_session]
    # Squared gap of a session without effects, predicted from the other sessions: excess plus variance of one session.
    start = [
        max(data.compute_excess(state.mean), 0.0) + variance
        for data, variance in zip(without_session, floor, strict=True)
    ]
    gap2: dict[EffectNames, FloatArray] = {}
    predicted_shrink: dict[EffectNames, FloatArray] = {}
    for size in range(len(names) + 1):
        for chosen in combinations(names, size):
            squares, shrinks = [], []
            for session, fitted in enumerate(held_out.fitted_effects):
                # A search without this session (--nested) can select other effects than `names`. The other effects are
                # added only to the complete set: the gap of this set then equals the gap that `held_out` states.
                is_complete = size == len(names) > 0
                composite = CompositeModel.from_effects(
                    [one for one in fitted if is_complete or one.effect.name in chosen]
                )
                features = composite.predict_features(state)
                squares.append(real.compute_squared_difference(session, features, scale))
                after = max(without_session[session].compute_excess(features), 0.0) + floor[session]
                shrinks.append(compute_shrink(start[session], after))
            gap2[frozenset(chosen)] = np.array(squares)
            predicted_shrink[frozenset(chosen)] = np.array(shrinks)
    return Attribution(names, gap2, predicted_shrink)
