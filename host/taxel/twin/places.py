"""Places of a skin at which a quantity can change: taxels, lines, boards, and the whole skin."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
from scipy.sparse import csr_array

from taxel.hand.errors import format_address
from taxel.recording.grasp_tables import SensorTable, TaxelTable
from taxel.types import BoolArray, FloatArray, IntArray

LEVELS: Final = ("taxel", "tx", "rx", "board", "skin")
"""Levels of places, from the smallest to the largest."""


@dataclass(frozen=True)
class Place:
    """One place. level: of `LEVELS`. address: of the board, -1 for the skin. number: taxel or line, -1 otherwise."""

    level: str
    address: int = -1
    name: str = ""
    number: int = -1

    def to_json(self) -> dict[str, object]:
        """The place as an event states it."""
        if self.level == "skin":
            return {"level": "skin"}
        found: dict[str, object] = {"level": self.level, "sensor": self.name, "address": format_address(self.address)}
        if self.level == "taxel":
            found["taxel"] = self.number
        elif self.level != "board":
            found["line"] = f"{self.level}{self.number}"
        return found

    def __str__(self) -> str:
        if self.level == "skin":
            return "the whole skin"
        board = f"{self.name} ({format_address(self.address)})"
        if self.level == "board":
            return f"board {board}"
        if self.level == "taxel":
            return f"taxel {self.number} of {board}"
        return f"{self.level.upper()} line {self.number} of {board}"


@dataclass(frozen=True, eq=False)
class Places:
    """All P places of a skin of n taxels, level after level.

    places: the places. members: sparse f64[P, n], 1 where a taxel belongs to a place. level: i64[P], index in `LEVELS`.
    board: i64[n], column of each taxel's board.
    """

    places: tuple[Place, ...]
    members: csr_array
    level: IntArray
    board: IntArray

    @classmethod
    def of(cls, taxels: TaxelTable, sensors: SensorTable) -> Places:
        """Places of the skin of a dataset. A line of one taxel is not listed: it cannot be distinguished from it."""
        board = sensors.index_of(taxels)
        found: list[Place] = []
        rows: list[IntArray] = []
        addresses = sensors.address.tolist()
        for column in range(sensors.s):
            own = np.flatnonzero(board == column)
            for number, taxel in enumerate(own.tolist()):
                found.append(Place("taxel", addresses[column], sensors.name[column], number))
                rows.append(np.array([taxel]))
        for level, lines in (("tx", taxels.tx), ("rx", taxels.rx)):
            for column in range(sensors.s):
                for line in np.unique(lines[board == column]).tolist():
                    own = np.flatnonzero((board == column) & (lines == line))
                    if len(own) > 1:
                        found.append(Place(level, addresses[column], sensors.name[column], line))
                        rows.append(own)
        for column in range(sensors.s):
            own = np.flatnonzero(board == column)
            if len(own) > 1:
                found.append(Place("board", addresses[column], sensors.name[column]))
                rows.append(own)
        if sensors.s > 1:
            found.append(Place("skin"))
            rows.append(np.arange(taxels.n))
        starts = np.concatenate([[0], np.cumsum([len(row) for row in rows])])
        columns = np.concatenate(rows)
        members = csr_array((np.ones(len(columns)), columns, starts), shape=(len(rows), taxels.n))
        return cls(tuple(found), members, np.array([LEVELS.index(place.level) for place in found]), board)

    def find_members(self, place: Place) -> BoolArray:
        """Taxels of a place, bool[n]."""
        row = self.places.index(place)
        taxels = np.zeros(len(self.board), dtype=bool)
        taxels[self.members.indices[self.members.indptr[row] : self.members.indptr[row + 1]]] = True
        return taxels

    def __len__(self) -> int:
        return len(self.places)

    @cached_property
    def board_members(self) -> csr_array:
        """Rows of `members` of the boards, f64[s, n], in the order of the sensor table."""
        boards = int(self.board.max()) + 1
        return csr_array(
            (np.ones(len(self.board)), (self.board, np.arange(len(self.board)))), shape=(boards, len(self.board))
        )

    @cached_property
    def prior(self) -> FloatArray:
        """Prior probability of each place, f64[P]: equal for the levels, and for the places of a level."""
        size = np.bincount(self.level, minlength=len(LEVELS))
        present = int((size > 0).sum())
        return np.asarray(1.0 / (present * size[self.level]))
