"""Common time shift of all boards between two recordings, which is estimated and not counted as a part of the gap."""

from __future__ import annotations

import numpy as np

from taxel.gap.effects.effect import HAND
from taxel.gap.effects.latency import Latency
from taxel.gap.features.distributions import compute_student_survival
from taxel.gap.fitting.composite import CompositeModel
from taxel.gap.fitting.fit import fit, start_effect
from taxel.gap.fitting.fit_data import FitData
from taxel.types import FloatArray

MAX_P_VALUE = 0.05
"""P-value of the one-sided t test below which a shift is applied (the usual level). With a larger value, shifts are
applied that improve the agreement only by chance."""

MAX_SHIFT_FRAMES = 1.5
"""Largest common shift, in frame periods: the first frames of a phase in two recordings differ by at most this time. A
larger shift is a delay, which is a part of the gap."""


def estimate_common_shift(fit_data: FitData) -> float:
    """Return the delay of the hand relative to the simulator that all boards have in common, seconds.

    The delay is the median of the delays that are fitted to the loaded boards, so a single late board has no influence.
    It is limited to `MAX_SHIFT_FRAMES`. It is 0 if no board is loaded, or if it does not reduce the difference of the
    features significantly.
    """
    state = fit_data.state
    start = CompositeModel((start_effect(state, Latency()),))
    fitted = fit(fit_data.build_problem(), start, iterations=6).composite.fitted_effects[0]
    boards = state.loaded_boards
    if not len(boards):
        return 0.0
    max_shift_s = MAX_SHIFT_FRAMES * state.pair.frame_s
    shift = float(np.clip(np.median(fitted.values[0, boards]), -max_shift_s, max_shift_s))
    return shift if _is_better(fit_data, state.shift_time(shift).mean, state.mean) else 0.0


def _is_better(fit_data: FitData, features: FloatArray, reference: FloatArray) -> bool:
    """Return True if features agree better with the real sessions than the reference features, both f64[C, F, n] (C
    conditions, F features, n taxels).

    With three or more sessions, the reduction of the weighted squared difference must be significant in a one-sided t
    test over the sessions; with fewer sessions the mean reduction must be positive.
    """
    sessions = range(fit_data.sessions.value.shape[1])
    before, after = (
        np.array([fit_data.sessions.compute_squared_difference(session, one, fit_data.weight) for session in sessions])
        for one in (reference, features)
    )
    gain = before - after
    if gain.mean() <= 0.0 or len(gain) < 3:
        return bool(gain.mean() > 0.0)
    error = float(gain.std(ddof=1) / np.sqrt(len(gain)))
    return error == 0.0 or compute_student_survival(float(gain.mean()) / error, len(gain) - 1) < MAX_P_VALUE


class CommonShift(Latency):
    """Delay of all boards by the same `seconds`.

    The effect has a name of its own because a composite model can also contain the latency of single boards.
    """

    name = "common_shift"

    def __init__(self) -> None:
        super().__init__(HAND)


def fit_additional_shift(
    fit_data: FitData, composite: CompositeModel, fixed: tuple[str, ...]
) -> tuple[float, CompositeModel]:
    """Return an additional common shift in seconds (positive: the hand is later), and the composite model that is
    fitted together with this shift.

    Shift and effects are fitted together, because the values of an effect with memory would otherwise contain a part of
    the shift. If the shift does not improve the agreement significantly, the result is 0 and the unchanged composite
    model.

    composite: fitted composite model. fixed: names of its effects whose values remain fixed.
    """
    start = start_effect(fit_data.state, CommonShift())
    fitted = fit_data.fit_in_sample(composite.with_effect(start), fixed)
    fitted_shifts = (one for one in fitted.composite.fitted_effects if one.effect.name == CommonShift.name)
    fitted_s = next(float(one.values[0, 0]) for one in fitted_shifts)
    max_shift_s = MAX_SHIFT_FRAMES * fit_data.state.pair.frame_s
    shift = float(np.clip(fit_data.state.shift_s + fitted_s, -max_shift_s, max_shift_s)) - fit_data.state.shift_s
    if not _is_better(fit_data, fitted.features, composite.predict_features(fit_data.state)):
        return 0.0, composite
    return shift, fitted.composite.without(CommonShift.name)
