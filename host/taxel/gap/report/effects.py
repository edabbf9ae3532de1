"""What the report says of each effect: parameters with intervals, where it acts, what it takes from the gap."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from taxel.gap.attribution import Attribution
from taxel.gap.chain import Chain, Link
from taxel.gap.effects.dropout import Dropout
from taxel.gap.effects.effect import BOARD, HAND, OBJECT, TAXEL
from taxel.gap.fit import start_of
from taxel.gap.held_out import HeldOut
from taxel.gap.judge import Judge
from taxel.gap.metric import Gap, jackknife, measure, shrink_by, together
from taxel.gap.pair import Pair
from taxel.gap.report.model import model_of, noise_parts
from taxel.gap.select import Selection

Array = NDArray[np.float64]


def effect_entry(
    name: str, judge: Judge, selection: Selection, held: HeldOut, gap: Gap, told: Attribution, identifiable: str
) -> dict[str, Any]:
    """One effect that was tried."""
    pair = judge.state.pair
    first = next((trial for trial in selection.rounds[0].trials if trial.name == name), None)
    in_verdict = name in selection.names
    entry: dict[str, Any] = {"name": name, "parameters": {}, "where": {}, "in_verdict": in_verdict}
    if first is None:
        return {**entry, "identifiability": identifiable, **_nothing(gap)}
    link = first.link
    inside: list[Link] = []
    parts: list[Link] = []
    if in_verdict:
        link = next(one for one in selection.chain.links if one.effect.name == name)
        inside = [one for links in held.links for one in links if one.effect.name == name]
        parts = [one for chain in selection.parts for one in chain.links if one.effect.name == name]
    features = first.held_features if first.held_features is not None else first.features
    alone = shrink_by(judge.sessions, judge.state.mean, features, judge.layout)
    found = {**entry, "parameters": parameters_of(pair, link, inside, parts), "where": _acts(pair, link)}
    if name == "gain_mismatch" and link.effect.scope == TAXEL:
        found["parameters"]["log_std"]["value"] = _spread_of_gains(judge, link)
    found["model"] = model_of(judge.state, link)
    found["identifiability"] = identifiable
    found |= _nothing(gap)
    found["gap_after_alone"] = measure(judge.sessions, features, judge.layout).gap.value
    found["shrink_alone"], found["shrink_alone_ci95"] = alone.value, alone.ci95
    if in_verdict:
        measured = told.shrink(name)
        found["shapley_share"] = told.shapley()[name]
        found["predicted_shrink"] = float(told.promised[frozenset({name})].mean())
        found["measured_shrink"], found["measured_shrink_ci95"] = measured.value, measured.ci95
    return found


def _nothing(gap: Gap) -> dict[str, Any]:
    """Of an effect that changes nothing."""
    shrinks: dict[str, Any] = {"gap_after_alone": gap.gap.value, "shrink_alone": 0.0, "shrink_alone_ci95": None}
    shrinks |= {"shapley_share": 0.0, "predicted_shrink": 0.0, "measured_shrink": 0.0, "measured_shrink_ci95": None}
    return shrinks


def parameters_of(pair: Pair, link: Link, inside: list[Link], parts: list[Link]) -> dict[str, Any]:
    """Values, intervals and units; per board "name@address".

    inside: fits without each session; parts: without each part of presses and taxels. Jackknife variances of both add:
    sessions tell what scatters, presses how far the model of the effect is right.
    """
    if isinstance(link.effect, Dropout):
        return _dropped(pair, link.effect)
    entries: dict[str, Any] = {}
    for row, parameter in enumerate(link.effect.parameters()):
        values = _shown(pair, link, row)
        left, without = (
            np.array([_shown(pair, one, row) for one in fits]) if fits else np.zeros((0, len(values)))
            for fits in (inside, parts)
        )
        for block in _shown_blocks(link):
            label = _label(pair, link, parameter.name, block)
            interval = together(*(jackknife(own[:, block], float(values[block])) for own in (left, without)))
            entries[label] = {"value": float(values[block]), "ci95": interval.ci95, "unit": parameter.unit}
    if link.effect.name == "gain_mismatch":
        entries = {**_gains(pair, link, inside), **({} if link.effect.scope == TAXEL else entries)}
    if link.effect.name == "noise":
        return _noises(pair, link)
    if link.effect.name == "baseline_drift":
        size = np.hypot(link.values[0], link.values[1])
        entries["counts"] = {"value": float(np.max(size)), "ci95": None, "unit": "counts"}
    if link.effect.name == "pose_error":
        entries.update(_displacement(link))
    return entries


def _shown(pair: Pair, link: Link, row: int) -> Array:
    """Values of a parameter. Delays are those behind the earliest boards: what all share is how clocks were aligned."""
    values: Array = link.values[row]
    if link.effect.name != "latency" or len(values) < 2:
        return values
    earliest = values[values < values.min() + 0.5 * pair.frame_s]
    return np.asarray(values - earliest.mean())


def _shown_blocks(link: Link) -> range:
    return range(0) if link.effect.scope == TAXEL else range(link.values.shape[1])


def _label(pair: Pair, link: Link, name: str, block: int) -> str:
    if link.effect.scope == HAND:
        return name
    if link.effect.scope == BOARD:
        return f"{name}@{int(pair.sensors.address[block])}"
    if link.effect.scope == OBJECT:
        return f"{name}@{sorted({item for item, _ in pair.cells})[block]}"
    return f"{name}@{block}"


def _gains(pair: Pair, link: Link, inside: list[Link]) -> dict[str, Any]:
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
        scales[f"scale@{address}"] = {"value": float(np.exp(middle)), "ci95": None, "unit": "1"}
    spread = float(np.std(residual[touched])) if touched.any() else 0.0
    return {"log_std": {"value": spread, "ci95": None, "unit": "1"}, **scales}


def _spread_of_gains(judge: Judge, link: Link) -> float:
    """Standard deviation of the taxels' gains about their boards' by maximum likelihood: a fitted gain is drawn towards
    1 the more, the less is known of its taxel.
    """
    (column,) = start_of(judge.state, Chain((link,))).columns
    known = np.sum(judge.weight * column.change**2, axis=(0, 1))
    precision = float(column.precision[0])
    told = known > precision
    if told.sum() < 3:
        return 0.0
    logs = link.values[0, told] * (1.0 + precision / known[told])
    sensor = judge.state.pair.groups.sensor[told]
    for board in np.unique(sensor):
        logs[sensor == board] -= np.average(logs[sensor == board], weights=known[told][sensor == board])
    variance = 1.0 / known[told]

    def unlikely(spread: float) -> float:
        return float(np.sum(np.log(spread**2 + variance) + logs**2 / (spread**2 + variance)))

    return float(minimize_scalar(unlikely, bounds=(0.0, 2.0), method="bounded").x)


def _noises(pair: Pair, link: Link) -> dict[str, Any]:
    """White and common parts of the added variance; covariances of taxels on a line or board tell the common one."""
    white, *common = noise_parts(pair, link)
    together = float(np.sqrt((np.array(common) ** 2).sum(axis=0)).max())
    entries = {"common_counts": {"value": together, "ci95": None, "unit": "counts"}}
    for block, value in enumerate(white.tolist()):
        entries[_label(pair, link, "white_counts", block)] = {"value": value, "ci95": None, "unit": "counts"}
    return entries


def _displacement(link: Link) -> dict[str, Any]:
    move, turn = (np.linalg.norm(link.values[part], axis=0) for part in (slice(0, 3), slice(3, 6)))
    return {
        "translation_mm": {"value": float(move.max()), "ci95": None, "unit": "mm"},
        "rotation_deg": {"value": float(turn.max()), "ci95": None, "unit": "deg"},
    }


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


def _acts(pair: Pair, link: Link) -> dict[str, Any]:
    """Where an effect acts, if locally."""
    if isinstance(link.effect, Dropout):
        found = _dropped(pair, link.effect)
        return {key: found[key]["value"] for key in ("sensors", "lines", "taxels")}
    return {}
