"""Generic distortions: what a residual could look like if its cause is in no catalogue, as a few columns each.

A column is built from what the model predicts and from where the taxels lie, never from the real data: so a fit of
columns to one session's residual is linear in it, and products of different sessions' fits hold no scatter.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from taxel.gap.data.lacking import LINES
from taxel.gap.data.pair import Pair
from taxel.gap.features.features import COUNTS_MISSING, COUNTS_PER_SECOND, Layout
from taxel.recording.grasp_format import Phase
from taxel.types import FloatArray

HAND, BOARD, ROW, COLUMN, TAXEL = "hand", "board", "row", "column", "taxel"
EVERY_SCOPE: Final = (HAND, BOARD, ROW, COLUMN, TAXEL)

BENDS: Final = (0.125, 0.25, 0.5, 1.0)
"""Where the curve over the predicted drop may bend, shares of the largest one."""

RADII: Final = (0.0, 0.7, 1.4, 2.1, 3.0)
"""The same over the distance from the pressed patch's middle, in RMS radii of the patch."""

MOST_LINES: Final = 24
"""Lines on a board of which each may show a part of every other."""

TOUCHED_COUNTS: Final = 300.0
"""Sum of a board's predicted drops in hold above which its onset tells a time."""


@dataclass(frozen=True, eq=False)
class Shape:
    """A distortion. features: [P], those that it speaks of. columns: f64[C, n, P, K], counts. scopes: over which taxels
    its K numbers may be common.
    """

    name: str
    features: NDArray[np.intp]
    columns: FloatArray
    scopes: tuple[str, ...]


def groups(pair: Pair, scope: str) -> NDArray[np.intp]:
    """Number of each taxel's group, [n]."""
    if scope == HAND:
        return np.zeros(pair.n, np.intp)
    if scope == TAXEL:
        return np.arange(pair.n)
    return {BOARD: pair.groups.sensor, ROW: pair.groups.tx, COLUMN: pair.groups.rx}[scope]


def shapes(pair: Pair, layout: Layout, model: FloatArray) -> Iterator[Shape]:
    """The bank, one after another. model: f64[C, F, n], features after the best set of effects; NaN where unknown."""
    model = np.nan_to_num(model)
    bins = np.arange(layout.bins)
    signal_counts = np.ascontiguousarray(np.moveaxis(model[:, : layout.bins], 2, 1))  # [C, n, B]
    hold = signal_counts[:, :, pair.clock.bins_of(Phase.HOLD)[0]]
    own = np.stack([signal_counts, np.ones_like(signal_counts)], axis=-1)
    has_lines = LINES not in pair.lacking
    scopes = EVERY_SCOPE if has_lines else (HAND, BOARD, TAXEL)
    yield Shape("amplitude", bins, _over_drop(signal_counts), scopes)
    yield _lag(pair, layout, signal_counts, hold)
    later = np.flatnonzero(np.isin(layout.phase[: layout.bins], [Phase.RELEASE, Phase.RECOVERY]))
    if len(later):
        each = np.broadcast_to(np.eye(len(later)), (*hold.shape, len(later), len(later)))
        yield Shape("history", later, hold[:, :, None, None] * each, scopes)
    grid = Grid(pair)
    yield Shape("radial", bins, _over_radius(pair, grid, signal_counts, hold), (HAND, BOARD))
    yield Shape("shift", bins, grid.slopes(signal_counts), (BOARD,))
    yield Shape("common", bins, _over_sums(pair, signal_counts), (HAND, BOARD))
    yield Shape("board", bins, own, (BOARD,))
    if has_lines:
        yield Shape("row", bins, grid.mixed(signal_counts, pair.groups.tx, pair.groups.rx), (ROW,))
        yield Shape("column", bins, grid.mixed(signal_counts, pair.groups.rx, pair.groups.tx), (COLUMN,))
    yield Shape("taxel", bins, own, (TAXEL,))
    noise = np.broadcast_to(np.eye(2), (*hold.shape, 2, 2))
    yield Shape("noise", np.arange(layout.noise.start, layout.noise.stop), noise, scopes)
    for name, feature, unit in (("missing", layout.missing, COUNTS_MISSING), ("wander", layout.drift_residual, 1.0)):
        yield Shape(name, np.array([feature]), np.full((*hold.shape, 1, 1), unit), (HAND, BOARD))


