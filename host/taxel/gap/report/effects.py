"""Report entry of an effect: parameters with intervals, the location, and the reduction of the gap."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

import numpy as np
from scipy.optimize import brentq, minimize_scalar

from taxel.gap.data.pair import Pair
from taxel.gap.effects.dropout import Dropout
from taxel.gap.effects.effect import BOARD, HAND, OBJECT, TAXEL
from taxel.gap.effects.latency import is_delay
from taxel.gap.effects.pose_error import PoseError
from taxel.gap.effects.sticking import Sticking, convert_to_lag_parameters
from taxel.gap.features.distributions import compute_chi2_quantile
from taxel.gap.features.metric import Gap, Interval, combine_errors, compute_jackknife_interval, compute_shrink_interval
from taxel.gap.fitting.composite import CompositeModel, FittedEffect
from taxel.gap.fitting.fit import linearise
from taxel.gap.fitting.fit_data import SIGNAL_TOLERANCE_SHARE, FitData
from taxel.gap.report.model import describe_model, split_noise
from taxel.gap.report.neutral import find_neutral
from taxel.gap.verdict.attribution import Attribution
from taxel.gap.verdict.explanation import Explanation
from taxel.gap.verdict.held_out import HeldOut
from taxel.types import FloatArray

COMMON_ERROR_SHARE: Final = 0.5 * SIGNAL_TOLERANCE_SHARE
"""Relative standard error of a parameter from the model error that a good simulator has in all contacts together, 2 %.

