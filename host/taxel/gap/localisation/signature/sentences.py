"""Sentences that describe a distortion: its direction, its size and its location."""

from __future__ import annotations

from typing import Final

import numpy as np

from taxel.gap.data.pair import Pair
from taxel.gap.features.features import FeatureLayout
from taxel.gap.localisation.signature.distortions import BOARD, COLUMN, HAND, ROW, TAXEL, compute_signal_knots
from taxel.gap.localisation.signature.fit import DistortionFit
from taxel.gap.localisation.signature.locations import LocalDeviation, describe_location
from taxel.gap.localisation.signature.sensitivity import SensitivityChange
from taxel.recording.grasp_format import Phase
from taxel.types import FloatArray

MAX_NAMED: Final = 3
"""Largest number of locations in a sentence; the report lists all of them. Chosen."""

NEGLIGIBLE_SHARE: Final = 0.15
"""Share of the largest value of a curve over the signal, below which another value, or the deviation from a straight
line, is treated as 0. Chosen."""

LINE_NAMES: Final = {ROW: "TX line", COLUMN: "RX line"}


def describe_distortion(
    pair: Pair,
    layout: FeatureLayout,
    fit: DistortionFit | None,
    local: LocalDeviation | None,
    model: FloatArray,
    scope: str,
    locations: list[int],
) -> str:
    """Return the description of a distortion and of its locations, as a clause of a sentence.

    fit: fit of the distortion; None for a local deviation. local: a local deviation; None for a fit. model: f64[C, F,
    n] (C conditions, F features, n taxels), predicted features. scope: kind of the locations (hand, board, row, column
    or taxel). locations: numbers of the locations as in `get_groups`, largest share first.
    """
    is_part_of_scope = fit is not None and fit.scope != scope
    where = _describe_locations(pair, scope, locations, ", mostly on " if is_part_of_scope else ", on ")
    if local is not None:
        often = (
            "in the only condition that loads this location"
            if local.has_one_condition
            else "in every condition that loads it"
        )
        return f"local deviation{where}: present {often}, absent elsewhere"
    assert fit is not None
    coefficients = fit.coefficients[_select_coefficient_set(fit, scope, locations)]
    match fit.name:
        case "amplitude":
            clause = _describe_curve(coefficients, compute_signal_knots(np.nan_to_num(model[:, : layout.bins])))
        case "lag":
            direction = "later" if coefficients[0] > 0 else "earlier"
            clause = f"the signal of the hand is {abs(coefficients[0]):.2g} s {direction}"
        case "history":
            clause = _describe_history(coefficients, layout)
        case "radial":
            # Coefficients 0 and 1 belong to the centre of the contact area, the others to its rim and the neighbours.
            direction = "wider" if coefficients[2:].sum() > 0 else "narrower"
            clause = f"the contact area is {direction} than predicted"
        case "shift":
            clause = "the contact area is displaced from its predicted position"
        case "common":
            clause = _describe_common(coefficients)
        case "noise" | "missing" | "wander":
            clause = _describe_other_feature(fit.name, coefficients)
        case _:
            clause = _describe_fixed(fit, coefficients, pair, scope, locations)
    return clause + where


def describe_change(pair: Pair, change: SensitivityChange) -> str:
    """Return the description of a change of sensitivity, as a clause of a sentence."""
    size, boards = f"{100 * abs(change.size):.1f} %", [pair.sensors.name[k].replace("_", " ") for k in change.boards]
    where = f", mostly on {boards[0]}" if boards and len(boards) < len(pair.sensors.name) else ""
    if change.name == "presses":
        verb = "increases" if change.size > 0 else "decreases"
        return f"the sensitivity {verb} by {size} from the first to the last grasp of a session{where}"
    trend = ""
    if change.is_monotone:
        trend = ", increasing" if change.size > 0 else ", decreasing"
        trend += " from session to session"
    return f"the sensitivity differs between sessions by {size} (standard deviation){trend}{where}"


def join_clauses(clauses: list[str]) -> str:
    """Join clauses to one sentence; empty clauses are omitted."""
    return "; in addition, ".join(clause for clause in clauses if clause)


def _describe_locations(pair: Pair, scope: str, locations: list[int], on: str) -> str:
    """Return the locations as the end of a clause, with at most `MAX_NAMED` names.

    on: words before the names, such as ", on ". Without locations the words are ", on all boards", or "" for a hand
    with one board.
    """
    if scope == HAND or not locations:
        return ", on all boards" if len(pair.sensors.name) > 1 else ""
    names = [describe_location(pair, scope, k) for k in locations[:MAX_NAMED]]
    if len(locations) > MAX_NAMED:
        names.append(f"{len(locations) - MAX_NAMED} more")
    return on + (f"{', '.join(names[:-1])} and {names[-1]}" if len(names) > 1 else names[0])


def _select_coefficient_set(fit: DistortionFit, scope: str, locations: list[int]) -> int:
    """Return the row of `fit.coefficients` whose values the sentence states.

    It is the row of the first location, the one with the largest share. It is row 0 if the coefficients apply to the
    whole hand, if there are no locations, or if the locations are of another kind than the groups that share
    coefficients.
    """
    if fit.scope == HAND or not locations or fit.scope != scope:
        return 0
    return locations[0]


def _describe_other_feature(name: str, coefficients: FloatArray) -> str:
    """Describe a change of noise, missing frames or drift residual by the coefficient with the largest magnitude.

    name: name of the distortion. coefficients: counts; for missing frames, a share of the frames.
    """
    value = _get_largest(coefficients)
    if name == "noise":
        return f"the noise of the hand is {'larger' if value > 0 else 'smaller'} by {abs(value):.3g} counts"
    if name == "missing":
        return f"{'more' if value > 0 else 'fewer'} frames are missing ({100 * abs(value):.1f} %)"
    return f"unloaded taxels drift by {abs(value):.3g} counts {'more' if value > 0 else 'less'} after the release"