def bends(signal_counts: FloatArray) -> FloatArray:
    """Counts at which the curve over the predicted drop may bend, f64[K]."""
    return np.array(BENDS) * max(float(signal_counts.max(initial=0.0)), 1.0)


def _hats(values: FloatArray, knots: FloatArray) -> FloatArray:
    """Triangles around each knot, f64[..., K]; the last one goes on for ever, the first one falls to 0 at 0."""
    edges = np.concatenate([[0.0], knots]) if knots[0] > 0 else knots
    height = np.eye(len(edges))[:, len(edges) - len(knots) :]
    return np.stack([np.interp(values, edges, height[:, k]) for k in range(len(knots))], axis=-1)


def _over_drop(signal_counts: FloatArray) -> FloatArray:
    """A curve over the predicted drop that is 0 at 0, f64[C, n, B, K]: counts at each bend."""
    return _hats(np.maximum(signal_counts, 0.0), bends(signal_counts))


def _lag(pair: Pair, layout: Layout, signal_counts: FloatArray, hold: FloatArray) -> Shape:
    """What a second's delay would do to first order, f64[C, n, B + 1, 1]."""
    clock = pair.clock.of_bins
    edges = np.empty((*signal_counts.shape[:2], layout.bins + 1))
    edges[..., 1:-1] = 0.5 * (signal_counts[..., 1:] + signal_counts[..., :-1])
    edges[..., 0] = signal_counts[..., 0] - np.diff(signal_counts[..., :2], axis=-1).sum(axis=-1) / 2.0
    edges[..., -1] = signal_counts[..., -1] + np.diff(signal_counts[..., -2:], axis=-1).sum(axis=-1) / 2.0
    for k in np.flatnonzero(layout.phase[: layout.bins] == Phase.HOLD):
        edges[..., k : k + 2] = signal_counts[..., k, None]  # hold is flat up to its ends
    columns = np.empty((*signal_counts.shape[:2], layout.bins + 1, 1))
    columns[..., :-1, 0] = -np.diff(edges, axis=-1) / (clock.end - clock.begin)
    sensor = pair.groups.sensor
    level = np.stack([np.bincount(sensor, condition, len(pair.sensors.address)) for condition in hold])
    columns[..., -1, 0] = np.where(level > TOUCHED_COUNTS, COUNTS_PER_SECOND, 0.0)[:, sensor]
    return Shape("lag", np.append(np.arange(layout.bins), layout.onset), columns, (HAND, BOARD))


def _over_radius(pair: Pair, grid: Grid, signal_counts: FloatArray, hold: FloatArray) -> FloatArray:
    """A curve over the distance from the patch's middle, times the board's largest drop; and how much sharper than its
    neighbours a taxel is: f64[C, n, B, K + 1].
    """
    level, radius = np.zeros_like(signal_counts), np.zeros_like(hold)
    for board in range(len(pair.sensors.address)):
        own = np.flatnonzero(pair.groups.sensor == board)
        if not len(own):
            continue
        place, weight = pair.taxels.position[own], np.maximum(hold[:, own], 0.0) ** 2
        total = weight.sum(axis=1, keepdims=True)
        share = weight / np.where(total > 0, total, 1.0)
        apart = np.linalg.norm(place - (share @ place)[:, None], axis=2)
        width = np.sqrt((share * apart**2).sum(axis=1, keepdims=True))
        radius[:, own] = apart / np.maximum(width, 0.5 * float(pair.taxels.size[own].mean()))
        level[:, own] = signal_counts[:, own].max(axis=1, keepdims=True)
    rings = _hats(radius, np.array(RADII))[:, :, None] * level[..., None]
    return np.concatenate([rings, grid.sharpness(signal_counts)[..., None]], axis=-1)


