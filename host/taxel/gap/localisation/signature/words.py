"""A distortion in a sentence of words: which way it goes, how far, and where."""

from __future__ import annotations

from typing import Final

import numpy as np

from taxel.gap.data.pair import Pair
from taxel.gap.features.features import Layout
from taxel.gap.localisation.signature.contacts import Change
from taxel.gap.localisation.signature.fit import Told
from taxel.gap.localisation.signature.places import Spot, place_words
from taxel.gap.localisation.signature.shapes import BOARD, COLUMN, HAND, ROW, TAXEL, bends
from taxel.recording.grasp_format import Phase
from taxel.types import FloatArray

MOST_NAMED: Final = 3
"""Places in the sentence; the list has all."""

ONE_WAY: Final = 0.15
"""A value of the curve below this part of its largest has no sign of its own."""

LINES: Final = {ROW: "TX line", COLUMN: "RX line"}


def shape_words(
    pair: Pair, layout: Layout, told: Told | None, spot: Spot | None, model: FloatArray, scope: str, places: list[int]
) -> str:
    """What a distortion does, and where. places: numbers of the groups of `scope`, the largest first."""
    found = told is not None and told.scope != scope
    here = _here(pair, scope, places, ", mostly on " if found else ", on ")
    if spot is not None:
        often = "in the only condition that loads this location" if spot.alone else "in every condition that loads it"
        return f"local deviation{here}: present {often}, absent elsewhere"
    assert told is not None
    numbers = told.numbers[_group(told, scope, places)]
    match told.shape:
        case "amplitude":
            words = _amplitude(numbers, bends(np.nan_to_num(model[:, : layout.bins])))
        case "lag":
            words = f"the signal of the hand is {abs(numbers[0]):.2g} s {'later' if numbers[0] > 0 else 'earlier'}"
        case "history":
            words = _history(numbers, layout)
        case "radial":
            words = f"the contact area is {'wider' if numbers[2:].sum() > 0 else 'narrower'} than predicted"
        case "shift":
            words = "the contact area is displaced from its predicted position"
        case "common":
            words = _common(numbers)
        case "noise" | "missing" | "wander":
            words = _besides(told.shape, numbers)
        case _:
            words = _fixed(told, numbers, pair, scope, places)
    return words + here


def change_words(pair: Pair, change: Change) -> str:
    """A change over sessions or presses."""
    size, boards = f"{100 * abs(change.size):.1f} %", [pair.sensors.name[k].replace("_", " ") for k in change.boards]
    place = f", mostly on {boards[0]}" if boards and len(boards) < len(pair.sensors.name) else ""
    if change.name == "presses":
        way = "increases" if change.size > 0 else "decreases"
        return f"the sensitivity {way} by {size} from the first to the last grasp of a session{place}"
    steady = ""
    if change.trend:
        steady = ", increasing" if change.size > 0 else ", decreasing"
        steady += " from session to session"
    return f"the sensitivity differs between sessions by {size} (standard deviation){steady}{place}"


def sum_words(parts: list[str]) -> str:
    """Clauses as one sentence."""
    return "; in addition, ".join(part for part in parts if part)


def _here(pair: Pair, scope: str, places: list[int], on: str) -> str:
    if scope == HAND or not places:
        return ", on all boards" if len(pair.sensors.name) > 1 else ""
    names = [place_words(pair, scope, k) for k in places[:MOST_NAMED]]
    if len(places) > MOST_NAMED:
        names.append(f"{len(places) - MOST_NAMED} more")
    return on + (f"{', '.join(names[:-1])} and {names[-1]}" if len(names) > 1 else names[0])


def _group(told: Told, scope: str, places: list[int]) -> int:
    """The group whose numbers are told: that of the first place."""
    if told.scope == HAND or not places or told.scope != scope:
        return 0
    return places[0]


def _besides(name: str, numbers: FloatArray) -> str:
    """Noise, missing frames and wander."""
    value = _strongest(numbers)
    if name == "noise":
        return f"the noise of the hand is {'larger' if value > 0 else 'smaller'} by {abs(value):.3g} counts"
    if name == "missing":
        return f"{'more' if value > 0 else 'fewer'} frames are missing ({100 * abs(value):.1f} %)"
    return f"unloaded taxels drift by {abs(value):.3g} counts {'more' if value > 0 else 'less'} after the release"