def _describe_curve(values: FloatArray, knots: FloatArray) -> str:
    """Describe a curve over the predicted signal: proportional to it, with a bend, or nonlinear.

    values: f64[K], real minus predicted signal at each of K knots, counts. knots: f64[K], predicted signals at the
    knots, counts.
    """
    line = float(values @ knots / (knots @ knots))
    largest = float(np.abs(values).max())
    if largest <= 0:
        return "nonlinear in the signal"
    if np.abs(values - line * knots).max() < NEGLIGIBLE_SHARE * largest:
        relation = "more" if line > 0 else "less"
        return f"proportional to the signal: the hand has {100 * abs(line):.0f} % {relation} signal"
    signs = np.sign(np.where(np.abs(values) < NEGLIGIBLE_SHARE * largest, 0.0, values))
    high = _describe_level(float(values[-1]), float(knots[-1])) if signs[-1] else "no deviation at the largest signal"
    if signs[-1] == 0 or (signs[:-1] * signs[-1] < 0).any():
        other = np.where(signs[:-1] * signs[-1] < 0, np.abs(values[:-1]), 0.0) if signs[-1] else np.abs(values[:-1])
        k = int(other.argmax())
        return f"nonlinear in the signal: {_describe_level(float(values[k]), float(knots[k]))}, {high}"
    slopes = np.diff(np.concatenate([[0.0], values])) / np.diff(np.concatenate([[0.0], knots]))
    bend = int(np.abs(np.diff(slopes)).argmax())
    return f"grows with the signal, with a bend at {knots[bend]:.0f} counts: {high}"


def _describe_level(counts: float, signal_counts: float) -> str:
    """Describe a deviation `counts` of the real signal from a predicted signal of `signal_counts` counts."""
    relation = f"{abs(counts):.0f} counts {'above' if counts > 0 else 'below'}"
    return f"the signal of the hand is {relation} a predicted signal of {signal_counts:.0f} counts"


def _describe_history(coefficients: FloatArray, layout: FeatureLayout) -> str:
    """Describe a deviation of the signal after the hold.

    coefficients: deviation in each time bin of release and recovery, as a share of the hold signal.
    """
    bins = layout.phase[: layout.bins]
    later = bins[np.isin(bins, [Phase.RELEASE, Phase.RECOVERY])]
    clauses = [
        f"{100 * abs(value):.1f} % of the hold signal {'more' if value > 0 else 'less'} than predicted in {name}"
        for phase, name in ((Phase.RELEASE, "release"), (Phase.RECOVERY, "recovery"))
        for value in [_get_largest(coefficients[later == phase])]
        if value != 0.0
    ]
    return (
        f"the signal decays too slowly after a load: {', '.join(clauses)}"
        if coefficients.sum() > 0
        else f"the signal decays too fast after a load: {', '.join(clauses)}"
    )


def _get_largest(values: FloatArray) -> float:
    """Return the value with the largest magnitude, with its sign; 0 if there are no values."""
    return float(values[np.abs(values).argmax()]) if len(values) else 0.0


def _describe_common(coefficients: FloatArray) -> str:
    """Describe a signal that all taxels have in common. coefficients: factors on the mean signal of the hand and of the
    board.
    """
    sign = "positive" if coefficients.sum() > 0 else "negative"
    part = "the hand" if abs(coefficients[0]) > abs(coefficients[1]) else "their board"
    return f"all taxels, loaded or not, have a {sign} signal that grows with the total load of {part}"


def _describe_fixed(fit: DistortionFit, coefficients: FloatArray, pair: Pair, scope: str, locations: list[int]) -> str:
    """Describe a deviation that is the same in every condition.

    coefficients: factor and offset of a location; or for a line, factors on the signals of all lines of its board, and
    an offset. The sentence states the largest of these factors, or that two lines are exchanged.
    """
    if fit.name in (BOARD, TAXEL) or coefficients.shape[-1] == 2:
        factor, offset = (float(value) for value in coefficients)
        clauses = (  # without values that would be rounded to 0 % or to less than 1 count
            [f"{100 * abs(factor):.0f} % {'more' if factor > 0 else 'less'} signal"] if abs(factor) >= 0.005 else []
        )
        clauses += [f"an offset of {offset:+.0f} counts"] if abs(offset) >= 1.0 else []
        return f"the same in every condition: {' and '.join(clauses) or 'a negligible deviation'}"
    group = {ROW: pair.groups.tx, COLUMN: pair.groups.rx}[fit.name]
    if not locations:
        return "the same in every condition, for each line"
    board = pair.groups.sensor[np.flatnonzero(group == locations[0])[0]]
    first = int(group[pair.groups.sensor == board].min())
    own_factor, other_factors = float(coefficients[locations[0] - first]), coefficients[:-1].copy()
    other_factors[locations[0] - first] = 0.0
    most = int(np.abs(other_factors).argmax())
    if own_factor < -0.5 and other_factors[most] > 0.5:
        return f"a {LINE_NAMES[scope]} shows the signal of another line: {describe_location(pair, scope, first + most)}"
    if np.abs(other_factors).max() > abs(own_factor):
        if abs(other_factors[most]) > 1.0:  # more than 100 % of a line with hardly any signal is no meaningful share
            return f"{LINE_NAMES[scope]}s show the signal of other lines"
        return f"{LINE_NAMES[scope]}s have {100 * other_factors[most]:+.0f} % of the signal of other lines"
    relation = "more" if own_factor > 0 else "less"
    return f"the same in every condition, by {LINE_NAMES[scope]}s: {100 * abs(own_factor):.0f} % {relation} signal"