def _over_sums(pair: Pair, signal_counts: FloatArray) -> FloatArray:
    """What all taxels would do together as the hand, or as their board, is pressed: mean drops, f64[C, n, B, 2]."""
    sensor = pair.groups.sensor
    own = (sensor == np.arange(len(pair.sensors.address))[:, None]).astype(np.float64)
    means = np.einsum("gn,cnb->cgb", own / np.maximum(own.sum(axis=1, keepdims=True), 1.0), signal_counts)
    hand = np.broadcast_to(signal_counts.mean(axis=1, keepdims=True), signal_counts.shape)
    return np.stack([hand, means[:, sensor]], axis=-1)


class Grid:
    """Taxels as crossings of lines. sides: on each axis the neighbours before and after a taxel, [n]; n for none."""

    def __init__(self, pair: Pair) -> None:
        self.sensor = pair.groups.sensor
        keys = [tuple(key) for key in np.column_stack([self.sensor, pair.taxels.tx, pair.taxels.rx]).tolist()]
        known = {key: k for k, key in enumerate(keys)}

        def beside(tx: int, rx: int) -> NDArray[np.intp]:
            return np.array([known.get((s, t + tx, r + rx), len(keys)) for s, t, r in keys], np.intp)

        self.sides = ((beside(-1, 0), beside(1, 0)), (beside(0, -1), beside(0, 1)))

    def sharpness(self, signal_counts: FloatArray) -> FloatArray:
        """Mean of the neighbours less the taxel's own drop, f64[C, n, B]."""
        padded = _padded(signal_counts)
        there = [side < signal_counts.shape[1] for pair in self.sides for side in pair]
        total = np.sum([padded[:, side] for pair in self.sides for side in pair], axis=0)
        count = np.maximum(np.sum(there, axis=0), 1)[:, None]
        return np.asarray(total / count - signal_counts)

    def slopes(self, signal_counts: FloatArray) -> FloatArray:
        """Half the difference of the neighbours on each axis, f64[C, n, B, 2]; an edge is its own neighbour."""
        padded, parts = _padded(signal_counts), []
        for before, after in self.sides:
            ends = [
                np.where((side < signal_counts.shape[1])[:, None], padded[:, side], signal_counts)
                for side in (before, after)
            ]
            parts.append(0.5 * (ends[1] - ends[0]))
        return np.stack(parts, axis=-1)

    def mixed(self, signal_counts: FloatArray, along: NDArray[np.intp], across: NDArray[np.intp]) -> FloatArray:
        """What the board's lines `along` drop at the same line `across`, each a column, and a constant,
        f64[C, n, B, K + 1]: a line that shows part of another, or of itself. On a board of many lines only itself.

        along, across: [n], number of each taxel's line in all boards.
        """
        first = np.full(int(self.sensor.max()) + 1, len(along))
        np.minimum.at(first, self.sensor, along)
        line = along - first[self.sensor]
        count = int(line.max(initial=0)) + 1
        if count > MOST_LINES:
            return np.stack([signal_counts, np.ones_like(signal_counts)], axis=-1)
        padded, columns = _padded(signal_counts), np.ones((*signal_counts.shape, count + 1))
        for number in range(count):
            on = {int(across[k]): int(k) for k in np.flatnonzero(line == number)}
            columns[..., number] = padded[:, np.array([on.get(int(other), len(along)) for other in across], np.intp)]
        return columns


def _padded(signal_counts: FloatArray) -> FloatArray:
    """One taxel more that never drops."""
    return np.concatenate([signal_counts, np.zeros_like(signal_counts[:, :1])], axis=1)
