"""One list of faults out of what several measurements say: a fault is named once, by the measurement that knows best.

A press tells which taxel lies where, so what it says of exchanged lines explains odd counts at rest. Counts at rest
tell an open line from a dead layer. A short is seen by both.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from taxel.hand import BoardKind
from taxel_tools.bench.analysis.fault import Axis, Fault, line_name, lines_of

_STRUCTURAL: Final = ("swapped lines", "short", "open line")
_GAIN: Final = ("low gain", "high gain")
"""What changes the response changes the level at rest too."""


def taxels_of(kind: BoardKind, place: str) -> NDArray[np.bool_]:
    """The taxels that a place means, bool[taxels]: of "TX 3", "RX 1 and RX 2", "taxel 17"; all of any other place."""
    chosen = np.zeros(kind.taxel_count, dtype=bool)
    for axis in Axis:
        lines = lines_of(kind, axis)
        for index in np.unique(lines).tolist():
            if line_name(axis, index) in place.split(" and "):
                chosen |= lines == index
    if place.startswith("taxel "):
        chosen[int(place.removeprefix("taxel "))] = True
    return chosen if chosen.any() else ~chosen


def _is_refuted(kind: BoardKind, short: Fault, pressed: list[Fault]) -> bool:
    """Whether all taxels of a short that was seen at rest answer presses as sound ones do.

    Lines of a very even board may measure the same by themselves; joined lines never answer alone.
    """
    taxels = taxels_of(kind, short.place)
    return not any((taxels & taxels_of(kind, fault.place)).any() for fault in pressed)


def conclude(kind: BoardKind, at_rest: list[Fault], pressed: list[Fault] | None) -> list[Fault]:
    """Merge what counts at rest and presses say (None: no presses were made), gravest first.

    What one group of faults explains, later ones do not name again; places of one group may overlap.
    """
    if pressed is None:
        pressed = []
    else:
        at_rest = [fault for fault in at_rest if fault.name != "short" or not _is_refuted(kind, fault, pressed)]
    kept: list[Fault] = []
    explained = np.zeros(kind.taxel_count, dtype=bool)
    groups = (
        [fault for fault in pressed if fault.name in ("swapped lines", "short")],
        [fault for fault in at_rest if fault.name in _STRUCTURAL],
        [fault for fault in pressed if fault.name == "open line"],
        [fault for fault in at_rest if fault.name == "dead taxel"],
        [fault for fault in at_rest if fault.name not in _STRUCTURAL],
        [fault for fault in pressed if fault.name not in _STRUCTURAL],
    )
    for group in groups:
        places = explained.copy()
        for fault in group:
            taxels = taxels_of(kind, fault.place)
            whole_board = bool(taxels.all())
            if not whole_board and not (taxels & ~explained).any():
                continue
            if any(fault.name == other.name and fault.place == other.place for other in kept):
                continue
            kept.append(fault)
            if not whole_board:
                places |= taxels
        explained = places
    if any(fault.name in _GAIN for fault in kept):
        kept = [fault for fault in kept if fault.name != "rest level"]
    return sorted(kept, key=lambda fault: -fault.severity)
