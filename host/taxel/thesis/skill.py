"""Skill of the reproduction: how much nearer the reproduced values are to the printed values than the best constant is.

skill = 1 - mean |ln(value / printed)| / mean |ln(constant / printed)|

The logarithm of the constant is the median of the logarithms of the compared printed values, which minimises the mean
absolute difference. A skill of 1 is a perfect reproduction; at a skill of 0 the reproduced values are as good as one
constant, and at a negative skill they are worse. The skill is computed separately for mean, RMS, maximum, standard
deviation and number of points.

Repeats. The thesis prints many values several times. Entries of the same quantity (the same cloud, that is object, side
and treatment, and for a distance also the same target) are counted once, in the first table that prints it. For
example, the first rows of Tables I-1 to I-3 and I-7 to I-9 repeat Table 5.3, and the rows of Tables I-13 to I-18 with
the object's own model repeat rows of Tables I-4 to I-6 and 5.5. A row whose printed values all equal those of an
earlier row of the same table is a copy and is not counted (Table I-6, N = 143, nSigma = 2).
"""

from collections.abc import Hashable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from taxel.cloud.distance import DistanceStats
from taxel.recording.grasp_format import ACTIVE_SIGNAL_COUNTS
from taxel.thesis.cloud_names import REAL, SIM, SPREAD
from taxel.thesis.object_result import ObjectResult
from taxel.thesis.printed import FORCE_FILTER, PRINTED_SOR, PROPAGATED, STAGES
from taxel.thesis.printed_result import build_printed_results

STATISTICS: Final = {"mean_m": "mean", "rms_m": "RMS", "max_m": "maximum", "std_m": "standard deviation"}
"""Columns that are scored, with the names of the statistics."""

POINTS: Final = "points"

ALL_STATISTICS: Final = {**STATISTICS, POINTS: "number of points"}

RAW, FORCE, SOR, PROPAGATION, TO_SIM, CROSS = (
    "raw",
    "force filter",
    "SOR",
    "contact propagation",
    "real to sim",
    "cross-shape",
)
GROUPS: Final = (RAW, FORCE, SOR, PROPAGATION, TO_SIM, CROSS)
"""Groups of tables. raw: Tables 5.2 and 5.3; force filter: I-1 to I-3; SOR: I-4 to I-6; contact propagation: 5.5 (I-7
to I-9); real to sim: I-10 to I-12; cross-shape: I-13 to I-18."""

MAX_LOG_RATIO: Final = float(np.log(1000.0))
"""Largest |ln ratio| of one entry: values that are 0, or that differ by more than a factor of 1000, are treated as if
they differed by this factor. Chosen; it affects only values that are wrong by orders of magnitude."""

_MIN_CONSTANT_ERROR: Final = 1e-9
"""Mean |ln ratio| of the constant up to which all printed values are treated as equal, so that no skill is defined."""


@dataclass(frozen=True)
class Entry:
    """One printed value of the thesis's tables and the reproduced value.

    table: number of the table. group: group of tables. row: description of the row. statistic: name of the column.
    quantity: key that is equal for entries of the same quantity in different tables. is_copy: whether the printed row
    repeats an earlier row of the same table.
    """

    table: str
    group: str
    row: str
    statistic: str
    value: float
    printed: float
    quantity: Hashable
    is_copy: bool

    @property
    def log_ratio(self) -> float:
        """|ln(value / printed)|, at most `MAX_LOG_RATIO`; `MAX_LOG_RATIO` for a value that is not above 0 or not
        finite.
        """
        if not (np.isfinite(self.value) and self.value > 0.0):
            return MAX_LOG_RATIO
        return min(abs(float(np.log(self.value / self.printed))), MAX_LOG_RATIO)


