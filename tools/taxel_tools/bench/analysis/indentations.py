"""Response of a board to indentations of single taxels.

`response[p, q]` is the signal of taxel q while taxel p is indented. A healthy board has a diagonal matrix. A dead taxel
is a gap in the diagonal, swapped lines move parts of it, shorted lines double it, and crosstalk surrounds it.
"""

from dataclasses import dataclass
from functools import cached_property
from itertools import combinations
from typing import Final

import numpy as np
from numpy.typing import NDArray

from taxel.hand import BoardKind
from taxel.types import BoolArray, FloatArray
from taxel_tools.bench.analysis.fault import (
    BOARD,
    Axis,
    Fault,
    compute_severity_below,
    format_connector_pin,
    format_line_name,
    format_line_pair_name,
    format_taxel_name,
    get_lines_of_taxels,
)

RESPONSE_ERRORS: Final = 5.0
"""A median response below this number of standard errors is noise; the largest noise of a board is 2 to 3 errors."""
REACHED_SHARE: Final = 0.5
"""Share of the median response above which an indentation has reached a taxel."""
CROSSTALK_ERRORS: Final = 4.0
"""Crosstalk is significant above this number of standard errors, because noise causes crosstalk by chance."""
SHORT_SHARE_MIN: Final = 0.5
"""Least share of the own response of an indented taxel that appears at the same crossing of a shorted line."""


@dataclass(frozen=True, eq=False)
class Indentations:
    """Responses to indentations of single taxels.

    `response` f64[taxels, taxels], counts, NaN in the rows of taxels that were not indented. `error` f64[taxels]:
    standard error of a response at each taxel. `force_n`: force of each indentation; NaN if unknown.
    """

    kind: BoardKind
    response: FloatArray
    error: FloatArray
    force_n: float

    @property
    def indented_taxels(self) -> NDArray[np.intp]:
        """Indices of the indented taxels."""
        return np.nonzero(np.isfinite(self.response).all(axis=1))[0]

    @property
    def own_response(self) -> FloatArray:
        """Response of each indented taxel to its own indentation, f64[taxels], counts; NaN for taxels that were not
        indented.
        """
        return np.asarray(np.diagonal(self.response).copy())

    @cached_property
    def median_response(self) -> float:
        """Median over indentations of the largest response of any taxel, in counts.

        The indented taxel itself is not used, because swapped lines move its response to another taxel.
        """
        indented = self.indented_taxels
        return float(np.median(self.response[indented].max(axis=1))) if len(indented) else float("nan")

    def compute_median_response(self, taxels: BoolArray) -> float:
        """Compute the median response of selected taxels to their own indentation, in counts.

        taxels: bool[taxels], the selected taxels; those that were not indented are ignored. Returns `median_response`
        if none of them was indented.
        """
        own = self.own_response[taxels]
        own = own[np.isfinite(own)]
        return float(np.median(own)) if len(own) else self.median_response

    @property
    def has_response(self) -> bool:
        """Whether the board responds to indentations."""
        return self.median_response > RESPONSE_ERRORS * float(np.median(self.error))


def find_response_faults(indentations: Indentations, limit: float) -> list[Fault]:
    """Find faults in the responses to indentations: dead taxels, open, shorted and swapped lines, or no response at
    all.

    limit: share of the median response below which a taxel is dead.
    """
    if not indentations.has_response:
        text = "no taxel responds to an indentation; check the contact between probe and board, and the layer"
        return [Fault("no response", BOARD, text, float("inf"))]
    own, median = indentations.own_response, indentations.median_response
    explained = np.zeros(len(own), dtype=bool)
    faults: list[Fault] = []
    for find in (_find_swapped_lines, _find_shorts):
        new_faults, new_explained = find(indentations, explained)
        faults += new_faults
        explained |= new_explained
    dead = (own < limit * median) & ~explained
    open_faults, on_open_line = _find_open_lines(indentations, dead, limit)
    faults += open_faults
    for taxel in np.nonzero(dead & ~on_open_line)[0]:
        share = float(own[taxel]) / median
        crossing = f"TX {indentations.kind.tx[taxel]}, RX {indentations.kind.rx[taxel]}"
        text = f"{max(share, 0.0):.0%} of the median response; check the layer at {crossing}"
        faults.append(Fault("dead taxel", format_taxel_name(int(taxel)), text, compute_severity_below(share, limit)))
    return faults


