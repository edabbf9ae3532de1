"""What a board answers when each taxel is pressed by itself.

`response[p, q]` is by how many counts taxel q fell while taxel p was pressed. A sound board has one diagonal; a dead
taxel a gap in it; exchanged lines put it beside; joined lines double it; crosstalk surrounds it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import combinations
from typing import Final

import numpy as np
from numpy.typing import NDArray

from taxel.hand import BoardKind
from taxel_tools.bench.analysis.fault import (
    BOARD,
    Axis,
    Fault,
    joint,
    line_name,
    lines_name,
    lines_of,
    severity_below,
    taxel_name,
)

NOISE_ERRORS: Final = 5.0
"""A usual response of fewer standard errors is none: noise alone has a largest value of two or three on any board."""
HALF: Final = 0.5
"""Of the board's usual response: a taxel with more than this has been reached by a press."""
CROSSTALK_ERRORS: Final = 4.0
"""Crosstalk is believed if it is so many times its own error: a weak response among noise has some by chance."""
DOUBLE_MIN: Final = 0.5
"""Of the pressed taxel's own response: what the same crossing of a joined line shows at least."""


@dataclass(frozen=True, eq=False)
class Presses:
    """`response` f64[taxels, taxels], counts, NaN in the rows of taxels that were not pressed; `error` f64[taxels]:
    standard error of a response at each taxel; `force_n`: of each press, NaN if nobody knows.
    """

    kind: BoardKind
    response: NDArray[np.float64]
    error: NDArray[np.float64]
    force_n: float

    @property
    def pressed(self) -> NDArray[np.int_]:
        """Taxels that were pressed."""
        return np.nonzero(np.isfinite(self.response).all(axis=1))[0]

    @property
    def own(self) -> NDArray[np.float64]:
        """What each pressed taxel itself showed, NaN elsewhere."""
        return np.asarray(np.diagonal(self.response).copy())

    @cached_property
    def usual(self) -> float:
        """Median over presses of the largest response anywhere: what a press does, whatever the order of lines."""
        pressed = self.pressed
        return float(np.median(self.response[pressed].max(axis=1))) if len(pressed) else float("nan")

    def usual_of(self, chosen: NDArray[np.bool_]) -> float:
        """Median of what chosen taxels, bool[taxels], answer to a press on them; `usual` if none was pressed."""
        own = self.own[chosen]
        own = own[np.isfinite(own)]
        return float(np.median(own)) if len(own) else self.usual

    @property
    def answers(self) -> bool:
        """Whether presses do anything at all."""
        return self.usual > NOISE_ERRORS * float(np.median(self.error))


def press_faults(presses: Presses, least_share: float) -> list[Fault]:
    """Dead taxels, broken, joined and exchanged lines; or that nothing answers at all.

    least_share: of the board's usual response, below which a taxel is called dead.
    """
    if not presses.answers:
        text = "no taxel answers a press: look whether the probe reaches the board, and at the layer"
        return [Fault("no response", BOARD, text, float("inf"))]
    explained = np.zeros(len(presses.own), dtype=bool)
    faults: list[Fault] = []
    for find in (_swapped, _joined):
        found, places = find(presses, explained)
        faults += found
        explained |= places
    dead = (presses.own < least_share * presses.usual) & ~explained
    broken, places = _open(presses, dead, least_share)
    faults += broken
    for taxel in np.nonzero(dead & ~places)[0]:
        share = float(presses.own[taxel]) / presses.usual
        crossing = f"TX {presses.kind.tx[taxel]}, RX {presses.kind.rx[taxel]}"
        text = f"answers a press with {max(share, 0.0):.0%} of what the others do: look at the layer over {crossing}"
        faults.append(Fault("dead taxel", taxel_name(int(taxel)), text, severity_below(share, least_share)))
    return faults


def _partners(kind: BoardKind, axis: Axis, first: int, second: int) -> list[tuple[int, int]]:
    """Taxels of two lines at the same crossing line, in pairs."""
    lines, others = lines_of(kind, axis), lines_of(kind, Axis(1 - axis))
    place = {(int(line), int(other)): taxel for taxel, (line, other) in enumerate(zip(lines, others, strict=True))}
    count = len(kind.crossings[0]) if axis is Axis.TX else len(kind.crossings)
    return [
        (place[first, other], place[second, other])
        for other in range(count)
        if (first, other) in place and (second, other) in place
    ]


def _known(presses: Presses, pairs: list[tuple[int, int]]) -> list[tuple[int, int]]:
    pressed = set(presses.pressed.tolist())
    both = [(pressed_one, other) for pair in pairs for pressed_one, other in (pair, pair[::-1])]
    return [(one, other) for one, other in both if one in pressed]


def _swapped(presses: Presses, explained: NDArray[np.bool_]) -> tuple[list[Fault], NDArray[np.bool_]]:
    """Presses on one line that arrive on another one, both ways."""
    kind, response, usual = presses.kind, presses.response, presses.usual
    found: list[Fault] = []
    places = np.zeros(len(explained), dtype=bool)
    for axis in Axis:
        lines = lines_of(kind, axis)
        for first, second in combinations(range(int(lines.max()) + 1), 2):
            known = _known(presses, _partners(kind, axis, first, second))
            if not known:
                continue
            crossed = [
                response[one, other] > HALF * usual and response[one, one] < HALF * response[one, other]
                for one, other in known
            ]
            if np.mean(crossed) <= HALF:
                continue
            places |= (lines == first) | (lines == second)
            joints = " and ".join(joint(axis, line, kind.tx_count) for line in (first, second))
            text = f"a press on one arrives on the other: look whether {joints} are exchanged"
            found.append(Fault("swapped lines", lines_name(axis, first, second), text, float("inf")))
    return found, places