def _amplitude(numbers: FloatArray, knots: FloatArray) -> str:
    """A curve over the drop, given at its knots: a line through 0, or one that bends."""
    line = float(numbers @ knots / (knots @ knots))
    largest = float(np.abs(numbers).max())
    if largest <= 0:
        return "nonlinear in the signal"
    if np.abs(numbers - line * knots).max() < ONE_WAY * largest:
        way = "more" if line > 0 else "less"
        return f"proportional to the signal: the hand has {100 * abs(line):.0f} % {way} signal"
    signs = np.sign(np.where(np.abs(numbers) < ONE_WAY * largest, 0.0, numbers))
    high = _too(float(numbers[-1]), float(knots[-1])) if signs[-1] else "no deviation at the largest signal"
    if signs[-1] == 0 or (signs[:-1] * signs[-1] < 0).any():
        other = np.where(signs[:-1] * signs[-1] < 0, np.abs(numbers[:-1]), 0.0) if signs[-1] else np.abs(numbers[:-1])
        k = int(other.argmax())
        return f"nonlinear in the signal: {_too(float(numbers[k]), float(knots[k]))}, {high}"
    slopes = np.diff(np.concatenate([[0.0], numbers])) / np.diff(np.concatenate([[0.0], knots]))
    bend = int(np.abs(np.diff(slopes)).argmax())
    return f"grows with the signal, with a bend at {knots[bend]:.0f} counts: {high}"


def _too(counts: float, signal_counts: float) -> str:
    way = "above" if counts > 0 else "below"
    return f"the signal of the hand is {abs(counts):.0f} counts {way} a predicted signal of {signal_counts:.0f} counts"


def _history(numbers: FloatArray, layout: Layout) -> str:
    bins = layout.phase[: layout.bins]
    later = bins[np.isin(bins, [Phase.RELEASE, Phase.RECOVERY])]
    parts = [
        f"{100 * abs(value):.1f} % of the hold signal {'more' if value > 0 else 'less'} than predicted in {name}"
        for phase, name in ((Phase.RELEASE, "release"), (Phase.RECOVERY, "recovery"))
        for value in [_strongest(numbers[later == phase])]
        if value != 0.0
    ]
    return (
        f"the signal decays too slowly after a load: {', '.join(parts)}"
        if numbers.sum() > 0
        else f"the signal decays too fast after a load: {', '.join(parts)}"
    )


def _strongest(values: FloatArray) -> float:
    return float(values[np.abs(values).argmax()]) if len(values) else 0.0


def _common(numbers: FloatArray) -> str:
    sign = "positive" if numbers.sum() > 0 else "negative"
    what = "the hand" if abs(numbers[0]) > abs(numbers[1]) else "their board"
    return f"all taxels, loaded or not, have a {sign} signal that grows with the total load of {what}"


def _fixed(told: Told, numbers: FloatArray, pair: Pair, scope: str, places: list[int]) -> str:
    """Own factor and offset; a line that shows what another should."""
    if told.shape in (BOARD, TAXEL) or numbers.shape[-1] == 2:
        factor, offset = (float(value) for value in numbers)
        parts = [f"{100 * abs(factor):.0f} % {'more' if factor > 0 else 'less'} signal"] if abs(factor) >= 0.005 else []
        parts += [f"an offset of {offset:+.0f} counts"] if abs(offset) >= 1.0 else []
        return f"the same in every condition: {' and '.join(parts) or 'a negligible deviation'}"
    group = {ROW: pair.groups.tx, COLUMN: pair.groups.rx}[told.shape]
    if not places:
        return "the same in every condition, for each line"
    board = pair.groups.sensor[np.flatnonzero(group == places[0])[0]]
    first = int(group[pair.groups.sensor == board].min())
    own, others = float(numbers[places[0] - first]), numbers[:-1].copy()
    others[places[0] - first] = 0.0
    most = int(np.abs(others).argmax())
    if own < -0.5 and others[most] > 0.5:
        return f"a {LINES[scope]} shows the signal of another line: {place_words(pair, scope, first + most)}"
    if np.abs(others).max() > abs(own):
        if abs(others[most]) > 1.0:  # beside a line that hardly drops a share says nothing
            return f"{LINES[scope]}s show the signal of other lines"
        return f"{LINES[scope]}s have {100 * others[most]:+.0f} % of the signal of other lines"
    way = "more" if own > 0 else "less"
    return f"the same in every condition, by {LINES[scope]}s: {100 * abs(own):.0f} % {way} signal"
