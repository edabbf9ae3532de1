"""Generic distortions: possible descriptions of a remainder whose cause is not in the catalogue of effects.

Each distortion is a linear combination of a few columns. The columns follow from the predicted signals and from the
positions of the taxels, never from the real data. A fit of the columns to the residual of one session is therefore
linear in this residual, and products of the fits of different sessions contain no variance between sessions.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from taxel.gap.data.missing_inputs import LINES
from taxel.gap.data.pair import Pair
from taxel.gap.features.features import COUNTS_MISSING, COUNTS_PER_SECOND, FeatureLayout
from taxel.recording.grasp_format import Phase
from taxel.types import FloatArray

HAND, BOARD, ROW, COLUMN, TAXEL = "hand", "board", "row", "column", "taxel"
EVERY_SCOPE: Final = (HAND, BOARD, ROW, COLUMN, TAXEL)
"""Scopes: kinds of groups of taxels. ROW: the taxels of a TX line. COLUMN: the taxels of an RX line."""

SIGNAL_KNOTS: Final = (0.125, 0.25, 0.5, 1.0)
"""Knots of the curve over the predicted signal, as shares of the largest predicted signal. Chosen: each knot is twice
the previous one."""

RADIUS_KNOTS: Final = (0.0, 0.7, 1.4, 2.1, 3.0)
"""Knots of the curve over the distance from the centre of the contact area, in RMS radii of this area. Chosen."""

MAX_LINES: Final = 24
"""Largest number of lines on one axis of a board for which every line has a column. Chosen: limits the number of
coefficients. Above it, a line has only a factor and an offset of its own."""

ONSET_COUNTS: Final = 300.0
"""Sum of the predicted signals of a board in hold, counts, above which a delay changes the onset of this board. Equal
to `taxel.gap.data.reading.MIN_ONSET_COUNTS`, the smallest sum at which a board has an onset."""


@dataclass(frozen=True, eq=False)
class Distortion:
    """A distortion as a linear combination of K columns.

    name: name in the report. features: [P], indices of the P features that the distortion changes. columns: f64[C, n,
    P, K] (C conditions, n taxels), change of these features in counts for a coefficient of 1. scopes: kinds of groups
    of taxels (whole hand, boards, lines, single taxels) for which the distortion is fitted; the taxels of a group share
    K coefficients.
    """

    name: str
    features: NDArray[np.intp]
    columns: FloatArray
    scopes: tuple[str, ...]


def get_groups(pair: Pair, scope: str) -> NDArray[np.intp]:
    """Return the number, from 0, of the group to which each taxel belongs, [n] (n taxels).

    scope: kind of group: `HAND` (one group), `BOARD`, `ROW` (TX line), `COLUMN` (RX line), or `TAXEL` (one group for
    each taxel).
    """
    if scope == HAND:
        return np.zeros(pair.n, np.intp)
    if scope == TAXEL:
        return np.arange(pair.n)
    return {BOARD: pair.groups.sensor, ROW: pair.groups.tx, COLUMN: pair.groups.rx}[scope]


def generate_distortions(pair: Pair, layout: FeatureLayout, model: FloatArray) -> Iterator[Distortion]:
    """Generate all generic distortions, each with the columns whose linear combinations describe it.

    Meaning of the names:

    - amplitude: curve over the predicted signal. lag: delay.
    - history: signal after the hold in proportion to the hold signal.
    - radial: wider or narrower contact area. shift: displaced contact area.
    - common: signal of all taxels.
    - board, row, column, taxel: fixed factors and offsets of these locations; for rows (TX lines) and columns (RX
      lines) also signal of other lines.
    - noise: noise features. missing: missing frames.
    - The distortion that is generated last changes the drift residual.

    model: f64[C, F, n] (C conditions, F features, n taxels), features that the best set of effects predicts, counts;
    NaN where unknown.
    """
    model = np.nan_to_num(model)
    bins = np.arange(layout.bins)
    signal_counts = np.ascontiguousarray(np.moveaxis(model[:, : layout.bins], 2, 1))  # [C, n, B]
    hold = signal_counts[:, :, pair.time_grid.find_bins(Phase.HOLD)[0]]
    factor_and_offset = np.stack([signal_counts, np.ones_like(signal_counts)], axis=-1)
    has_lines = LINES not in pair.missing_inputs
    scopes = EVERY_SCOPE if has_lines else (HAND, BOARD, TAXEL)
    yield Distortion("amplitude", bins, _build_signal_curve(signal_counts), scopes)
    yield _build_lag(pair, layout, signal_counts, hold)
    later = np.flatnonzero(np.isin(layout.phase[: layout.bins], [Phase.RELEASE, Phase.RECOVERY]))
    if len(later):
        each = np.broadcast_to(np.eye(len(later)), (*hold.shape, len(later), len(later)))
        yield Distortion("history", later, hold[:, :, None, None] * each, scopes)
    grid = Grid(pair)
    yield Distortion("radial", bins, _build_radial_curve(pair, grid, signal_counts, hold), (HAND, BOARD))
    yield Distortion("shift", bins, grid.compute_slopes(signal_counts), (BOARD,))
    yield Distortion("common", bins, _build_common(pair, signal_counts), (HAND, BOARD))
    yield Distortion("board", bins, factor_and_offset, (BOARD,))
    if has_lines:
        tx, rx = pair.groups.tx, pair.groups.rx
        yield Distortion("row", bins, grid.build_line_columns(signal_counts, tx, rx), (ROW,))
        yield Distortion("column", bins, grid.build_line_columns(signal_counts, rx, tx), (COLUMN,))
    yield Distortion("taxel", bins, factor_and_offset, (TAXEL,))
    noise = np.broadcast_to(np.eye(2), (*hold.shape, 2, 2))
    yield Distortion("noise", np.arange(layout.noise.start, layout.noise.stop), noise, scopes)
    for name, feature, unit in (("missing", layout.missing, COUNTS_MISSING), ("wander", layout.drift_residual, 1.0)):
        yield Distortion(name, np.array([feature]), np.full((*hold.shape, 1, 1), unit), (HAND, BOARD))


def compute_signal_knots(signal_counts: FloatArray) -> FloatArray:
    """Return the knots of the curve over the predicted signal, counts, f64[K] (K knots).

    signal_counts: predicted signals, any shape, counts.
    """
    return np.array(SIGNAL_KNOTS) * max(float(signal_counts.max(initial=0.0)), 1.0)


def _evaluate_hats(values: FloatArray, knots: FloatArray) -> FloatArray:
    """Return the hat functions of K knots (linear B-splines) at values of any shape, f64[..., K].

    Function k is 1 at knot k and 0 at the other knots. The last function is constant beyond the last knot. If the first
    knot is above 0, all functions are 0 at the value 0.
    """
    edges = np.concatenate([[0.0], knots]) if knots[0] > 0 else knots
    height = np.eye(len(edges))[:, len(edges) - len(knots) :]
    return np.stack([np.interp(values, edges, height[:, k]) for k in range(len(knots))], axis=-1)


def _build_signal_curve(signal_counts: FloatArray) -> FloatArray:
    """Return the columns of a curve over the predicted signal that is 0 at 0, f64[C, n, B, K] (C conditions, n taxels,
    B time bins, K columns).

    A coefficient is the value of the curve at a knot, in counts. signal_counts: f64[C, n, B].
    """
    return _evaluate_hats(np.maximum(signal_counts, 0.0), compute_signal_knots(signal_counts))


def _build_lag(pair: Pair, layout: FeatureLayout, signal_counts: FloatArray, hold: FloatArray) -> Distortion:
    """Return the first-order change of signals and onset that a delay causes. The single coefficient is the delay in s.

    signal_counts: predicted signals in B time bins, f64[C, n, B] (C conditions, n taxels), counts. hold: predicted
    signals in hold, f64[C, n], counts.
    """
    bin_grid = pair.time_grid.bin_grid
    # Signal at the edges of the time bins: mean of the two adjacent bins, extrapolated at the first and the last edge.
    edges = np.empty((*signal_counts.shape[:2], layout.bins + 1))
    edges[..., 1:-1] = 0.5 * (signal_counts[..., 1:] + signal_counts[..., :-1])
    edges[..., 0] = signal_counts[..., 0] - np.diff(signal_counts[..., :2], axis=-1).sum(axis=-1) / 2.0
    edges[..., -1] = signal_counts[..., -1] + np.diff(signal_counts[..., -2:], axis=-1).sum(axis=-1) / 2.0
    for k in np.flatnonzero(layout.phase[: layout.bins] == Phase.HOLD):
        edges[..., k : k + 2] = signal_counts[..., k, None]  # hold is flat up to its ends
    columns = np.empty((*signal_counts.shape[:2], layout.bins + 1, 1))
    # A delay t changes a signal s by -t ds/dt, and the onset feature by t times its unit `COUNTS_PER_SECOND`.
    columns[..., :-1, 0] = -np.diff(edges, axis=-1) / (bin_grid.end - bin_grid.begin)
    sensor = pair.groups.sensor
    level = np.stack([np.bincount(sensor, condition, len(pair.sensors.address)) for condition in hold])
    columns[..., -1, 0] = np.where(level > ONSET_COUNTS, COUNTS_PER_SECOND, 0.0)[:, sensor]
    return Distortion("lag", np.append(np.arange(layout.bins), layout.onset), columns, (HAND, BOARD))


def _build_radial_curve(pair: Pair, grid: Grid, signal_counts: FloatArray, hold: FloatArray) -> FloatArray:
    """Return the columns of a wider or narrower contact area, f64[C, n, B, K + 1] (C conditions, n taxels).

    The first K columns are a curve over the distance from the centre of the contact area, times the largest signal of
    the board. The last column is the mean signal of a taxel's neighbours minus its own signal. signal_counts: predicted
    signals in B time bins, f64[C, n, B], counts. hold: predicted signals in hold, f64[C, n], counts.
    """
    level, radius = np.zeros_like(signal_counts), np.zeros_like(hold)
    for board in range(len(pair.sensors.address)):
        taxels = np.flatnonzero(pair.groups.sensor == board)
        if not len(taxels):
            continue
        position, weight = pair.taxels.position[taxels], np.maximum(hold[:, taxels], 0.0) ** 2
        total = weight.sum(axis=1, keepdims=True)
        share = weight / np.where(total > 0, total, 1.0)
        distance = np.linalg.norm(position - (share @ position)[:, None], axis=2)
        width = np.sqrt((share * distance**2).sum(axis=1, keepdims=True))
        # The lower limit of half a taxel is needed for a contact on a single taxel, whose width is 0.
        radius[:, taxels] = distance / np.maximum(width, 0.5 * float(pair.taxels.size[taxels].mean()))
        level[:, taxels] = signal_counts[:, taxels].max(axis=1, keepdims=True)
    rings = _evaluate_hats(radius, np.array(RADIUS_KNOTS))[:, :, None] * level[..., None]
    return np.concatenate([rings, grid.compute_neighbour_difference(signal_counts)[..., None]], axis=-1)


def _build_common(pair: Pair, signal_counts: FloatArray) -> FloatArray:
    """Return two columns for each taxel: the mean predicted signal of the hand, and of its board, f64[C, n, B, 2] (C
    conditions, n taxels).

    With these columns all taxels, loaded or not, change with the total load. signal_counts: predicted signals in B time
    bins, f64[C, n, B], counts.
    """
    sensor = pair.groups.sensor
    is_on_board = (sensor == np.arange(len(pair.sensors.address))[:, None]).astype(np.float64)
    board_average = is_on_board / np.maximum(is_on_board.sum(axis=1, keepdims=True), 1.0)
    means = np.einsum("gn,cnb->cgb", board_average, signal_counts)
    hand = np.broadcast_to(signal_counts.mean(axis=1, keepdims=True), signal_counts.shape)
    return np.stack([hand, means[:, sensor]], axis=-1)


class Grid:
    """Neighbours of each taxel along TX and RX on the same board.

    sensor: [n] (n taxels), column of each taxel's board. neighbours: for each axis (TX, RX) the taxels before and after
    each taxel, [n] each; the index n stands for no neighbour.
    """

    def __init__(self, pair: Pair) -> None:
        """Find the neighbours of each taxel: the taxels of its board whose TX or RX line number differs by 1."""
        self.sensor = pair.groups.sensor
        keys = [tuple(key) for key in np.column_stack([self.sensor, pair.taxels.tx, pair.taxels.rx]).tolist()]
        index_of_key = {key: k for k, key in enumerate(keys)}

        def find_neighbours(tx: int, rx: int) -> NDArray[np.intp]:
            """Return the taxel `tx` TX lines and `rx` RX lines away from each taxel, [n] (n taxels); n if there is
            none.
            """
            return np.array([index_of_key.get((s, t + tx, r + rx), len(keys)) for s, t, r in keys], np.intp)

        self.neighbours = (
            (find_neighbours(-1, 0), find_neighbours(1, 0)),
            (find_neighbours(0, -1), find_neighbours(0, 1)),
        )

    def compute_neighbour_difference(self, signal_counts: FloatArray) -> FloatArray:
        """Return the mean signal of the neighbours minus the signal of the taxel, counts, f64[C, n, B] (C conditions, n
        taxels, B time bins).
        """
        padded = _append_zero_taxel(signal_counts)
        exists = [side < signal_counts.shape[1] for axis in self.neighbours for side in axis]
        total = np.sum([padded[:, side] for axis in self.neighbours for side in axis], axis=0)
        count = np.maximum(np.sum(exists, axis=0), 1)[:, None]
        return np.asarray(total / count - signal_counts)

    def compute_slopes(self, signal_counts: FloatArray) -> FloatArray:
        """Return half the difference between the two neighbours on each axis, counts, f64[C, n, B, 2] (C conditions, n
        taxels, B time bins).

        At an edge the taxel itself replaces the missing neighbour.
        """
        padded, slopes = _append_zero_taxel(signal_counts), []
        for before, after in self.neighbours:
            ends = [
                np.where((side < signal_counts.shape[1])[:, None], padded[:, side], signal_counts)
                for side in (before, after)
            ]
            slopes.append(0.5 * (ends[1] - ends[0]))
        return np.stack(slopes, axis=-1)

    def build_line_columns(
        self, signal_counts: FloatArray, along: NDArray[np.intp], across: NDArray[np.intp]
    ) -> FloatArray:
        """Return the columns of a distortion that adds signals of other lines to a line, as crosstalk or exchanged
        lines do.

        Column k of a taxel is the signal where line k of its board crosses the taxel's line of the other axis; 0 if no
        taxel is there. The last column is an offset. The shape is f64[C, n, B, K + 1] (C conditions, n taxels, B time
        bins), with the largest number K of lines of a board. If K exceeds `MAX_LINES`, the columns are the taxel's own
        signal and an offset, f64[C, n, B, 2].

        along, across: [n], line of each taxel on the axis of the distortion and on the other axis, numbered over all
        boards.
        """
        first = np.full(int(self.sensor.max()) + 1, len(along))
        np.minimum.at(first, self.sensor, along)
        line = along - first[self.sensor]
        count = int(line.max(initial=0)) + 1
        if count > MAX_LINES:
            return np.stack([signal_counts, np.ones_like(signal_counts)], axis=-1)
        padded, columns = _append_zero_taxel(signal_counts), np.ones((*signal_counts.shape, count + 1))
        for number in range(count):
            taxel_of_crossing = {int(across[k]): int(k) for k in np.flatnonzero(line == number)}
            source = np.array([taxel_of_crossing.get(int(other), len(along)) for other in across], np.intp)
            columns[..., number] = padded[:, source]
        return columns


def _append_zero_taxel(signal_counts: FloatArray) -> FloatArray:
    """Return signals f64[C, n, B] (C conditions, n taxels, B time bins) with a taxel without signal appended, f64[C, n
    + 1, B].

    The index n, which stands for a missing neighbour, selects the appended taxel.
    """
    return np.concatenate([signal_counts, np.zeros_like(signal_counts[:, :1])], axis=1)