@dataclass(frozen=True)
class Skill:
    """Skill of a set of entries.

    entries: number of entries. error: mean |ln ratio| of the reproduced values. constant_error: mean |ln ratio| of the
    best constant. constant: the best constant, metres or points.
    """

    entries: int
    error: float
    constant_error: float
    constant: float

    @property
    def value(self) -> float | None:
        """The skill; None if one constant reproduces all printed values exactly, as for a single entry."""
        return 1.0 - self.error / self.constant_error if self.constant_error > _MIN_CONSTANT_ERROR else None

    def to_json(self) -> dict[str, Any]:
        """Convert the skill to JSON values."""
        return {
            "skill": self.value,
            "entries": self.entries,
            "mean_log_ratio": self.error,
            "mean_log_ratio_of_constant": self.constant_error,
            "constant": self.constant,
        }


def compute_skill(entries: Sequence[Entry]) -> Skill:
    """Compute the skill of one or more entries of the same statistic.

    The skill compares the mean |ln(reproduced / printed)| with the mean |ln(constant / printed)| of the best constant,
    the median of the printed values on a logarithmic scale. 1: perfect; 0: as good as the constant.
    """
    logarithms = np.log([entry.printed for entry in entries])
    constant = float(np.median(logarithms))
    error = float(np.mean([entry.log_ratio for entry in entries]))
    return Skill(len(entries), error, float(np.mean(np.abs(logarithms - constant))), float(np.exp(constant)))


@dataclass(frozen=True)
class SkillReport:
    """Skills by (group of tables, column), and by (number of the table, column)."""

    groups: dict[tuple[str, str], Skill]
    tables: dict[tuple[str, str], Skill]

    def to_json(self) -> dict[str, Any]:
        """Convert all skills to JSON values: one list of objects, each with the key "group" or "table", per kind."""
        return {
            kind: [
                {kind[:-1]: name, "statistic": column, **skill.to_json()} for (name, column), skill in skills.items()
            ]
            for kind, skills in (("groups", self.groups), ("tables", self.tables))
        }


def compute_skills(results: Sequence[ObjectResult]) -> SkillReport:
    """Compute the skills of all groups of tables and of all single tables.

    A skill is 1 for a perfect reproduction of the printed values, and 0 if the reproduced values are as good as one
    constant for all printed values.
    The skill of a group uses one constant for all its tables and objects, and contains every quantity once. The skill
    of a table uses a separate constant, and contains all rows but copies, even rows that another table repeats.
    """
    entries = list_entries(results)
    counted = select_counted(entries)
    groups = {
        (group, column): compute_skill(selected)
        for group in GROUPS
        for column in ALL_STATISTICS
        if (selected := [entry for entry in counted if (entry.group, entry.statistic) == (group, column)])
    }
    tables = {
        (table, column): compute_skill(selected)
        for table in dict.fromkeys(entry.table for entry in entries)
        for column in ALL_STATISTICS
        if (selected := [e for e in entries if (e.table, e.statistic) == (table, column) and not e.is_copy])
    }
    return SkillReport(groups, tables)


def select_counted(entries: Sequence[Entry]) -> list[Entry]:
    """Return the entries without those of copied rows, and with only the first entry of each quantity.

    A quantity is one statistic of one cloud to one target, which several tables may print.
    """
    result, seen = [], set()
    for entry in entries:
        if not entry.is_copy and entry.quantity not in seen:
            seen.add(entry.quantity)
            result.append(entry)
    return result


@dataclass(frozen=True)
class _Place:
    """Position of a printed row, and the quantity that it contains.

    table: number of the table. group: group of tables. row: description of the row. cloud: side and treatment of the
    measured cloud. target: CAD model or cloud to which distances are measured; None: the table prints only the number
    of points. columns: printed statistics.
    """

    table: str
    group: str
    row: str
    cloud: Hashable
    target: str | None
    columns: tuple[str, ...]


_DISTANCES: Final = tuple(STATISTICS)
_MATCH: Final = (*_DISTANCES, POINTS)


