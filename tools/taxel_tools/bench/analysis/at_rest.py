"""Lines that are broken, joined or exchanged, from the counts of an untouched board.

A hardware count (largest count less raw count) is proportional to a crossing's capacitance, so what is wrong with a
line shows in all crossings on it: a broken line leaves only a stub; two joined lines measure the same charge, however
the parts spread; lines exchanged in the harness lose their capacitance where the other one has no taxel.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations
from typing import Final

import numpy as np
from numpy.typing import NDArray

from taxel.hand import BoardKind
from taxel.signal.noise import MAD_TO_SIGMA
from taxel_tools.bench.analysis.fault import (
    Axis,
    Fault,
    joint,
    line_name,
    lines_name,
    lines_of,
    severity_below,
    taxel_name,
)

CHANCE: Final = 3e-6
"""How likely it may be, by the spread of parts alone, that two sound lines look joined: a few short pairs a board, and
many boards.
"""
SAME_SIGMAS: Final = 4.0
SAME_SHARE: Final = 0.002
"""Crossings that differ by no more than noise and this share are called the same: coupling between lines leaves it."""
SPREADS: Final = 6.0
"""How many standard deviations of the parts' spread a crossing may be off."""
FULL_COUNTS: Final = 2.0
"""A raw count below this is at its stop: the crossing has more capacitance than the converter takes."""
GONE: Final = 0.2
"""Relative capacitance below which a crossing surely carries no taxel."""
SPREAD_MIN: Final = 0.01
"""The least relative spread of capacitances that is believed of a board."""
BATCHES: Final = 10
"""A mean's error is taken from means over so many parts of the record, since 1/f noise does not average out."""


