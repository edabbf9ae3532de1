"""How near our RMS and mean distances come to those that the thesis printed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

from taxel.thesis.tables import TWO, Table

FACTOR: Final = 1.5
"""Within which a distance counts as near."""

WORDS: Final = {"rms_m": "RMS", "mean_m": "mean"}


@dataclass(frozen=True)
class Distance:
    """One figure of one table: where it stands, and ours and the thesis's, metres."""

    table: str
    title: str
    row: str
    column: str
    ours: float
    thesis: float

    @property
    def ratio(self) -> float:
        """Ours over the thesis's."""
        return self.ours / self.thesis

    @property
    def apart(self) -> float:
        """The factor by which they differ, 1 or more."""
        return max(self.ratio, 1.0 / self.ratio) if self.ratio > 0 else float("inf")

    def __str__(self) -> str:
        figures = f"{1e3 * self.ours:.2f} mm ({1e3 * self.thesis:.2f}), {self.ratio:.3f} of the thesis's"
        return f"Table {self.table}, {self.row}, {WORDS[self.column]}: {figures}"


@dataclass(frozen=True)
class Nearness:
    """distances: all that both sides have, farthest first."""

    distances: tuple[Distance, ...]

    @property
    def near(self) -> int:
        """How many are within `FACTOR`."""
        return sum(one.apart <= FACTOR for one in self.distances)

    @property
    def one_line(self) -> str:
        """How many are near, and which is the farthest."""
        if not self.distances:
            return "no RMS or mean distance to compare"
        said = f"{self.near} of {len(self.distances)} RMS and mean distances within a factor {FACTOR:g} of the thesis's"
        return f"{said}; the farthest: {self.distances[0]}"

    def to_json(self) -> dict[str, Any]:
        """For files: the number, how many are near, and those that are not, or the farthest."""
        told = self.distances[: max(len(self.distances) - self.near, 1)]
        far = [{**vars(one), "ratio": one.ratio} for one in told]
        return {"distances": len(self.distances), "factor": FACTOR, "near": self.near, "farthest": far}


def nearness_of(tables: Sequence[Table]) -> Nearness:
    """Of all tables; Tables 5.3 and 5.5 print some of the appendix once more."""
    found = [
        Distance(table.number, table.title, ", ".join(row.key), column, ours, thesis)
        for table in tables
        for row in table.rows
        for column in TWO
        if column in table.columns and (ours := row.ours.get(column)) is not None
        if (thesis := row.thesis.get(column))
    ]
    return Nearness(tuple(sorted(found, key=lambda one: -one.apart)))
