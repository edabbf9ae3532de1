"""Detection of open, shorted and swapped lines from the raw counts of an untouched board.

A hardware count (full-scale count minus raw count) is proportional to the capacitance of a crossing, so a fault of a
line appears at all its crossings. An open line leaves only the capacitance of a stub. Two shorted lines measure the
same charge, despite the tolerances of the parts. Lines swapped in the harness lack the capacitance at each crossing
where the other line has no taxel.
"""

from dataclasses import dataclass
from itertools import combinations
from typing import Final

import numpy as np
from scipy.special import chdtrc, erfc

from taxel.hand import BoardKind
from taxel.signal.noise import MAD_TO_SIGMA
from taxel.types import BoolArray, CountArray, FloatArray
from taxel_tools.bench.analysis.fault import (
    Axis,
    Fault,
    compute_severity_below,
    format_connector_pin,
    format_line_name,
    format_line_pair_name,
    format_taxel_name,
    get_lines_of_taxels,
)

CHANCE_MAX: Final = 3e-6
"""Probability at which the similarity of two healthy lines by chance is excluded.

The value keeps false shorts improbable for several pairs of lines on a board and for a batch of boards.
"""
SAME_SIGMAS: Final = 4.0
SAME_SHARE: Final = 0.002
"""Relative difference that coupling between lines causes; below this and the noise, two crossings count as equal."""
SPREAD_SIGMAS: Final = 6.0
"""Permitted deviation of a crossing, in standard deviations of the capacitance."""
STOP_COUNTS: Final = 2.0
"""A raw count below this limit is at its stop: the crossing has more capacitance than the converter measures."""
NO_TAXEL_SHARE: Final = 0.2
"""Relative capacitance below which a crossing certainly has no taxel."""
SPREAD_MIN: Final = 0.01
"""Lower limit of the relative standard deviation of the capacitances of a board."""
BATCHES: Final = 10
"""Number of parts of the record whose means give the standard error, because 1/f noise does not average out."""


@dataclass(frozen=True, eq=False)
class RestCounts:
    """Counts of an untouched board.

    `hardware` f64[taxels]: full-scale count minus mean raw count. `error` f64[taxels]: standard error of this mean.
    `full_scale`: full-scale count.
    """

    kind: BoardKind
    hardware: FloatArray
    error: FloatArray
    full_scale: float = float("inf")

    @property
    def relative_capacitance(self) -> FloatArray:
        """Capacitances of the crossings relative to the median of the board, f64[taxels]."""
        return np.asarray(self.hardware / max(float(np.median(self.hardware)), 1.0))

    @property
    def spread(self) -> float:
        """Standard deviation of the relative capacitances, from their median absolute deviation."""
        relative = self.relative_capacitance
        return max(MAD_TO_SIGMA * float(np.median(np.abs(relative - np.median(relative)))), SPREAD_MIN)

    def to_grid(self, values: FloatArray) -> FloatArray:
        """Arrange one value per taxel at the crossings of the board, f64[tx, rx]; NaN at crossings without a taxel."""
        grid = np.full(self.kind.crossings.shape, np.nan)
        grid[self.kind.crossings] = values
        return grid