@dataclass(frozen=True, eq=False)
class AtRest:
    """A board's counts when nothing touches it.

    `hardware` f64[taxels]: largest count less mean raw count. `error` f64[taxels]: standard error of that mean.
    `largest`: the largest count.
    """

    kind: BoardKind
    hardware: NDArray[np.float64]
    error: NDArray[np.float64]
    largest: float = float("inf")

    @property
    def relative(self) -> NDArray[np.float64]:
        """Capacitances over the board's median."""
        return np.asarray(self.hardware / max(float(np.median(self.hardware)), 1.0))

    @property
    def spread(self) -> float:
        """Standard deviation of the relative capacitances, from their median absolute deviation."""
        relative = self.relative
        return max(MAD_TO_SIGMA * float(np.median(np.abs(relative - np.median(relative)))), SPREAD_MIN)

    def grid(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Values of taxels at their crossings, f64[tx, rx], NaN where there is none."""
        grid = np.full(self.kind.crossings.shape, np.nan)
        grid[self.kind.crossings] = values
        return grid


def mean_error(raw_counts: NDArray[np.uint16]) -> NDArray[np.float64]:
    """Standard error of each taxel's mean, f64[taxels]: of batch means, pooled over the board, and never below the
    white one. raw_counts: u16[t, taxels].
    """
    frames = len(raw_counts)
    white = raw_counts.std(axis=0) / np.sqrt(frames)
    if frames < 4 * BATCHES:
        return np.asarray(white)
    batches = raw_counts[: frames // BATCHES * BATCHES].reshape(BATCHES, -1, raw_counts.shape[1]).mean(axis=1)
    pooled = float(np.median(batches.std(axis=0, ddof=1))) / np.sqrt(BATCHES)
    return np.asarray(np.maximum(white, pooled))


def line_faults(rest: AtRest, least: float) -> tuple[list[Fault], NDArray[np.bool_]]:
    """Faults, and which taxels they explain, bool[taxels].

    least: relative capacitance below which a crossing counts as missing.
    """
    missing = rest.relative < least
    explained = np.zeros(len(missing), dtype=bool)
    faults: list[Fault] = []
    for find in (_joined, _swapped, _open):
        found, places = find(rest, missing & ~explained, least)
        faults += found
        explained |= places
    for taxel in np.nonzero(missing & ~explained)[0]:
        share = float(rest.relative[taxel])
        crossing = f"TX {rest.kind.tx[taxel]}, RX {rest.kind.rx[taxel]}"
        text = f"has {share:.0%} of the board's median capacitance: look at the electrodes at {crossing}"
        faults.append(Fault("missing crossing", taxel_name(int(taxel)), text, severity_below(share, least)))
    return faults, explained | missing


def _open(rest: AtRest, missing: NDArray[np.bool_], least: float) -> tuple[list[Fault], NDArray[np.bool_]]:
    """Lines without any capacitance. A taxel at the crossing of two such lines may be due to either."""
    explained = np.zeros(len(missing), dtype=bool)
    whole = []
    for axis in Axis:
        lines = lines_of(rest.kind, axis)
        for index in np.unique(lines):
            on_line = lines == index
            if missing[on_line].all():
                whole.append((int(on_line.sum()), axis, int(index), on_line))
    faults = []
    for _, axis, index, on_line in sorted(whole, key=lambda one: -one[0]):
        if not (missing & on_line & ~explained).any():
            continue
        explained |= on_line
        share = float(np.median(rest.relative[on_line]))
        where = joint(axis, index, rest.kind.tx_count)
        text = f"all its crossings have {share:.0%} of the capacitance that they should: look at {where} and its trace"
        faults.append(Fault("open line", line_name(axis, index), text, severity_below(share, least)))
    return faults, explained


def _joined(rest: AtRest, missing: NDArray[np.bool_], least: float) -> tuple[list[Fault], NDArray[np.bool_]]:
    """Neighbouring lines that measure the same."""
    explained = np.zeros(len(missing), dtype=bool)
    hardware, error, relative = rest.grid(rest.hardware), rest.grid(rest.error), rest.grid(rest.relative)
    grid_of_missing = rest.grid(missing.astype(np.float64))
    faults = []
    for axis in Axis:
        tables = [table if axis is Axis.TX else table.T for table in (hardware, error, relative)]
        for index in range(len(tables[0]) - 1):
            apart = ~_open_elsewhere(grid_of_missing if axis is Axis.TX else grid_of_missing.T, index)
            chance, level = _chance_of_sameness(
                rest, [np.where(apart, one[index : index + 2], np.nan) for one in tables]
            )
            if chance > CHANCE:
                continue
            lines = lines_of(rest.kind, axis)
            explained |= (lines == index) | (lines == index + 1)
            first, second = (joint(axis, line, rest.kind.tx_count) for line in (index, index + 1))
            text = f"measure the same at every crossing ({level:.0%} of the median): look between {first} and {second}"
            faults.append(Fault("short", lines_name(axis, index, index + 1), text, float("inf")))
    return faults, explained


def _open_elsewhere(missing: NDArray[np.float64], index: int) -> NDArray[np.bool_]:
    """Crossing lines that are missing everywhere but on two lines, bool[crossing lines]: on those they say nothing.

    missing: [lines, crossing lines], NaN where there is no taxel.
    """
    others = np.delete(missing, [index, index + 1], axis=0)
    return np.asarray(np.isfinite(others).any(axis=0) & (np.nan_to_num(others, nan=1.0) == 1.0).all(axis=0))


def _chance_of_sameness(rest: AtRest, pair: list[NDArray[np.float64]]) -> tuple[float, float]:
    """How likely two sound lines would agree so well, and the level at which they do.

    Each common crossing of sound lines agrees within a tolerance by chance with the share of a normal distribution that
    the tolerance covers. A crossing that only one of them has is halved (or so) by a short, and stays as it is on sound
    lines.
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
    sigma = np.sqrt(2.0) * rest.spread * float(np.median(rest.hardware))
    chance = float(np.prod(np.minimum(2.0 * tolerance / (np.sqrt(2.0 * np.pi) * sigma), 1.0)))
    if abs(level - 1.0) > SPREADS * rest.spread / np.sqrt(common.sum()):
        chance *= CHANCE
    if (hardware[:, common] > rest.largest - FULL_COUNTS).all():
        return chance, level
    alone = relative[:, np.isfinite(hardware).sum(axis=0) == 1]
    alone = alone[np.isfinite(alone)]
    if len(alone):
        if (np.abs(alone - level / 2.0) > SPREADS * rest.spread).any():
            return 1.0, level
        if abs(float(np.mean(alone)) - 1.0) > SPREADS * rest.spread / np.sqrt(len(alone)):
            chance *= CHANCE
    return chance, level


def _swapped(rest: AtRest, missing: NDArray[np.bool_], least: float) -> tuple[list[Fault], NDArray[np.bool_]]:
    """The pair of lines whose exchange leaves just these crossings without a taxel."""
    nothing = np.zeros(len(missing), dtype=bool)
    if not missing.any() or (rest.relative[missing] > GONE).any():
        return [], nothing
    crossings = rest.kind.crossings
    lost = np.zeros_like(crossings)
    lost[crossings] = missing
    fits = []
    for axis in Axis:
        has, gone = (crossings, lost) if axis is Axis.TX else (crossings.T, lost.T)
        for first, second in combinations(range(len(has)), 2):
            expected = np.zeros_like(gone)
            expected[first] = has[first] & ~has[second]
            expected[second] = has[second] & ~has[first]
            if (expected == gone).all():
                fits.append((axis, first, second))
    if len(fits) != 1:
        return [], nothing
    axis, first, second = fits[0]
    joints = " and ".join(joint(axis, line, rest.kind.tx_count) for line in (first, second))
    text = f"each lacks the crossings that only the other has: look whether {joints} are exchanged"
    share = float(np.median(rest.relative[missing]))
    lines = lines_of(rest.kind, axis)
    return [Fault("swapped lines", lines_name(axis, first, second), text, severity_below(share, least))], (
        lines == first
    ) | (lines == second)