Half of `SIGNAL_TOLERANCE_SHARE` is treated as common to all contacts; no jackknife over sessions or contacts reveals
it."""

DELAY_STD_FRAMES: Final = 0.3
"""Standard error of a delay, in frame periods: two solvers of the same contact load synchronous boards at times that
differ by about this value."""

MAX_LOG_GAIN_STD: Final = 2.0
"""Upper bound of the standard deviation of log gains, dimensionless. Chosen: larger than any plausible value; it limits
the search and the upper end of the interval."""


def build_effect_entry(
    name: str,
    fit_data: FitData,
    named: Explanation,
    alone: tuple[CompositeModel, FloatArray] | None,
    held_out: HeldOut,
    gap: Gap,
    attribution: Attribution,
    identifiability: str,
    samples: Sequence[FittedEffect],
) -> dict[str, Any]:
    """Build the entry in `effects` of an effect that was tried.

    named: the effects of the verdict. alone: the fit of the effect alone, and the features with this fit, f64[C, F, n]
    (C conditions, F features, n taxels); None without a fit. held_out: fits without each session. gap: gap without
    effects. attribution: shares of the effects in the shrink. identifiability: value of the field of this name.
    samples: posterior samples of the fitted effect; empty for an effect that is not in the verdict.
    """
    pair = fit_data.state.pair
    in_verdict = name in named.names
    fitted_effect = named.composite.get(name) if in_verdict else None
    entry: dict[str, Any] = {"name": name, "parameters": {}, "where": {}, "in_verdict": in_verdict}
    if fitted_effect is None and alone is not None:
        fitted_effect = alone[0].get(name)
    if fitted_effect is None:
        return {**entry, "identifiability": identifiability, **_build_unchanged_gap(gap)}
    without_sessions: list[FittedEffect] = []
    without_folds: list[FittedEffect] = []
    if in_verdict:
        without_sessions = [
            one for fitted_effects in held_out.fitted_effects for one in fitted_effects if one.effect.name == name
        ]
        without_folds = [composite.get(name) for composite in named.fold_composites]
    entry["parameters"] = build_parameter_entries(pair, fitted_effect, without_sessions, without_folds, samples)
    entry["where"] = _locate_effect(pair, fitted_effect)
    if name == "gain_mismatch" and fitted_effect.effect.scope == TAXEL:
        spread = _estimate_gain_spread(fit_data, fitted_effect)
        entry["parameters"]["log_std"] |= {"value": spread.value, "ci95": spread.ci95}
    entry["model"] = describe_model(fit_data.state, fitted_effect)
    entry["identifiability"] = identifiability
    entry |= _build_unchanged_gap(gap)
    if alone is not None:  # otherwise the effect was only fitted together with other effects
        entry |= _measure_alone(fit_data, alone[1], gap)
    if in_verdict:
        measured = attribution.compute_shrink_alone(name)
        entry["shapley_share"] = attribution.compute_shapley_shares()[name]
        entry["predicted_shrink"] = float(attribution.predicted_shrink[frozenset({name})].mean())
        entry["measured_shrink"], entry["measured_shrink_ci95"] = measured.value, measured.ci95
    return entry


def _measure_alone(fit_data: FitData, features: FloatArray, gap: Gap) -> dict[str, Any]:
    """Return the report fields with the gap (counts) and the shrink of one effect alone. features: f64[C, F, n] (C
    conditions, F features, n taxels), features with this effect.
    """
    alone = compute_shrink_interval(fit_data.sessions, fit_data.state.mean, features, fit_data.layout)
    after = gap.gap.value * (1.0 - alone.value)
    return {"gap_after_alone": after, "shrink_alone": alone.value, "shrink_alone_ci95": alone.ci95}


def _build_unchanged_gap(gap: Gap) -> dict[str, Any]:
    """Return the gap and shrink fields of an effect that does not change the gap."""
    shrinks: dict[str, Any] = {"gap_after_alone": gap.gap.value, "shrink_alone": 0.0, "shrink_alone_ci95": None}
    shrinks |= {"shapley_share": 0.0, "predicted_shrink": 0.0, "measured_shrink": 0.0, "measured_shrink_ci95": None}
    return shrinks


def build_parameter_entries(
    pair: Pair,
    fitted_effect: FittedEffect,
    without_sessions: Sequence[FittedEffect] = (),
    without_folds: Sequence[FittedEffect] = (),
    samples: Sequence[FittedEffect] = (),
) -> dict[str, Any]:
    """Build value, 95 % interval, unit and neutral value of each parameter, by label.

    The label is the name of the parameter, for a value of one board "name@address", of one object "name@object".
    without_sessions: fits without each session. without_folds: fits without each fold of contacts and taxels. samples:
    posterior samples.

    The variance of a value is the sum of three variances: over sessions, over folds (both jackknife, Tukey 1958), and
    of the simulator's model error that all contacts share. The standard deviation of this model error is
    `COMMON_ERROR_SHARE` times the value; for a delay, `DELAY_STD_FRAMES` frame periods are added in quadrature. The
    interval contains at least 95 % of the samples. Below three sessions there is no interval.
    """
    if isinstance(fitted_effect.effect, Dropout):
        return _describe_dropout(pair, fitted_effect.effect)
    values = _compute_values(pair, fitted_effect)
    session_values, fold_values, sample_values = (
        [_compute_values(pair, one) for one in fits] for fits in (without_sessions, without_folds, samples)
    )
    delay_error = DELAY_STD_FRAMES * pair.frame_s if fitted_effect.effect.name == "latency" else 0.0
    entries: dict[str, Any] = {}
    for label, (value, unit) in values.items():
        sessions, contacts = (
            compute_jackknife_interval(np.array([one[label][0] for one in replicates if label in one]), value)
            for replicates in (session_values, fold_values)
        )
        interval = combine_errors(sessions, contacts, float(np.hypot(COMMON_ERROR_SHARE * value, delay_error)))
        interval = interval.widen_to_samples(np.array([one[label][0] for one in sample_values if label in one]))
        entries[label] = {
            "value": value,
            "ci95": interval.ci95,
            "unit": unit,
            "neutral": find_neutral(fitted_effect, label),
        }
    return entries


def _compute_values(pair: Pair, fitted_effect: FittedEffect) -> dict[str, tuple[float, str]]:
    """Compute value and unit by label: parameters of the effect, and quantities that are derived from them."""
    if fitted_effect.effect.name == "noise":
        return _compute_noise_values(pair, fitted_effect)
    if isinstance(fitted_effect.effect, PoseError):
        fitted_effect = FittedEffect(
            fitted_effect.effect, fitted_effect.effect.convert_to_reported(fitted_effect.values)
        )
    values: dict[str, tuple[float, str]] = (
        _compute_gains(pair, fitted_effect) if fitted_effect.effect.name == "gain_mismatch" else {}
    )
    for row, parameter in enumerate(fitted_effect.effect.parameters()):
        reported = _get_reported_values(pair, fitted_effect, row)
        for block in _list_reported_blocks(fitted_effect):
            values[_build_label(pair, fitted_effect, parameter.name, block)] = (float(reported[block]), parameter.unit)
    if fitted_effect.effect.name == "baseline_drift":
        values["counts"] = (_compute_drift_counts(fitted_effect), "counts")
    if isinstance(fitted_effect.effect, Sticking):
        fraction, seconds = convert_to_lag_parameters(
            fitted_effect.values, pair.frame_s, float(pair.time_grid.time_since_start_s[-1])
        )
        values |= {"fraction": (fraction, "1"), "seconds": (seconds, "s")}
    if isinstance(fitted_effect.effect, PoseError):
        values |= _compute_displacement(fitted_effect)
    return values


def _compute_drift_counts(fitted_effect: FittedEffect) -> float:
    """Compute the drift of the board with the largest drift over a grasp, counts.

    The drift is the root of slope squared plus variance between grasps; it is negative if the slope is negative and
    larger than the standard deviation.
    """
    # Row 0 is the slope, row 1 the standard deviation between grasps.
    slope, deviation = fitted_effect.values[:, np.hypot(fitted_effect.values[0], fitted_effect.values[1]).argmax()]
    size = float(np.hypot(slope, deviation))
    return -size if slope < -deviation else size


def _get_reported_values(pair: Pair, fitted_effect: FittedEffect, row: int) -> FloatArray:
    """Return the values of a parameter by block, f64[G] (G blocks: the hand, boards, objects or taxels); delays of
    boards are relative to the mean of the earliest boards.

    A delay that all boards have in common is not identifiable: it depends on the alignment of the clocks. row: row of
    the parameter in the fitted values.
    """
    values: FloatArray = fitted_effect.values[row]
    if not is_delay(fitted_effect.effect) or len(values) < 2:
        return values
    earliest = values[values < values.min() + 0.5 * pair.frame_s]
    return np.asarray(values - earliest.mean())


def _list_reported_blocks(fitted_effect: FittedEffect) -> range:
    """Return the blocks whose values are reported: all blocks; none for an effect with one value for each taxel."""
    return range(0) if fitted_effect.effect.scope == TAXEL else range(fitted_effect.values.shape[1])


def _build_label(pair: Pair, fitted_effect: FittedEffect, name: str, block: int) -> str:
    """Return the label of a parameter in a block, see `build_parameter_entries`. name: name of the parameter."""
    if fitted_effect.effect.scope == HAND:
        return name
    if fitted_effect.effect.scope == BOARD:
        return f"{name}@{int(pair.sensors.address[block])}"
    if fitted_effect.effect.scope == OBJECT:
        return f"{name}@{pair.object_names[block]}"
    return f"{name}@{block}"


def _compute_gains(pair: Pair, fitted_effect: FittedEffect) -> dict[str, tuple[float, str]]:
    """Compute values and units by label: the median gain of each board (`scale@address`), and the standard deviation of
    the taxels' log gains about the median of their board (`log_std`).

    Taxels with a log gain of 0, which were not fitted, are ignored.
    """
    log_gains = fitted_effect.values[0][fitted_effect.effect.find_blocks_of_pair(pair)[0]]
    is_fitted = log_gains != 0.0
    sensor = pair.groups.sensor
    scales = {}
    residual = np.zeros_like(log_gains)
    for board, address in enumerate(pair.sensors.address.tolist()):
        is_fitted_on_board = (sensor == board) & is_fitted
        board_gains = log_gains[is_fitted_on_board]
        median = float(np.median(board_gains)) if len(board_gains) else 0.0
        residual[is_fitted_on_board] = board_gains - median
        scales[f"scale@{address}"] = (float(np.exp(median)), "1")
    spread = float(np.std(residual[is_fitted])) if is_fitted.any() else 0.0
    return {"log_std": (spread, "1"), **scales}


def _estimate_gain_spread(fit_data: FitData, fitted_effect: FittedEffect) -> Interval:
    """Estimate the standard deviation of the log gains of taxels about the mean of their board, with a 95 % interval.

    The method is restricted maximum likelihood with the profile interval (Patterson and Thompson 1971). The plain
    standard deviation is too small: the prior shrinks the fitted log gain of a taxel with little information towards 0,
    and the mean of a board is estimated from the same few taxels. With fewer than three informative taxels the result
    is 0 without an interval.
    """
    (column,) = linearise(fit_data.state, CompositeModel((fitted_effect,))).columns
    information = np.sum(fit_data.weight * column.change**2, axis=(0, 1))
    precision = float(column.precision[0])
    is_informative = information > precision
    if is_informative.sum() < 3:
        return Interval(0.0, None, None, None)
    # The factor removes the shrinkage towards 0 by the prior.
    log_gains = fitted_effect.values[0, is_informative] * (1.0 + precision / information[is_informative])
    sensor, variance = fit_data.state.pair.groups.sensor[is_informative], 1.0 / information[is_informative]

    def compute_deviance(spread: float) -> float:
        """Compute minus twice the log restricted likelihood (Patterson and Thompson 1971), up to a constant."""
        total_variance = spread**2 + variance
        cost = float(np.sum(np.log(total_variance)))
        for board in np.unique(sensor):
            is_on_board = sensor == board
            weight = 1.0 / total_variance[is_on_board]
            mean = np.sum(weight * log_gains[is_on_board]) / weight.sum()
            cost += float(np.sum(weight * (log_gains[is_on_board] - mean) ** 2) + np.log(weight.sum()))
        return cost

    best = float(minimize_scalar(compute_deviance, bounds=(0.0, MAX_LOG_GAIN_STD), method="bounded").x)
    limit = compute_deviance(best) + compute_chi2_quantile(0.95, 1)

    def compute_excess_deviance(spread: float) -> float:
        """Return the deviance minus its limit; the zeros are the ends of the 95 % interval."""
        return compute_deviance(spread) - limit

    low = float(brentq(compute_excess_deviance, 0.0, best)) if compute_excess_deviance(0.0) > 0 else 0.0
    high = (
        float(brentq(compute_excess_deviance, best, MAX_LOG_GAIN_STD))
        if compute_excess_deviance(MAX_LOG_GAIN_STD) > 0
        else MAX_LOG_GAIN_STD
    )
    return Interval(best, low, high, None)


def _compute_noise_values(pair: Pair, fitted_effect: FittedEffect) -> dict[str, tuple[float, str]]:
    """Compute the standard deviations of the added noise by label, counts: white noise of each block, and the largest
    common noise of all blocks.
    """
    white, *common = split_noise(pair, fitted_effect)
    values = {"common_counts": (float(np.sqrt((np.array(common) ** 2).sum(axis=0)).max()), "counts")}
    for block, value in enumerate(white.tolist()):
        values[_build_label(pair, fitted_effect, "white_counts", block)] = (value, "counts")
    return values


def _compute_displacement(fitted_effect: FittedEffect) -> dict[str, tuple[float, str]]:
    """Compute the largest translation (mm) and the largest rotation (deg) of all blocks, by label."""
    move, turn = (np.linalg.norm(fitted_effect.values[part], axis=0) for part in (slice(0, 3), slice(3, 6)))
    return {"translation_mm": (float(move.max()), "mm"), "rotation_deg": (float(turn.max()), "deg")}


def _describe_dropout(pair: Pair, effect: Dropout) -> dict[str, Any]:
    """Return the entries of a dropout by label: dead taxels outside dead lines, dead and shorted lines, and boards with
    missing frames. There are no intervals.
    """
    defects = effect.defects
    open_lines = [(int(pair.sensors.address[board]), axis, index) for board, axis, index in defects.lines]
    shorted = [(short.address, short.axis, short.index + step) for short in defects.shorts for step in (0, 1)]
    lines = [*open_lines, *(line for line in shorted if line not in open_lines)]
    return {
        "taxels": {"value": np.flatnonzero(defects.single_taxels).tolist(), "ci95": None, "unit": "index"},
        "lines": {
            "value": [list(line) for line in lines],
            "ci95": None,
            "unit": "address, axis, index",
        },
        "sensors": {
            "value": [int(pair.sensors.address[board]) for board in np.flatnonzero(defects.missing > 0)],
            "ci95": None,
            "unit": "address",
        },
    }


def _locate_effect(pair: Pair, fitted_effect: FittedEffect) -> dict[str, Any]:
    """Return the boards, lines and taxels of a dropout for the field `where`; empty for every other effect."""
    if isinstance(fitted_effect.effect, Dropout):
        entries = _describe_dropout(pair, fitted_effect.effect)
        return {key: entries[key]["value"] for key in ("sensors", "lines", "taxels")}
    return {}