def _joined(presses: Presses, explained: NDArray[np.bool_]) -> tuple[list[Fault], NDArray[np.bool_]]:
    """Presses on a line that show on its neighbour as well."""
    kind, response = presses.kind, presses.response
    found: list[Fault] = []
    places = np.zeros(len(explained), dtype=bool)
    for axis in Axis:
        lines = lines_of(kind, axis)
        for index in range(int(lines.max())):
            known = _known(presses, _partners(kind, axis, index, index + 1))
            known = [
                pair for pair in known if not explained[pair[0]] and response[pair] > 10.0 * presses.error[pair[1]]
            ]
            if not known:
                continue
            shares = [response[one, other] / max(response[one, one], 1.0) for one, other in known]
            if np.median(shares) < DOUBLE_MIN:
                continue
            places |= (lines == index) | (lines == index + 1)
            joints = " and ".join(joint(axis, line, kind.tx_count) for line in (index, index + 1))
            text = f"a press on one shows on both ({np.median(shares):.0%}): look between {joints}"
            found.append(
                Fault("short", lines_name(axis, index, index + 1), text, float(np.median(shares)) / DOUBLE_MIN)
            )
    return found, places


def _open(presses: Presses, dead: NDArray[np.bool_], least_share: float) -> tuple[list[Fault], NDArray[np.bool_]]:
    """Lines on which nothing answers: of two taxels at least, since a single one is called a dead taxel."""
    places = np.zeros(len(dead), dtype=bool)
    known = np.isfinite(presses.own)
    whole = []
    for axis in Axis:
        lines = lines_of(presses.kind, axis)
        for index in np.unique(lines):
            on_line = (lines == index) & known
            if on_line.sum() >= 2 and dead[on_line].all():
                whole.append((int(on_line.sum()), axis, int(index), on_line))
    found = []
    for _, axis, index, on_line in sorted(whole, key=lambda one: -one[0]):
        if not (on_line & ~places).any():
            continue
        places |= on_line
        share = float(np.median(presses.own[on_line])) / presses.usual
        where = joint(axis, index, presses.kind.tx_count)
        text = f"no taxel on it answers a press ({max(share, 0.0):.0%}): look at {where} and its trace"
        found.append(Fault("open line", line_name(axis, index), text, severity_below(share, least_share)))
    return found, places


@dataclass(frozen=True)
class Crosstalk:
    """Mean response beside the pressed taxel, over the pressed taxel's own.

    `where`: along or between which lines; `share`: -1 to 1; `error`: its standard error, from the spread over presses.
    """

    where: str
    share: float
    error: float

    @property
    def is_sure(self) -> bool:
        """Whether it is more than chance."""
        return abs(self.share) > CROSSTALK_ERRORS * self.error


def crosstalk(presses: Presses, ignored: NDArray[np.bool_]) -> list[Crosstalk]:
    """Crosstalk of a board along its lines and between neighbouring ones, the largest first.

    ignored: bool[taxels], taxels that a fault has explained already. What cannot be told from two presses is left out.
    """
    tx, rx = presses.kind.tx.astype(int), presses.kind.rx.astype(int)
    shares: dict[str, list[float]] = {}
    for one in presses.pressed:
        own = presses.response[one, one]
        if ignored[one] or own < HALF * presses.usual:
            continue
        row = np.where(ignored, np.nan, presses.response[one] / own)
        row[one] = np.nan
        masks = {
            "along TX lines": (tx == tx[one]) & (np.abs(rx - rx[one]) > 1),
            "along RX lines": (rx == rx[one]) & (np.abs(tx - tx[one]) > 1),
            "between TX lines": (np.abs(tx - tx[one]) == 1) & (rx == rx[one]),
            "between RX lines": (np.abs(rx - rx[one]) == 1) & (tx == tx[one]),
        }
        for where, mask in masks.items():
            values = row[mask & np.isfinite(row)]
            if len(values):
                shares.setdefault(where, []).append(float(values.mean()))
    found = [
        Crosstalk(where, float(np.mean(values)), float(np.std(values, ddof=1) / np.sqrt(len(values))))
        for where, values in shares.items()
        if len(values) > 1
    ]
    return sorted(found, key=lambda one: -abs(one.share))


def gain_fault(presses: Presses, usual: float, least: float, most: float) -> Fault | None:
    """Low or high gain of the whole board. usual: counts by which a press lowers a sound taxel; least, most: what is
    right. None if it lies between, or no force is known.
    """
    if not np.isfinite(presses.force_n) or least <= usual <= most:
        return None
    name, severity = ("low gain", severity_below(usual, least)) if usual < least else ("high gain", usual / most)
    text = (
        f"a press of {presses.force_n:g} N lowers a count by {usual:.0f}, {least:g} to {most:g} is right: look at the "
        "current source's code, and whether the layer lies on the electrodes"
    )
    return Fault(name, BOARD, text, severity)
