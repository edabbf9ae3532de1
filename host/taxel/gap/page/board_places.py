"""Places of the taxels of a board on its unrolled sheet.

A report contains the TX and RX line of each taxel, which are its place on many boards. The boards of a packaged hand
with another layout are recognised by their kind and their lines.
"""

from collections.abc import Sequence
from functools import lru_cache

from taxel.hand import BoardKind, list_packaged_hands, load_hand

Places = tuple[tuple[int, ...], tuple[int, ...]]
"""Row (row 0 is distal) and column (column 0 is left, seen from outside) of each taxel."""


def find_places(kind: str, tx: Sequence[int], rx: Sequence[int]) -> Places:
    """Return row and column of each taxel of a board on the unrolled sheet.

    kind: name of the board kind. tx, rx: TX and RX line of each taxel, in the order of the report. If a packaged board
    kind has this name and these lines, its places are returned; otherwise the TX lines as rows and the RX lines as
    columns.
    """
    lines = (tuple(tx), tuple(rx))
    for packaged in _list_kinds_with_layout().get(kind, ()):
        if lines == (tuple(packaged.tx.tolist()), tuple(packaged.rx.tolist())):
            return tuple(packaged.row.tolist()), tuple(packaged.column.tolist())
    return lines


@lru_cache(maxsize=1)
def _list_kinds_with_layout() -> dict[str, list[BoardKind]]:
    """Return the board kinds of the packaged hands whose taxel places differ from their lines, by name of the kind."""
    kinds: dict[str, list[BoardKind]] = {}
    for name in list_packaged_hands():
        for kind in {board.kind.name: board.kind for board in load_hand(name).boards}.values():
            if kind.layout is not None:
                kinds.setdefault(kind.name, []).append(kind)
    return kinds
