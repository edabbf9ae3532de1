"""Agreement of the reproduced RMS and mean distances with the printed ones."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

from taxel.thesis.tables import RMS_AND_MEAN, Table

FACTOR: Final = 1.5
"""Largest ratio of a reproduced and a printed distance, in either direction, that counts as agreement. Chosen for this
project, not calibrated: a larger factor makes `count_within_factor` larger."""

COLUMN_NAMES: Final = {"rms_m": "RMS", "mean_m": "mean"}


@dataclass(frozen=True)
class DistanceComparison:
    """Comparison of one distance of a table of the thesis: reproduced and printed value, metres."""

    table: str
    title: str
    row: str
    column: str
    value_m: float
    printed_m: float

    @property
    def ratio(self) -> float:
        """Reproduced distance divided by the printed one."""
        return self.value_m / self.printed_m

    @property
    def factor(self) -> float:
        """Ratio of the larger distance to the smaller one."""
        return max(self.ratio, 1.0 / self.ratio) if self.ratio > 0 else float("inf")

    def __str__(self) -> str:
        values = f"{1e3 * self.value_m:.2f} mm, printed {1e3 * self.printed_m:.2f} mm, ratio {self.ratio:.3f}"
        return f"Table {self.table}, {self.row}, {COLUMN_NAMES[self.column]}: {values}"

    def to_json(self) -> dict[str, Any]:
        """Convert the comparison of a reproduced and a printed distance to JSON values."""
        return {
            "table": self.table,
            "title": self.title,
            "row": self.row,
            "column": self.column,
            "ours": self.value_m,
            "thesis": self.printed_m,
            "ratio": self.ratio,
        }


@dataclass(frozen=True)
class DistanceAgreement:
    """Comparison of all distances that are both reproduced and printed in the thesis, the largest deviation first."""

    distances: tuple[DistanceComparison, ...]

    @property
    def count_within_factor(self) -> int:
        """Number of distances within `FACTOR` of the printed ones."""
        return sum(item.factor <= FACTOR for item in self.distances)

    @property
    def summary(self) -> str:
        """Summarise the agreement in one line: number of distances within `FACTOR`, and the largest deviation."""
        if not self.distances:
            return "no RMS or mean distance to compare"
        counts = f"{self.count_within_factor} of {len(self.distances)}"
        text = f"{counts} RMS and mean distances within a factor {FACTOR:g} of the printed ones"
        return f"{text}; largest deviation: {self.distances[0]}"

    def to_json(self) -> dict[str, Any]:
        """Convert the agreement to JSON values, with every distance beyond `FACTOR`, or else the largest deviation."""
        listed = self.distances[: max(len(self.distances) - self.count_within_factor, 1)]
        return {
            "distances": len(self.distances),
            "factor": FACTOR,
            "near": self.count_within_factor,
            "farthest": [item.to_json() for item in listed],
        }


def compare_distances(tables: Sequence[Table]) -> DistanceAgreement:
    """Compare the reproduced RMS and mean distances of all tables with the printed ones.

    Tables 5.3 and 5.5 of the thesis repeat some distances of its appendix.
    """
    comparisons = [
        DistanceComparison(table.number, table.title, ", ".join(row.key), column, value, printed)
        for table in tables
        for row in table.rows
        for column in RMS_AND_MEAN
        if column in table.columns and (value := row.values.get(column)) is not None
        if (printed := row.printed_values.get(column))
    ]
    return DistanceAgreement(tuple(sorted(comparisons, key=lambda item: -item.factor)))
