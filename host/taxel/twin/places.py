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
    """One taxel, TX line, RX line or board of a skin, or the whole skin.

    level: one of `LEVELS`. address: I2C address of the board, -1 for the skin. name: name of the board. number: number
    of the taxel on its board or of the line, -1 for a board and the skin.
    """

    level: str
    address: int = -1
    name: str = ""
    number: int = -1

    def to_json(self) -> dict[str, object]:
        """Return the JSON object that states the place in an event."""
        if self.level == "skin":
            return {"level": "skin"}
        found: dict[str, object] = {"level": self.level, "sensor": self.name, "address": format_address(self.address)}
        if self.level == "taxel":
            found["taxel"] = self.number
        elif self.level != "board":
            found["line"] = f"{self.level}{self.number}"
        return found

    def __str__(self) -> str:
        """Format the place as words in a message, such as "taxel 3 of palm (0x20)"."""
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
        """List all places of a skin.

        Lines and boards with a single taxel are left out, because they cannot be distinguished from this taxel; so is
        the whole skin if it has a single board.
        """
        board = sensors.index_of(taxels)
        found: list[Place] = []
        taxels_of_place: list[IntArray] = []
        addresses = sensors.address.tolist()
        for column in range(sensors.s):
            on_board = np.flatnonzero(board == column)
            for number, taxel in enumerate(on_board.tolist()):
                found.append(Place("taxel", addresses[column], sensors.name[column], number))
                taxels_of_place.append(np.array([taxel]))
        for level, lines in (("tx", taxels.tx), ("rx", taxels.rx)):
            for column in range(sensors.s):
                for line in np.unique(lines[board == column]).tolist():
                    on_line = np.flatnonzero((board == column) & (lines == line))
                    if len(on_line) > 1:
                        found.append(Place(level, addresses[column], sensors.name[column], line))
                        taxels_of_place.append(on_line)
        for column in range(sensors.s):
            on_board = np.flatnonzero(board == column)
            if len(on_board) > 1:
                found.append(Place("board", addresses[column], sensors.name[column]))
                taxels_of_place.append(on_board)
        if sensors.s > 1:
            found.append(Place("skin"))
            taxels_of_place.append(np.arange(taxels.n))
        starts = np.concatenate([[0], np.cumsum([len(members) for members in taxels_of_place])])
        columns = np.concatenate(taxels_of_place)
        members = csr_array((np.ones(len(columns)), columns, starts), shape=(len(taxels_of_place), taxels.n))
        return cls(tuple(found), members, np.array([LEVELS.index(place.level) for place in found]), board)

    def find_members(self, place: Place) -> BoolArray:
        """Return which taxels belong to a place, bool[n]. Raises ValueError for a place of another skin."""
        row = self.places.index(place)
        taxels = np.zeros(len(self.board), dtype=bool)
        taxels[self.members.indices[self.members.indptr[row] : self.members.indptr[row + 1]]] = True
        return taxels

    def __len__(self) -> int:
        return len(self.places)

    @cached_property
    def board_members(self) -> csr_array:
        """Membership of the taxels in the boards, sparse f64[s, n], boards in the order of the sensor table."""
        boards = int(self.board.max()) + 1
        return csr_array(
            (np.ones(len(self.board)), (self.board, np.arange(len(self.board)))), shape=(boards, len(self.board))
        )

    @cached_property
    def prior(self) -> FloatArray:
        """Prior probability of each place, f64[P]: equal for all present levels, and for all places of a level."""
        size = np.bincount(self.level, minlength=len(LEVELS))
        present = int((size > 0).sum())
        return np.asarray(1.0 / (present * size[self.level]))
