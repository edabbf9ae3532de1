"""What the report says of each effect: parameters with intervals, where it acts, what it takes from the gap."""

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
from taxel.gap.effects.sticking import Sticking, as_late
from taxel.gap.features.chances import chi2_quantile
from taxel.gap.features.metric import Gap, Interval, jackknife, shrink_by, together
from taxel.gap.fitting.composite import CompositeModel, FittedEffect
from taxel.gap.fitting.fit import start_of
from taxel.gap.fitting.judge import MODEL_SHARE, Judge
from taxel.gap.report.model import model_of, noise_parts
from taxel.gap.report.neutral import find_neutral
from taxel.gap.verdict.attribution import Attribution
from taxel.gap.verdict.explanation import Explanation
from taxel.gap.verdict.held_out import HeldOut
from taxel.types import FloatArray

COMMON_SHARE: Final = 0.5 * MODEL_SHARE
"""Relative standard error of a parameter from a good simulator's own error: the half that all presses share."""

APART_FRAMES: Final = 0.3
"""Standard deviation, in frame periods, by which boards in time lie apart: two solvers of a contact touch them so."""

MOST_SPREAD: Final = 2.0
"""Of the logarithm of gains: nothing scatters by more."""


def effect_entry(
    name: str,
    judge: Judge,
    named: Explanation,
    alone: tuple[CompositeModel, FloatArray] | None,
    held: HeldOut,
    gap: Gap,
    told: Attribution,
    identifiable: str,
    draws: Sequence[FittedEffect],
) -> dict[str, Any]:
    """One effect that was tried. named: the effects of the verdict. alone: its fit alone and the features with it,
    f64[C, F, n]; None if there is no fit. draws: its link as it may be as well, none of one that was not found.
    """
    pair = judge.state.pair
    in_verdict = name in named.names
    link = named.composite.get(name) if in_verdict else None
    entry: dict[str, Any] = {"name": name, "parameters": {}, "where": {}, "in_verdict": in_verdict}
    if link is None and alone is not None:
        link = alone[0].get(name)
    if link is None:
        return {**entry, "identifiability": identifiable, **_nothing(gap)}
    in_sample: list[FittedEffect] = []
    parts: list[FittedEffect] = []
    if in_verdict:
        in_sample = [one for links in held.links for one in links if one.effect.name == name]
        parts = [composite.get(name) for composite in named.parts]
    found = {**entry, "parameters": parameters_of(pair, link, in_sample, parts, draws), "where": _acts(pair, link)}
    if name == "gain_mismatch" and link.effect.scope == TAXEL:
        spread = _spread_of_gains(judge, link)
        found["parameters"]["log_std"] |= {"value": spread.value, "ci95": spread.ci95}
    found["model"] = model_of(judge.state, link)
    found["identifiability"] = identifiable
    found |= _nothing(gap)
    if alone is not None:  # else the effect was only fitted beside another one
        found |= _alone(judge, alone[1], gap)
    if in_verdict:
        measured = told.shrink(name)
        found["shapley_share"] = told.shapley()[name]
        found["predicted_shrink"] = float(told.promised[frozenset({name})].mean())
        found["measured_shrink"], found["measured_shrink_ci95"] = measured.value, measured.ci95
    return found


def _alone(judge: Judge, features: FloatArray, gap: Gap) -> dict[str, Any]:
    """What an effect does by itself. features: with it, f64[C, F, n]."""
    alone = shrink_by(judge.sessions, judge.state.mean, features, judge.layout)
    after = gap.gap.value * (1.0 - alone.value)
    return {"gap_after_alone": after, "shrink_alone": alone.value, "shrink_alone_ci95": alone.ci95}


def _nothing(gap: Gap) -> dict[str, Any]:
    """Of an effect that changes nothing."""
    shrinks: dict[str, Any] = {"gap_after_alone": gap.gap.value, "shrink_alone": 0.0, "shrink_alone_ci95": None}
    shrinks |= {"shapley_share": 0.0, "predicted_shrink": 0.0, "measured_shrink": 0.0, "measured_shrink_ci95": None}
    return shrinks