def _list_line_pairs(indentations: Indentations, axis: Axis, first: int, second: int) -> list[tuple[int, int]]:
    """List the pairs of taxels of the lines `first` and `second` on the same crossing line, in both orders.

    Only pairs whose first taxel was indented are listed.
    """
    kind = indentations.kind
    lines, crossing_lines = get_lines_of_taxels(kind, axis), get_lines_of_taxels(kind, Axis(1 - axis))
    taxel_at = {
        (int(line), int(crossing)): taxel
        for taxel, (line, crossing) in enumerate(zip(lines, crossing_lines, strict=True))
    }
    count = len(kind.crossings[0]) if axis is Axis.TX else len(kind.crossings)
    pairs = [
        (taxel_at[first, crossing], taxel_at[second, crossing])
        for crossing in range(count)
        if (first, crossing) in taxel_at and (second, crossing) in taxel_at
    ]
    indented = set(indentations.indented_taxels.tolist())
    return [ordered for pair in pairs for ordered in (pair, pair[::-1]) if ordered[0] in indented]


def _find_swapped_lines(indentations: Indentations, explained: BoolArray) -> tuple[list[Fault], BoolArray]:
    """Find pairs of exchanged lines: an indentation of one line appears on the other line.

    Lines count as exchanged if this is the case for more than half of the indentations. explained: not used, but
    `find_response_faults` calls this function and `_find_shorts` with the same arguments. Returns the faults and the
    taxels on swapped lines, bool[taxels].
    """
    kind, response, median = indentations.kind, indentations.response, indentations.median_response
    faults: list[Fault] = []
    on_swapped_line = np.zeros(len(explained), dtype=bool)
    for axis in Axis:
        lines = get_lines_of_taxels(kind, axis)
        for first, second in combinations(range(int(lines.max()) + 1), 2):
            pairs = _list_line_pairs(indentations, axis, first, second)
            if not pairs:
                continue
            is_swapped = [
                response[taxel, partner] > REACHED_SHARE * median
                and response[taxel, taxel] < REACHED_SHARE * response[taxel, partner]
                for taxel, partner in pairs
            ]
            if np.mean(is_swapped) <= 0.5:
                continue
            on_swapped_line |= (lines == first) | (lines == second)
            pins = " and ".join(format_connector_pin(axis, line, kind.tx_count) for line in (first, second))
            text = f"an indentation of one line appears on the other; check whether {pins} are exchanged"
            faults.append(Fault("swapped lines", format_line_pair_name(axis, first, second), text, float("inf")))
    return faults, on_swapped_line


def _find_shorts(indentations: Indentations, explained: BoolArray) -> tuple[list[Fault], BoolArray]:
    """Find shorted neighbouring lines: both respond to an indentation of either line.

    Only responses above 10 standard errors are evaluated. explained: bool[taxels], taxels on swapped lines, which are
    skipped. Returns the faults and the taxels on shorted lines, bool[taxels].
    """
    kind, response, error = indentations.kind, indentations.response, indentations.error
    faults: list[Fault] = []
    on_shorted_line = np.zeros(len(explained), dtype=bool)
    for axis in Axis:
        lines = get_lines_of_taxels(kind, axis)
        for index in range(int(lines.max())):
            pairs = [
                pair
                for pair in _list_line_pairs(indentations, axis, index, index + 1)
                if not explained[pair[0]] and response[pair] > 10.0 * error[pair[1]]
            ]
            if not pairs:
                continue
            share = float(
                np.median([response[taxel, partner] / max(response[taxel, taxel], 1.0) for taxel, partner in pairs])
            )
            if share < SHORT_SHARE_MIN:
                continue
            on_shorted_line |= (lines == index) | (lines == index + 1)
            pins = " and ".join(format_connector_pin(axis, line, kind.tx_count) for line in (index, index + 1))
            text = f"an indentation of one line appears on both ({share:.0%}); check between {pins}"
            faults.append(Fault("short", format_line_pair_name(axis, index, index + 1), text, share / SHORT_SHARE_MIN))
    return faults, on_shorted_line


