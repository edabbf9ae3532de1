"""Location of taxels without response: on lines and in patches."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.csgraph import connected_components

from taxel.gap.features.features import SessionMeans, compute_known_mean
from taxel.gap.fitting.state import State
from taxel.types import FloatArray

LOADED_COUNTS: Final = 120.0
"""Expected signal above which a taxel is treated as loaded, counts.

Chosen; silent taxels without a loaded taxel among their connected silent taxels are not reported.
"""

RESPONSE_SHARE: Final = 0.5
"""Share of the expected signal above which a taxel responds.

A taxel without response must stay below it by three standard errors. Chosen.
"""

MAX_EXCHANGE_ERROR: Final = 0.3
"""Largest squared difference of two exchanged lines: measured signals of one line, expected signals of the other line.

The difference is relative to the squared expected signals, or to the squared difference between measured and expected
signals of the measured line if that is smaller. Chosen.
"""

MAX_ZERO_SHARE: Final = 0.05
"""Share of the expected signal below which a taxel or a line shows no signal at all. Chosen."""

FULL_RESPONSE_SHARE: Final = 0.7
"""Share of the typical response of the board above which a taxel responds fully.

A taxel with a smaller response can lie at the rim of a displaced contact. Chosen.
"""

MIN_PATCH_TAXELS: Final = 3
"""Smallest number of connected dead taxels, and of fully responding neighbours, of an evident patch. Chosen."""


def find_dead_taxels(
    state: State, response: FloatArray, is_silent: NDArray[np.bool_], expected: FloatArray
) -> tuple[NDArray[np.bool_], bool]:
    """Return the dead taxels among the silent taxels, bool[n] (n taxels), and whether a patch of dead taxels is
    evident.

    response: f64[n], measured signal divided by the expected signal; NaN for a taxel without expected signal.
    is_silent: bool[n], taxels without response. expected: f64[C, n] (C conditions), largest expected signals, counts.

    A connected set of silent taxels (a patch) is dead if contact is expected to load one of its taxels. If this load is
    expected in one condition only, a neighbour with a weak response contradicts the dead patch, because the object can
    be displaced. A patch is evident if, in addition, at least `MIN_PATCH_TAXELS` of its taxels show no signal at all
    and at least as many neighbours respond fully.
    """
    sensor, silent = state.pair.groups.sensor, np.flatnonzero(is_silent)
    is_neighbour = _find_neighbours(state, silent)
    typical = np.array([_compute_typical_response(response[sensor == board]) for board in range(int(sensor.max()) + 1)])
    responding_neighbours = is_neighbour & ~is_silent
    full_response = FULL_RESPONSE_SHARE * typical[sensor]
    has_weak_neighbour = np.asarray((responding_neighbours & (response < full_response)).any(axis=1))
    full_neighbours = np.asarray((responding_neighbours & (response >= full_response)).sum(axis=1))
    loaded_conditions = (expected[:, silent] > LOADED_COUNTS).sum(axis=0)
    is_dead, is_evident = np.zeros(len(response), bool), False
    patch_count, patch = connected_components(is_neighbour[:, silent], directed=False)
    for number in range(patch_count):
        members = patch == number
        conditions, may_be_displaced = loaded_conditions[members].max(), has_weak_neighbour[members].any()
        is_dead[silent[members]] = conditions > 0 and (conditions > 1 or not may_be_displaced)
        zero_taxels = (np.abs(response[silent[members]]) < MAX_ZERO_SHARE).sum()
        is_clear = zero_taxels >= MIN_PATCH_TAXELS and full_neighbours[members].sum() >= MIN_PATCH_TAXELS
        is_evident |= bool(conditions > 0 and not may_be_displaced and is_clear)
    return is_dead, is_evident


def find_dead_lines(
    state: State, dead: NDArray[np.bool_], can_be_judged: NDArray[np.bool_]
) -> list[tuple[int, str, int]]:
    """Return the dead lines as (board column, axis, line index), with the axis "tx" or "rx".

    dead: bool[n] (n taxels), dead taxels. can_be_judged: bool[n], taxels with sufficient expected signal. On a dead
    line at least two taxels can be judged and all of these taxels are dead. A line is not reported if it is a part of a
    patch of dead taxels, or if all taxels of its board that can be judged are dead.
    """
    lines: list[tuple[int, str, int]] = []
    sensor = state.pair.groups.sensor
    for axis, number in (("tx", state.pair.taxels.tx), ("rx", state.pair.taxels.rx)):
        for board in range(int(sensor.max()) + 1):
            for index in np.unique(number[sensor == board]).tolist():
                on_line = (sensor == board) & (number == index) & can_be_judged
                on_board = (sensor == board) & can_be_judged
                if on_line.sum() >= 2 and dead[on_line].all() and not dead[on_board].all():
                    lines.append((board, axis, index))
    # A removed line may uncover dead taxels beside another line, so the check is repeated until no line is removed.
    while True:
        on_lines = np.zeros(len(dead), bool)
        for line in lines:
            on_lines |= find_taxels_on_line(state, line)
        remaining = [line for line in lines if not _is_part_of_patch(state, dead & can_be_judged, line, on_lines)]
        if len(remaining) == len(lines):
            return lines
        lines = remaining


def _is_part_of_patch(
    state: State, dead: NDArray[np.bool_], line: tuple[int, str, int], on_lines: NDArray[np.bool_]
) -> bool:
    """Return whether a line belongs to a patch of dead taxels that extends beyond the line.

    This is the case if the dead taxels directly beside the dead taxels of the line are at least half as many. dead:
    bool[n] (n taxels), dead taxels. line: (board column, axis, line index). on_lines: bool[n], taxels of all dead
    lines; they are not counted as taxels beside the line.
    """
    dead_on_line = dead & find_taxels_on_line(state, line)
    dead_outside = np.flatnonzero(dead & ~on_lines)
    is_beside = _find_neighbours(state, dead_outside)[:, dead_on_line].any(axis=1)
    return bool(2 * is_beside.sum() >= dead_on_line.sum())


def _find_neighbours(state: State, taxels: NDArray[np.intp]) -> NDArray[np.bool_]:
    """Return which of all n taxels are direct neighbours of each given taxel, bool[len(taxels), n].

    Direct neighbours lie on the same board, on the same line of one axis, and on adjacent lines of the other axis.
    taxels: indices of the given taxels.
    """
    place = np.column_stack([state.pair.groups.sensor, state.pair.taxels.tx, state.pair.taxels.rx]).astype(np.intp)
    steps = np.abs(place[taxels, None] - place)
    return np.asarray((steps[:, :, 0] == 0) & (steps[:, :, 1:].sum(axis=2) == 1))


def is_line_evident(state: State, response: FloatArray, line: tuple[int, str, int]) -> bool:
    """Return whether a dead line is evident: no signal at all on the line, and responses on its neighbour lines.

    response: f64[n] (n taxels), measured signal divided by the expected signal; NaN for a taxel without expected
    signal. line: (board column, axis, line index). A displaced object also leaves whole lines unloaded, but not between
    two lines that it loads, and not beside a line that responds fully. A line with only one neighbour line is therefore
    evident only if this neighbour responds fully.
    """
    board, axis, index = line
    typical = _compute_typical_response(response[state.pair.groups.sensor == board])

    def select_responses(number: int) -> FloatArray:
        """Return the known responses of the taxels on the parallel line with the index `number`."""
        on_line = response[find_taxels_on_line(state, (board, axis, number))]
        return on_line[np.isfinite(on_line)]

    neighbours = [shares for shares in (select_responses(index - 1), select_responses(index + 1)) if len(shares)]
    is_between = len(neighbours) > 0 and all((shares > RESPONSE_SHARE).any() for shares in neighbours)
    if len(neighbours) == 1:
        is_between = is_between and bool((neighbours[0] > FULL_RESPONSE_SHARE * typical).all())
    return bool(is_between and (np.abs(select_responses(index)) < MAX_ZERO_SHARE).all())


def _compute_typical_response(response: FloatArray) -> float:
    """Return the median response of the responding taxels of a board; 1 if no taxel responds."""
    responding = response[response > RESPONSE_SHARE]
    return float(np.median(responding)) if len(responding) else 1.0


def find_affected_lines(state: State, taxels: NDArray[np.bool_]) -> list[tuple[int, str, int]]:
    """Return the sorted lines that contain at least one of the given taxels, as (board column, axis, line index).

    taxels: bool[n] (n taxels), true for the given taxels. axis: "tx" or "rx".
    """
    sensor, numbers = state.pair.groups.sensor, np.flatnonzero(taxels)
    axes = (("tx", state.pair.taxels.tx), ("rx", state.pair.taxels.rx))
    return sorted({(int(sensor[taxel]), axis, int(line[taxel])) for axis, line in axes for taxel in numbers})


def is_response_on_other_line(
    state: State,
    real: SessionMeans,
    features: FloatArray,
    line: tuple[int, str, int],
    is_silent: NDArray[np.bool_],
) -> bool:
    """Return whether another line of the board shows the expected signals of a line: the lines are exchanged, not dead.

    real: measured features. features: f64[C, F, n] (C conditions, F features, n taxels), expected features. line:
    (board column, axis, line index). is_silent: bool[n], taxels without response; they are not compared. Two lines are
    compared on the lines that cross both of them, of which there must be at least two.
    """
    board, axis, index = line
    bins, taxels = state.layout.bins, state.pair.taxels
    along, across = (taxels.tx, taxels.rx) if axis == "tx" else (taxels.rx, taxels.tx)
    measured = np.nan_to_num(compute_known_mean(real.value, 1)[:, :bins])
    on_line = np.flatnonzero(find_taxels_on_line(state, line))
    for other in np.unique(along[state.pair.groups.sensor == board]).tolist():
        on_other = np.flatnonzero(find_taxels_on_line(state, (board, axis, other)) & ~is_silent)
        _, here, there = np.intersect1d(across[on_line], across[on_other], return_indices=True)
        if other == index or len(here) < 2:
            continue
        expected_here, measured_there = features[:, :bins, on_line[here]], measured[:, :, on_other[there]]
        expected_there = features[:, :bins, on_other[there]]
        exchange_error = float(np.sum((measured_there - expected_here) ** 2))
        unexchanged_error = float(np.sum((measured_there - expected_there) ** 2))
        if exchange_error < MAX_EXCHANGE_ERROR * min(float(np.sum(expected_here**2)), unexchanged_error):
            return True
    return False


def find_taxels_on_line(state: State, line: tuple[int, str, int]) -> NDArray[np.bool_]:
    """Return which taxels lie on a line, bool[n] (n taxels). line: (board column, axis, line index)."""
    board, axis, index = line
    number = state.pair.taxels.tx if axis == "tx" else state.pair.taxels.rx
    return np.asarray((state.pair.groups.sensor == board) & (number == index))
