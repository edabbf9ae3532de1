"""Shrink of the gap in held-out sessions: effects are fitted to the other sessions, frozen, and evaluated."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from taxel.gap.effects.catalogue import INSPECTED_EFFECTS
from taxel.gap.features.features import SessionMeans
from taxel.gap.features.metric import Interval, compute_jackknife_interval, compute_shrink, make_leave_one_out_masks
from taxel.gap.fitting.composite import CompositeModel, FittedEffect
from taxel.gap.fitting.fit import fit, linearise
from taxel.gap.fitting.fit_data import REFIT_ITERATIONS, FitData
from taxel.types import FloatArray


@dataclass(frozen=True, eq=False)
class HeldOut:
    """Evaluation of a set of effects on each held-out session.

    before2, after2: f64[S], squared gap in the held-out session without and with the effects, counts^2. floor2: squared
    floor of a single session, counts^2. predicted_shrink: f64[S], shrink that the other sessions predict.
    fitted_effects: effects that were fitted without each session.
    """

    before2: FloatArray
    after2: FloatArray
    floor2: float
    predicted_shrink: FloatArray
    fitted_effects: tuple[tuple[FittedEffect, ...], ...]

    @property
    def session_count(self) -> int:
        """Number of sessions, S."""
        return len(self.before2)

    @property
    def before(self) -> float:
        """Root mean square gap of the held-out sessions without the effects, counts."""
        return float(np.sqrt(self.before2.mean()))

    @property
    def after(self) -> float:
        """Root mean square gap of the held-out sessions with the effects, counts."""
        return float(np.sqrt(self.after2.mean()))

    @property
    def shrink(self) -> Interval:
        """Relative reduction of the gap, (before - after) / before, with its interval over the sessions (jackknife)."""
        return compute_jackknife_interval(
            self._compute_replicates(compute_shrink),
            compute_shrink(float(self.before2.mean()), float(self.after2.mean())),
        )

    @property
    def after_interval(self) -> Interval:
        """The gap `after`, counts, with its interval over the sessions (jackknife)."""
        return compute_jackknife_interval(
            self._compute_replicates(lambda _, after: float(np.sqrt(after))), self.after
        ).non_negative

    @property
    def remaining_excess(self) -> Interval:
        """Excess with the effects, after2 - floor2, counts^2, with its interval over the sessions (jackknife)."""
        return compute_jackknife_interval(
            self._compute_replicates(lambda _, after: after - self.floor2), float(self.after2.mean() - self.floor2)
        )

    @property
    def reducible_shrink(self) -> float | None:
        """Relative reduction of the excess; None unless the lower bound of the excess without effects is above 0."""
        excess = self.before2.mean() - self.floor2
        interval = compute_jackknife_interval(self._compute_replicates(lambda before, _: before - self.floor2), excess)
        if interval.low is None or interval.low <= 0:
            return None
        return float(1.0 - (self.after2.mean() - self.floor2) / excess)

    def _compute_replicates(self, statistic: Callable[[float, float], float]) -> FloatArray:
        """Return the jackknife replicates, f64[S] (S sessions), of a statistic of the mean squared gaps before and
        after.
        """
        masks = make_leave_one_out_masks(len(self.before2)) if len(self.before2) > 1 else []
        return np.array([statistic(float(self.before2[k].mean()), float(self.after2[k].mean())) for k in masks])


def compute_held_out(
    fit_data: FitData,
    composite: CompositeModel,
    fixed: Sequence[str] = INSPECTED_EFFECTS,
    composites_without_session: Sequence[CompositeModel] = (),
) -> HeldOut:
    """Evaluate a composite model on each session, with values that are fitted to all other sessions.

    A fit starts at the values of `composite` and takes at most `REFIT_ITERATIONS` iterations. With a single session,
    the fit uses this session.

    fixed: names of effects whose values are not fitted again. composites_without_session: the composite that was
    selected without each session, which replaces `composite`; empty: `composite` for all sessions.
    """
    real, layout = fit_data.sessions, fit_data.layout
    count = real.value.shape[1]
    before = fit_data.state.mean
    scale = layout.compute_scale(real.value.shape[0], real.value.shape[3])
    before2 = [real.compute_squared_difference(session, before, scale) for session in range(count)]
    after2, predicted_shrink, fitted_effects = [], [], []
    start = linearise(fit_data.state, composite, fixed)
    for session in range(count):
        if composites_without_session:
            composite = composites_without_session[session]
            start = linearise(fit_data.state, composite, fixed)
        others = real.select_sessions(np.arange(count) != session) if count > 1 else real
        data = FitData(fit_data.state, others, layout)
        fitted = fit(data.build_problem(), composite, fixed, REFIT_ITERATIONS, start)
        fitted_effects.append(fitted.composite.fitted_effects)
        after2.append(real.compute_squared_difference(session, fitted.features, scale))
        # Predicted squared gap of the left-out session: excess of the other sessions plus variance of one session.
        excess = [data.compute_excess(features) for features in (before, fitted.features)]
        variance = compute_session_variance(others, scale)
        predicted_shrink.append(compute_shrink(max(excess[0], 0.0) + variance, max(excess[1], 0.0) + variance))
    return HeldOut(
        np.array(before2),
        np.array(after2),
        compute_session_variance(real, scale),
        np.array(predicted_shrink),
        tuple(fitted_effects),
    )


def compute_session_variance(real: SessionMeans, scale: FloatArray) -> float:
    """Return the squared gap that the variance between sessions alone causes in a single session, counts^2.

    scale: f64[F, 1] (F features), contribution of a squared difference to the squared gap
    (`FeatureLayout.compute_scale`).
    """
    return float(np.sum(scale * np.nan_to_num(real.variance)))