def compute_standard_error(raw_counts: CountArray) -> FloatArray:
    """Estimate the standard error of the mean raw count of each taxel, f64[taxels].

    raw_counts: u16[t, taxels], t frames. Returns the larger of two estimates: the standard error for white noise, and
    the standard error from the means of `BATCHES` parts of the record, pooled over the board. A record with fewer than
    4 frames per part gives only the first.
    """
    frames = len(raw_counts)
    white = raw_counts.std(axis=0) / np.sqrt(frames)
    if frames < 4 * BATCHES:
        return np.asarray(white)
    batches = raw_counts[: frames // BATCHES * BATCHES].reshape(BATCHES, -1, raw_counts.shape[1]).mean(axis=1)
    pooled = float(np.median(batches.std(axis=0, ddof=1))) / np.sqrt(BATCHES)
    return np.asarray(np.maximum(white, pooled))


def find_line_faults(counts: RestCounts, limit: float) -> tuple[list[Fault], BoolArray]:
    """Find faults of TX and RX lines in the counts of an untouched board.

    limit: relative capacitance below which a crossing is treated as missing. Returns the faults, including missing
    crossings that no line fault explains, and the taxels that these faults explain, bool[taxels].
    """
    missing = counts.relative_capacitance < limit
    explained = np.zeros(len(missing), dtype=bool)
    faults: list[Fault] = []
    for find in (_find_shorts, _find_swapped_lines, _find_open_lines):
        new_faults, new_explained = find(counts, missing & ~explained, limit)
        faults += new_faults
        explained |= new_explained
    for taxel in np.nonzero(missing & ~explained)[0]:
        share = float(counts.relative_capacitance[taxel])
        crossing = f"TX {counts.kind.tx[taxel]}, RX {counts.kind.rx[taxel]}"
        text = f"{share:.0%} of the median capacitance of the board; check the electrodes at {crossing}"
        faults.append(
            Fault("missing crossing", format_taxel_name(int(taxel)), text, compute_severity_below(share, limit))
        )
    return faults, explained | missing


def _find_open_lines(counts: RestCounts, missing: BoolArray, limit: float) -> tuple[list[Fault], BoolArray]:
    """Find the lines of an untouched board whose crossings are all missing.

    missing: bool[taxels], relative capacitance below `limit`. If an open TX and an open RX line share a crossing, the
    line with more taxels explains it. Returns the faults and the taxels on these lines, bool[taxels].
    """
    explained = np.zeros(len(missing), dtype=bool)
    candidates = []
    for axis in Axis:
        lines = get_lines_of_taxels(counts.kind, axis)
        for index in np.unique(lines):
            on_line = lines == index
            if missing[on_line].all():
                candidates.append((int(on_line.sum()), axis, int(index), on_line))
    faults = []
    for _, axis, index, on_line in sorted(candidates, key=lambda candidate: -candidate[0]):
        if not (missing & on_line & ~explained).any():
            continue
        explained |= on_line
        share = float(np.median(counts.relative_capacitance[on_line]))
        pin = format_connector_pin(axis, index, counts.kind.tx_count)
        text = f"its crossings have {share:.0%} of the expected capacitance; check {pin} and its trace"
        faults.append(Fault("open line", format_line_name(axis, index), text, compute_severity_below(share, limit)))
    return faults, explained


def _find_shorts(counts: RestCounts, missing: BoolArray, limit: float) -> tuple[list[Fault], BoolArray]:
    """Find neighbouring lines of an untouched board that measure equal counts, the least probable equality first.

    missing: bool[taxels], missing crossings. A short changes the crossings of both its lines, so these crossings give
    no evidence on the lines of the other axis. Returns the faults and the taxels on shorted lines, bool[taxels].
    """
    pairs = [(axis, index) for axis in Axis for index in range(counts.kind.crossings.shape[axis] - 1)]
    explained = np.zeros(len(missing), dtype=bool)
    shorted: list[tuple[Axis, int]] = []
    faults: list[Fault] = []
    while True:
        chances = {
            pair: _compute_chance_of_short(counts, missing, pair, shorted) for pair in pairs if pair not in shorted
        }
        pair = min(chances, key=lambda key: chances[key][0], default=None)
        if pair is None or chances[pair][0] > CHANCE_MAX:
            return faults, explained
        shorted.append(pair)
        axis, index = pair
        level = chances[pair][1]
        lines = get_lines_of_taxels(counts.kind, axis)
        explained |= (lines == index) | (lines == index + 1)
        first, second = (format_connector_pin(axis, line, counts.kind.tx_count) for line in (index, index + 1))
        text = f"equal counts at every crossing ({level:.0%} of the median); check between {first} and {second}"
        faults.append(Fault("short", format_line_pair_name(axis, index, index + 1), text, float("inf")))


def _compute_chance_of_short(
    counts: RestCounts, missing: BoolArray, pair: tuple[Axis, int], shorted: list[tuple[Axis, int]]
) -> tuple[float, float]:
    """Compute the probability that two healthy neighbouring lines look like a short by chance.

    pair: (axis, number of the first line). shorted: pairs with a short, whose crossings are not used for lines of the
    other axis. Returns this probability and the mean relative capacitance of the common crossings.
    """
    axis, index = pair
    grids = [counts.to_grid(values) for values in (counts.hardware, counts.error, counts.relative_capacitance)]
    missing_grid = counts.to_grid(missing.astype(np.float64))
    tables = [grid if axis is Axis.TX else grid.T for grid in (*grids, missing_grid)]
    usable = ~_is_crossing_line_open(tables.pop(), index)
    for other_axis, line in shorted:
        if other_axis is not axis:
            usable[line : line + 2] = False
    return _compute_chance_of_equality(counts, [np.where(usable, table[index : index + 2], np.nan) for table in tables])


def _is_crossing_line_open(missing: FloatArray, index: int) -> BoolArray:
    """Return which lines of the other axis (crossing lines) are open, bool[crossing lines].

    A crossing line is open if all its crossings are missing, except for those with the lines `index` and `index + 1`,
    which are not evaluated. An open crossing line gives no evidence on these two lines. missing: f64[lines, crossing
    lines], 1 for a missing crossing, NaN for a crossing without a taxel.
    """
    outside_pair = np.delete(missing, [index, index + 1], axis=0)
    is_open = (np.nan_to_num(outside_pair, nan=1.0) == 1.0).all(axis=0)
    return np.asarray(np.isfinite(outside_pair).any(axis=0) & is_open)


def _compute_chance_of_equality(counts: RestCounts, pair: list[FloatArray]) -> tuple[float, float]:
    """Compute the probability that two healthy lines look at least as much like a short by chance.

    pair: hardware counts, their standard errors and relative capacitances of the two lines, f64[2, crossing lines]
    each; NaN for a crossing that is not used. The result is the product of two probabilities:

    - Equal counts at the common crossings: for each, the share of a normal distribution within the tolerance.
    - Deviation from the median of the board: Fisher's method combines two p-values, of the mean of the common crossings
      and of the mean of the crossings that only one line has. A short halves the level of the latter crossings.

    Returns the probability (1 if the lines do not look like a short) and the mean relative capacitance of the common
    crossings.
    """
    hardware, error, relative = pair
    common = np.isfinite(hardware).all(axis=0)
    if not common.any():
        return 1.0, 1.0
    difference = np.abs(hardware[0] - hardware[1])[common]
    tolerance = SAME_SIGMAS * np.hypot(error[0], error[1])[common] + SAME_SHARE * hardware.max(axis=0)[common]
    if (difference > tolerance).any():
        return 1.0, 1.0
    level = float(np.mean(relative[:, common]))
    sigma = np.sqrt(2.0) * counts.spread * float(np.median(counts.hardware))
    equality = float(np.prod(np.minimum(2.0 * tolerance / (np.sqrt(2.0 * np.pi) * sigma), 1.0)))
    # The two crossings of a common crossing line are equal, so that each crossing line counts once.
    p_values = [_compute_p_value(level - 1.0, counts.spread, int(common.sum()))]
    unshared = relative[:, np.isfinite(hardware).sum(axis=0) == 1]
    unshared = unshared[np.isfinite(unshared)]
    at_full_scale = bool((hardware[:, common] > counts.full_scale - STOP_COUNTS).all())
    if len(unshared) and not at_full_scale:
        if (np.abs(unshared - level / 2.0) > SPREAD_SIGMAS * counts.spread).any():
            return 1.0, level
        p_values.append(_compute_p_value(float(np.mean(unshared)) - 1.0, counts.spread, len(unshared)))
    return equality * _combine_p_values(p_values), level


def _compute_p_value(deviation: float, spread: float, count: int) -> float:
    """Compute the two-sided probability that the mean of `count` healthy crossings deviates at least by `deviation`.

    deviation: from the median of the board, relative. spread: standard deviation of one crossing.
    """
    return float(erfc(abs(deviation) / spread * np.sqrt(count / 2.0)))


def _combine_p_values(p_values: list[float]) -> float:
    """Combine independent p-values by Fisher's method: survival function of chi-squared at -2 sum(ln p)."""
    return float(chdtrc(2 * len(p_values), -2.0 * np.log(np.maximum(p_values, np.finfo(float).tiny)).sum()))


def _find_swapped_lines(counts: RestCounts, missing: BoolArray, limit: float) -> tuple[list[Fault], BoolArray]:
    """Find the pair of lines whose exchange explains exactly the missing crossings of an untouched board.

    missing: bool[taxels], missing crossings. Returns one fault and the taxels on its lines, bool[taxels]; no fault if
    no pair or several pairs explain the missing crossings, or if a missing crossing still has capacitance.
    """
    nothing = np.zeros(len(missing), dtype=bool)
    if not missing.any() or (counts.relative_capacitance[missing] > NO_TAXEL_SHARE).any():
        return [], nothing
    crossings = counts.kind.crossings
    missing_crossings = np.zeros_like(crossings)
    missing_crossings[crossings] = missing
    candidates = []
    for axis in Axis:
        table, missing_table = (crossings, missing_crossings) if axis is Axis.TX else (crossings.T, missing_crossings.T)
        for first, second in combinations(range(len(table)), 2):
            expected = np.zeros_like(missing_table)
            expected[first] = table[first] & ~table[second]
            expected[second] = table[second] & ~table[first]
            if (expected == missing_table).all():
                candidates.append((axis, first, second))
    if len(candidates) != 1:
        return [], nothing
    axis, first, second = candidates[0]
    pins = " and ".join(format_connector_pin(axis, line, counts.kind.tx_count) for line in (first, second))
    text = f"each line lacks the crossings that only the other line has; check whether {pins} are exchanged"
    share = float(np.median(counts.relative_capacitance[missing]))
    lines = get_lines_of_taxels(counts.kind, axis)
    place = format_line_pair_name(axis, first, second)
    fault = Fault("swapped lines", place, text, compute_severity_below(share, limit))
    return [fault], (lines == first) | (lines == second)
