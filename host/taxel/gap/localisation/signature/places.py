"""Where a residual lies: taxels, lines or boards that are wrong wherever they are pressed while others are not."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from taxel.gap.data.lacking import LINES
from taxel.gap.data.pair import Pair
from taxel.gap.features.features import mean_product
from taxel.gap.localisation.signature.fit import Remainder, p_value
from taxel.gap.localisation.signature.shapes import BOARD, COLUMN, HAND, ROW, TAXEL, groups
from taxel.types import FloatArray

MOST: Final = {TAXEL: 3, ROW: 2, COLUMN: 2, BOARD: 2}
"""Places that are named together: two lines that changed places, a few taxels."""

LEAST_SHARE: Final = 0.15
"""Of the excess, that a place must hold to stand out."""

TIMES: Final = 3.0
"""How often what its drop alone would give it."""

THROUGHOUT: Final = 0.6
"""Share of the place's drop, squared, that is as wrong: in each of its taxels and cells."""


@dataclass(frozen=True, eq=False)
class Spot:
    """Places that stand out. numbers: of the groups; gram: f64[S, S], their residual; alone: pressed in one cell."""

    scope: str
    numbers: tuple[int, ...]
    taxels: FloatArray
    gram: FloatArray
    p_value: float | None
    alone: bool


def energy(left: Remainder, model: FloatArray, bins: int) -> FloatArray:
    """Squared drops, predicted and found, as they count, f64[C, n]."""
    known = left.known[:, :, :bins].any(axis=1)
    count = np.maximum(left.known[:, :, :bins].sum(axis=1), 1)
    found = left.residual[:, :, :bins].sum(axis=1) / count + np.nan_to_num(model[:, :bins])
    squares = np.where(known, np.nan_to_num(model[:, :bins]) ** 2 + found**2, 0.0)
    return np.asarray((squares * left.root[:bins] ** 2).sum(axis=1))


def spots(left: Remainder, model: FloatArray, bins: int) -> list[Spot]:
    """What stands out, one for each kind of place at most."""
    scaled = left.residual[:, :, :bins] * left.root[:bins]
    excess = _excess(scaled, left.known[:, :, :bins].sum(axis=1))
    whole, pressed = float(excess.sum()), energy(left, model, bins)
    if whole <= 0:
        return []
    places = (TAXEL, BOARD) if LINES in left.pair.lacking else tuple(MOST)
    found = [_spot(left, place, scaled, excess, pressed) for place in places]
    return [spot for spot in found if spot is not None]


def _excess(scaled: FloatArray, count: NDArray[np.intp]) -> FloatArray:
    """Of each cell and taxel, f64[C, n]. scaled: f64[C, S, B, n]. count: [C, B, n], sessions that know it."""
    squares = np.square(scaled).sum(axis=1)
    if scaled.shape[1] < 2:
        return np.asarray(squares.sum(axis=1))
    return np.asarray(mean_product(scaled.sum(axis=1), squares, count).sum(axis=1))


def _spot(left: Remainder, scope: str, scaled: FloatArray, excess: FloatArray, pressed: FloatArray) -> Spot | None:
    group = groups(left.pair, scope)
    count = int(group.max()) + 1
    own = np.bincount(group, excess.sum(axis=0), count) / excess.sum()
    expected = np.bincount(group, pressed.sum(axis=0), count) / max(float(pressed.sum()), 1e-30)
    chosen = []
    for number in np.argsort(-own)[: MOST[scope]]:
        taxels = np.flatnonzero(group == number)
        stands_out = own[number] >= max(LEAST_SHARE, TIMES * expected[number])
        if stands_out and (scope == TAXEL or _throughout(excess[:, taxels], pressed[:, taxels])):
            chosen.append(int(number))
    if not chosen:
        return None
    here = np.isin(group, chosen)
    gram = left.even(np.einsum("csfn,ctfn->st", scaled[..., here], scaled[..., here], optimize=True))
    p = p_value(gram)
    conditions = pressed[:, here].sum(axis=1)
    alone = bool((conditions > 0.1 * conditions.max()).sum() == 1)
    searched = None if p is None else min(1.0, p * count)
    return Spot(scope, tuple(chosen), np.where(here, excess.sum(axis=0), 0.0), gram, searched, alone)


def _throughout(excess: FloatArray, pressed: FloatArray) -> bool:
    """Whether the residual is about as large a part of the drop in every taxel and cell, f64[C, m]."""
    whole = float(pressed.sum())
    if whole <= 0:
        return False
    wrong = excess >= 0.25 * float(excess.sum()) / whole * pressed
    touched = pressed.sum(axis=0) > 0.05 * whole
    return bool(touched.sum() >= 2 and pressed[wrong].sum() >= THROUGHOUT * whole)


def located(pair: Pair, taxels: FloatArray, pressed: FloatArray, scope: str) -> tuple[str, list[tuple[int, float]]]:
    """Where most of what a distortion tells lies: the kind of place, and numbers with shares of it, largest first.

    taxels: f64[n], told of the excess. pressed: f64[n], squared drops. scope: of the fitted numbers; of one for the
    whole hand the place is found here: lines, boards, or the hand where it follows the drop.
    """
    if scope != HAND:
        return scope, _largest(taxels, groups(pair, scope), 0.1)
    for place in (BOARD,) if LINES in pair.lacking else (ROW, COLUMN, BOARD):
        group = groups(pair, place)
        share, expected = (_shares(np.bincount(group, part).astype(np.float64)) for part in (taxels, pressed))
        top = np.argsort(-share)[: MOST[place]]
        top = top[share[top] >= LEAST_SHARE]
        times = TIMES if place != BOARD else 1.5
        if share[top].sum() >= THROUGHOUT and share[top].sum() >= times * expected[top].sum():
            return place, [(int(k), float(share[k])) for k in top]
    return HAND, []


def _largest(taxels: FloatArray, group: NDArray[np.intp], least: float) -> list[tuple[int, float]]:
    share = _shares(np.bincount(group, taxels).astype(np.float64))
    order = np.argsort(-share, kind="stable")[:6]
    return [(int(k), float(share[k])) for k in order if share[k] >= least]


def _shares(values: FloatArray) -> FloatArray:
    """Of what is above 0."""
    positive = np.maximum(values, 0.0)
    return np.asarray(positive / max(float(positive.sum()), 1e-30))


def place_entry(pair: Pair, scope: str, number: int, share: float) -> dict[str, Any]:
    """A place as the report has it."""
    if scope == TAXEL:
        return {"index": number, "share": share}
    first = int(np.flatnonzero(groups(pair, scope) == number)[0])
    address = int(pair.taxels.sensor[first])
    if scope == BOARD:
        return {"address": address, "name": pair.sensors.name[int(pair.groups.sensor[first])], "share": share}
    axis, lines = ("tx", pair.taxels.tx) if scope == ROW else ("rx", pair.taxels.rx)
    return {"address": address, "axis": axis, "index": int(lines[first]), "share": share}


def place_words(pair: Pair, scope: str, number: int) -> str:
    """A place in a sentence."""
    first = int(np.flatnonzero(groups(pair, scope) == number)[0])
    board = pair.sensors.name[int(pair.groups.sensor[first])].replace("_", " ")
    tx, rx = int(pair.taxels.tx[first]), int(pair.taxels.rx[first])
    return {
        BOARD: board,
        ROW: f"TX line {tx} of {board}",
        COLUMN: f"RX line {rx} of {board}",
        TAXEL: f"taxel TX {tx}, RX {rx} of {board}",
    }[scope]