def list_entries(results: Sequence[ObjectResult]) -> list[Entry]:
    """List all entries of the thesis's tables with their reproduced values, in the order of `GROUPS`.

    A row whose printed values and target equal those of an earlier row of its table is marked as a copy.
    """
    printed_by_name = {printed.printed_name: printed for printed in build_printed_results()}
    entries: list[Entry] = []
    for group in GROUPS:
        for result in results:
            printed_result = printed_by_name[result.printed_name]
            seen: set[Hashable] = set()
            printed_rows = dict(_list_rows(printed_result))
            for place, stats in _list_rows(result):
                if place.group != group:
                    continue
                printed = printed_rows[place]
                content = (place.table, place.target, *(getattr(printed, column) for column in _MATCH))
                entries += _make_entries(place, result.printed_name, stats, printed, content in seen)
                seen.add(content)
    return entries


def _make_entries(
    place: _Place, name: str, stats: DistanceStats, printed: DistanceStats, is_copy: bool
) -> Iterator[Entry]:
    """Yield the entries of one printed row of an object, one for each column.

    place: position of the row in the tables. name: name of the object. stats, printed: reproduced and printed
    statistics. is_copy: whether the row repeats an earlier one. The key of a quantity does not contain the table, so
    that the same quantity in two tables has one key.
    """
    for column in place.columns:
        target = None if column == POINTS else place.target
        quantity = (name, place.cloud, target, column)
        value, printed_value = float(getattr(stats, column)), float(getattr(printed, column))
        row = f"{name}, {place.row}"
        yield Entry(place.table, place.group, row, column, value, printed_value, quantity, is_copy)


def _list_rows(result: ObjectResult) -> Iterator[tuple[_Place, DistanceStats]]:
    """Yield the rows of all tables for one object, with the statistics of `result`.

    Tables I-1 to I-12 are four kinds of tables, each for the three objects. Tables I-13 to I-18 are two tables for each
    object.
    """
    index = [printed.printed_name for printed in build_printed_results()].index(result.printed_name)
    own_model = result.printed_name
    raw_real: Hashable = (REAL, int(ACTIVE_SIGNAL_COUNTS))
    raw_sim: Hashable = (SIM, "")
    for side, cloud in ((REAL, raw_real), (SIM, raw_sim)):
        yield _Place("5.2", RAW, side, cloud, None, (POINTS,)), result.cad[side]
        yield _Place("5.3", RAW, side, cloud, own_model, _DISTANCES), result.cad[side]
    for threshold, stats in result.force.items():
        yield _Place(f"I-{index + 1}", FORCE, f"{threshold} counts", (REAL, threshold), own_model, _MATCH), stats
    for (n, sigma), stats in result.sor.items():
        selected = (REAL, FORCE_FILTER, n, sigma)
        yield _Place(f"I-{index + 4}", SOR, f"N {n}, nSigma {sigma:g}", selected, own_model, _MATCH), stats
    spread = (SIM, SPREAD)
    yield _Place(f"I-{index + 7}", RAW, SIM, raw_sim, own_model, _MATCH), result.cad[SIM]
    yield _Place(f"I-{index + 7}", PROPAGATION, PROPAGATED, spread, own_model, _MATCH), result.cad[SPREAD]
    cleaned = (REAL, FORCE_FILTER, *PRINTED_SOR[own_model])
    clouds: tuple[Hashable, ...] = (raw_real, (REAL, FORCE_FILTER), cleaned, cleaned)
    for stage, staged in zip(STAGES, clouds, strict=True):
        target = SPREAD if stage == STAGES[-1] else SIM
        yield _Place(f"I-{index + 10}", TO_SIM, stage, staged, target, _MATCH), result.to_sim[stage]
    for (side, mesh), stats in result.cross.items():
        treated: Hashable = cleaned if side == REAL else spread
        table = f"I-{13 + 2 * index + (side == SIM)}"
        yield _Place(table, CROSS, f"{side} on {mesh}", treated, mesh, _DISTANCES), stats