def parameters_of(
    pair: Pair,
    link: FittedEffect,
    in_sample: Sequence[FittedEffect] = (),
    parts: Sequence[FittedEffect] = (),
    draws: Sequence[FittedEffect] = (),
) -> dict[str, Any]:
    """Values, intervals and units; per board "name@address".

    inside: fits without each session; parts: without each part of presses and taxels; draws: as it may be as well.
    Three variances add: sessions tell what scatters, presses how far the model of the effect is right (both jackknife),
    and nothing here tells by how much the simulator is wrong in all of them alike: `COMMON_SHARE`. Where presses leave
    more open than that, as draws tell, the interval is as wide as they are.
    """
    if isinstance(link.effect, Dropout):
        return _dropped(pair, link.effect)
    values = _values(pair, link)
    left, without, drawn = ([_values(pair, one) for one in fits] for fits in (in_sample, parts, draws))
    own = APART_FRAMES * pair.frame_s if link.effect.name == "latency" else 0.0
    entries: dict[str, Any] = {}
    for label, (value, unit) in values.items():
        sessions, contacts = (
            jackknife(np.array([one[label][0] for one in known if label in one]), value) for known in (left, without)
        )
        interval = together(sessions, contacts, COMMON_SHARE * abs(value) + own)
        interval = interval.at_least(np.array([one[label][0] for one in drawn if label in one]))
        entries[label] = {"value": value, "ci95": interval.ci95, "unit": unit, "neutral": find_neutral(link, label)}
    return entries


def _values(pair: Pair, link: FittedEffect) -> dict[str, tuple[float, str]]:
    """Values and units by label: the effect's own parameters, and what is worked out from them."""
    if link.effect.name == "noise":
        return _noises(pair, link)
    if isinstance(link.effect, PoseError):
        link = FittedEffect(link.effect, link.effect.told(link.values))
    values: dict[str, tuple[float, str]] = _gains(pair, link) if link.effect.name == "gain_mismatch" else {}
    for row, parameter in enumerate(link.effect.parameters()):
        shown = _shown(pair, link, row)
        for block in _shown_blocks(link):
            values[_label(pair, link, parameter.name, block)] = (float(shown[block]), parameter.unit)
    if link.effect.name == "baseline_drift":
        values["counts"] = (_drifted(link), "counts")
    if isinstance(link.effect, Sticking):
        fraction, seconds = as_late(link.values, pair.frame_s, float(pair.clock.since_start[-1]))
        values |= {"fraction": (fraction, "1"), "seconds": (seconds, "s")}
    if isinstance(link.effect, PoseError):
        values |= _displacement(link)
    return values


def _drifted(link: FittedEffect) -> float:
    """Counts by which the board that wanders most does so in a grasp; below 0 where drops fall rather than scatter."""
    slope, scatter = link.values[:, np.hypot(link.values[0], link.values[1]).argmax()]
    size = float(np.hypot(slope, scatter))
    return -size if slope < -scatter else size


def _shown(pair: Pair, link: FittedEffect, row: int) -> FloatArray:
    """Values of a parameter. Delays are those behind the earliest boards: what all share is how clocks were aligned."""
    values: FloatArray = link.values[row]
    if not is_delay(link.effect) or len(values) < 2:
        return values
    earliest = values[values < values.min() + 0.5 * pair.frame_s]
    return np.asarray(values - earliest.mean())


def _shown_blocks(link: FittedEffect) -> range:
    return range(0) if link.effect.scope == TAXEL else range(link.values.shape[1])


def _label(pair: Pair, link: FittedEffect, name: str, block: int) -> str:
    if link.effect.scope == HAND:
        return name
    if link.effect.scope == BOARD:
        return f"{name}@{int(pair.sensors.address[block])}"
    if link.effect.scope == OBJECT:
        return f"{name}@{pair.object_names[block]}"
    return f"{name}@{block}"