def _find_open_lines(indentations: Indentations, dead: BoolArray, limit: float) -> tuple[list[Fault], BoolArray]:
    """Find open lines, on which no indented taxel responds.

    dead: bool[taxels], taxels without response. limit: share of the median response below which a taxel is dead. A line
    needs at least two indented taxels; a single taxel without response is a dead taxel. Returns the faults and the
    indented taxels on open lines, bool[taxels].
    """
    on_open_line = np.zeros(len(dead), dtype=bool)
    is_indented = np.isfinite(indentations.own_response)
    candidates = []
    for axis in Axis:
        lines = get_lines_of_taxels(indentations.kind, axis)
        for index in np.unique(lines):
            on_line = (lines == index) & is_indented
            if on_line.sum() >= 2 and dead[on_line].all():
                candidates.append((int(on_line.sum()), axis, int(index), on_line))
    faults = []
    for _, axis, index, on_line in sorted(candidates, key=lambda candidate: -candidate[0]):
        if not (on_line & ~on_open_line).any():
            continue
        on_open_line |= on_line
        share = float(np.median(indentations.own_response[on_line])) / indentations.median_response
        pin = format_connector_pin(axis, index, indentations.kind.tx_count)
        text = f"no taxel of the line responds ({max(share, 0.0):.0%}); check {pin} and its trace"
        faults.append(Fault("open line", format_line_name(axis, index), text, compute_severity_below(share, limit)))
    return faults, on_open_line


@dataclass(frozen=True)
class Crosstalk:
    """Mean response of taxels around an indented taxel, relative to the response of the indented taxel.

    `path`: along or between which lines; `share`: -1 to 1; `error`: its standard error, from the variance over
    indentations.
    """

    path: str
    share: float
    error: float

    @property
    def is_significant(self) -> bool:
        """Whether the crosstalk exceeds its standard error by the factor `CROSSTALK_ERRORS`."""
        return abs(self.share) > CROSSTALK_ERRORS * self.error


def measure_crosstalk(indentations: Indentations, ignored: BoolArray) -> list[Crosstalk]:
    """Measure the crosstalk along lines and between neighbouring lines, the largest first.

    Crosstalk is the response of a taxel that is not indented, divided by the response of the indented taxel. ignored:
    bool[taxels], taxels whose response a fault explains. Paths with fewer than two indentations are omitted.
    """
    tx, rx = indentations.kind.tx.astype(int), indentations.kind.rx.astype(int)
    shares: dict[str, list[float]] = {}
    for taxel in indentations.indented_taxels:
        own = indentations.response[taxel, taxel]
        if ignored[taxel] or own < REACHED_SHARE * indentations.median_response:
            continue
        row = np.where(ignored, np.nan, indentations.response[taxel] / own)
        row[taxel] = np.nan
        # A direct neighbour on the same line is on a neighbouring line of the other axis, so it counts as "between".
        masks = {
            "along TX lines": (tx == tx[taxel]) & (np.abs(rx - rx[taxel]) > 1),
            "along RX lines": (rx == rx[taxel]) & (np.abs(tx - tx[taxel]) > 1),
            "between TX lines": (np.abs(tx - tx[taxel]) == 1) & (rx == rx[taxel]),
            "between RX lines": (np.abs(rx - rx[taxel]) == 1) & (tx == tx[taxel]),
        }
        for path, mask in masks.items():
            values = row[mask & np.isfinite(row)]
            if len(values):
                shares.setdefault(path, []).append(float(values.mean()))
    results = [
        Crosstalk(path, float(np.mean(values)), float(np.std(values, ddof=1) / np.sqrt(len(values))))
        for path, values in shares.items()
        if len(values) > 1
    ]
    return sorted(results, key=lambda result: -abs(result.share))


def find_gain_fault(indentations: Indentations, signal_counts: float, minimum: float, maximum: float) -> Fault | None:
    """Return the gain fault of a board whose median signal is outside the permitted range.

    signal_counts: median signal of an indentation on healthy taxels; minimum, maximum: its permitted range. Returns
    None if the signal is inside the range or the force is unknown.
    """
    if not np.isfinite(indentations.force_n) or minimum <= signal_counts <= maximum:
        return None
    name, severity = "high gain", signal_counts / maximum
    if signal_counts < minimum:
        name, severity = "low gain", compute_severity_below(signal_counts, minimum)
    text = (
        f"an indentation of {indentations.force_n:g} N gives a signal of {signal_counts:.0f} counts, expected "
        f"{minimum:g} to {maximum:g}; check the code of the current source and the position of the layer"
    )
    return Fault(name, BOARD, text, severity)
