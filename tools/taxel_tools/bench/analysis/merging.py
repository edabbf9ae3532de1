"""Merging of the faults that several measurements detect, so that each fault is reported once.

Indentations identify the taxel at each crossing, so they explain missing crossings by exchanged lines. Raw counts at
rest distinguish an open line from a dead layer. Both measurements detect a short.
"""

from typing import Final

import numpy as np

from taxel.hand import BoardKind
from taxel.types import BoolArray
from taxel_tools.bench.analysis.fault import Axis, Fault, format_line_name, get_lines_of_taxels

_STRUCTURAL: Final = ("swapped lines", "short", "open line")
_GAIN: Final = ("low gain", "high gain")
"""Gain faults, which also change the raw counts at rest."""


def find_taxels(kind: BoardKind, place: str) -> BoolArray:
    """Return the taxels of a board at the place of a fault, bool[taxels].

    place: "TX 3", "RX 1 and RX 2" or "taxel 17"; any other place, such as "board", selects all taxels.
    """
    mask = np.zeros(kind.taxel_count, dtype=bool)
    for axis in Axis:
        lines = get_lines_of_taxels(kind, axis)
        for index in np.unique(lines).tolist():
            if format_line_name(axis, index) in place.split(" and "):
                mask |= lines == index
    if place.startswith("taxel "):
        mask[int(place.removeprefix("taxel "))] = True
    return mask if mask.any() else ~mask


def _is_refuted(kind: BoardKind, short: Fault, response_faults: list[Fault]) -> bool:
    """Return whether indentations refute a short that was detected at rest.

    response_faults: faults found by indentations. The short is refuted if none of these faults concerns a taxel on the
    two lines: healthy lines may measure equal counts by chance, but shorted lines never respond independently.
    """
    taxels = find_taxels(kind, short.place)
    return not any((taxels & find_taxels(kind, fault.place)).any() for fault in response_faults)


def merge_faults(kind: BoardKind, rest_faults: list[Fault], response_faults: list[Fault] | None) -> list[Fault]:
    """Merge the faults of a board found at rest and under indentation, in order of decreasing severity.

    response_faults: None if no taxel was indented. A short at rest that the indentations refute is omitted. The faults
    are processed in groups, the most certain measurement first. A fault is omitted if it repeats an earlier fault (same
    name and place), or if faults of earlier groups explain all its taxels; faults of one group may overlap. A fault of
    the whole board explains no taxels, and no other fault explains it, with one exception: a gain fault explains a
    wrong level at rest ("rest level").
    """
    if response_faults is None:
        response_faults = []
    else:
        rest_faults = [
            fault for fault in rest_faults if fault.name != "short" or not _is_refuted(kind, fault, response_faults)
        ]
    merged: list[Fault] = []
    explained = np.zeros(kind.taxel_count, dtype=bool)
    groups = (
        [fault for fault in response_faults if fault.name in ("swapped lines", "short")],
        [fault for fault in rest_faults if fault.name in _STRUCTURAL],
        [fault for fault in response_faults if fault.name == "open line"],
        [fault for fault in rest_faults if fault.name == "dead taxel"],
        [fault for fault in rest_faults if fault.name not in _STRUCTURAL],
        [fault for fault in response_faults if fault.name not in _STRUCTURAL],
    )
    for group in groups:
        explained_by_group = explained.copy()
        for fault in group:
            taxels = find_taxels(kind, fault.place)
            is_board_fault = bool(taxels.all())
            if not is_board_fault and not (taxels & ~explained).any():
                continue
            if any(fault.name == other.name and fault.place == other.place for other in merged):
                continue
            merged.append(fault)
            if not is_board_fault:
                explained_by_group |= taxels
        explained = explained_by_group
    if any(fault.name in _GAIN for fault in merged):
        merged = [fault for fault in merged if fault.name != "rest level"]
    return sorted(merged, key=lambda fault: -fault.severity)