def _gains(pair: Pair, link: FittedEffect) -> dict[str, tuple[float, str]]:
    """Scale of each board and spread of the taxels' gains about it."""
    logs = link.values[0][link.effect.blocks_of(pair)[0]]
    touched = logs != 0.0
    sensor = pair.groups.sensor
    scales = {}
    residual = np.zeros_like(logs)
    for board, address in enumerate(pair.sensors.address.tolist()):
        own = (sensor == board) & touched
        middle = float(np.median(logs[own])) if own.any() else 0.0
        residual[own] = logs[own] - middle
        scales[f"scale@{address}"] = (float(np.exp(middle)), "1")
    spread = float(np.std(residual[touched])) if touched.any() else 0.0
    return {"log_std": (spread, "1"), **scales}


def _spread_of_gains(judge: Judge, link: FittedEffect) -> Interval:
    """Standard deviation of the taxels' gains about their boards', by restricted maximum likelihood with its profile
    interval: a fitted gain is drawn towards 1 the more, the less is known of its taxel, and few taxels of a board
    scatter about their own mean less than about the true one.
    """
    (column,) = start_of(judge.state, CompositeModel((link,))).columns
    known = np.sum(judge.weight * column.change**2, axis=(0, 1))
    precision = float(column.precision[0])
    told = known > precision
    if told.sum() < 3:
        return Interval(0.0, None, None, None)
    logs = link.values[0, told] * (1.0 + precision / known[told])
    sensor, variance = judge.state.pair.groups.sensor[told], 1.0 / known[told]

    def unlikely(spread: float) -> float:
        """Twice the negative logarithm of the restricted likelihood (Patterson and Thompson 1971)."""
        whole = spread**2 + variance
        cost = float(np.sum(np.log(whole)))
        for board in np.unique(sensor):
            own = sensor == board
            weight = 1.0 / whole[own]
            middle = np.sum(weight * logs[own]) / weight.sum()
            cost += float(np.sum(weight * (logs[own] - middle) ** 2) + np.log(weight.sum()))
        return cost

    best = float(minimize_scalar(unlikely, bounds=(0.0, MOST_SPREAD), method="bounded").x)
    limit = unlikely(best) + chi2_quantile(0.95, 1)

    def beyond(spread: float) -> float:
        return unlikely(spread) - limit

    low = float(brentq(beyond, 0.0, best)) if beyond(0.0) > 0 else 0.0
    high = float(brentq(beyond, best, MOST_SPREAD)) if beyond(MOST_SPREAD) > 0 else MOST_SPREAD
    return Interval(best, low, high, None)


def _noises(pair: Pair, link: FittedEffect) -> dict[str, tuple[float, str]]:
    """White and common parts of the added variance; covariances of taxels on a line or board tell the common one."""
    white, *common = noise_parts(pair, link)
    values = {"common_counts": (float(np.sqrt((np.array(common) ** 2).sum(axis=0)).max()), "counts")}
    for block, value in enumerate(white.tolist()):
        values[_label(pair, link, "white_counts", block)] = (value, "counts")
    return values


def _displacement(link: FittedEffect) -> dict[str, tuple[float, str]]:
    move, turn = (np.linalg.norm(link.values[part], axis=0) for part in (slice(0, 3), slice(3, 6)))
    return {"translation_mm": (float(move.max()), "mm"), "rotation_deg": (float(turn.max()), "deg")}


def _dropped(pair: Pair, effect: Dropout) -> dict[str, Any]:
    dropped = effect.dropped
    open_lines = [(int(pair.sensors.address[board]), axis, index) for board, axis, index in dropped.lines]
    shorted = [(short.address, short.axis, short.index + step) for short in dropped.shorts for step in (0, 1)]
    lines = [*open_lines, *(line for line in shorted if line not in open_lines)]
    return {
        "taxels": {"value": np.flatnonzero(dropped.taxels).tolist(), "ci95": None, "unit": "index"},
        "lines": {
            "value": [list(line) for line in lines],
            "ci95": None,
            "unit": "address, axis, index",
        },
        "sensors": {
            "value": [int(pair.sensors.address[board]) for board in np.flatnonzero(dropped.missing > 0)],
            "ci95": None,
            "unit": "address",
        },
    }


def _acts(pair: Pair, link: FittedEffect) -> dict[str, Any]:
    """Where an effect acts, if locally."""
    if isinstance(link.effect, Dropout):
        found = _dropped(pair, link.effect)
        return {key: found[key]["value"] for key in ("sensors", "lines", "taxels")}
    return {}
