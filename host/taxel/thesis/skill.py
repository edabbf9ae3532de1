"""Skill of the reproduction: how much nearer its values are to the printed ones than the best single constant is.

skill = 1 - mean |ln(value / printed)| / mean |ln(constant / printed)|

The constant is the best one for the entries compared: the median of their logarithms, which minimises the mean
absolute difference. A skill of 1 is a perfect reproduction, 0 is as good as one constant, negative is worse than it.
Mean, RMS, maximum, standard deviation and number of points have a skill each.

Repeats. The thesis prints many values several times. An entry counts once, in the first table that prints it, if a
later entry is the same quantity: the same cloud (object, side, treatment), for a distance also the same target. So the
first rows of Tables I-1 to I-3 and I-7 to I-9 are those of Table 5.3, the own models of Tables I-13 to I-18 are rows of
Tables I-4 to I-6 and 5.5. A row whose printed values all equal those of an earlier row of the same table is a copy
of this row, and does not count (Table I-6, N = 143, nSigma = 2).
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
"""Largest |ln ratio| of one entry: a value of 0, or one that differs by more than a factor 1000, counts as this factor.
Chosen; affects only values that are wrong by orders of magnitude."""

_MIN_CONSTANT_ERROR: Final = 1e-9
"""Mean |ln ratio| of the constant below which all entries count as equal, and no skill is defined."""


@dataclass(frozen=True)
class Entry:
    """One printed value and the reproduced one.

    table: number. group: of tables. row: text. statistic: column. quantity: the same for entries that are the same
    quantity. is_copy: the printed row repeats an earlier one.
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
        """|ln(value / printed)|, at most `MAX_LOG_RATIO`."""
        if not (np.isfinite(self.value) and self.value > 0.0):
            return MAX_LOG_RATIO
        return min(abs(float(np.log(self.value / self.printed))), MAX_LOG_RATIO)


@dataclass(frozen=True)
class Skill:
    """Skill of some entries.

    entries: their number. error: mean |ln ratio| of the reproduced values. constant_error: that of the constant.
    constant: the best one, in metres or points.
    """

    entries: int
    error: float
    constant_error: float
    constant: float

    @property
    def value(self) -> float | None:
        """The skill; None for entries that one constant reproduces exactly, such as a single entry."""
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
    """Compute the skill of one or more entries of one statistic."""
    logarithms = np.log([entry.printed for entry in entries])
    constant = float(np.median(logarithms))
    error = float(np.mean([entry.log_ratio for entry in entries]))
    return Skill(len(entries), error, float(np.mean(np.abs(logarithms - constant))), float(np.exp(constant)))


@dataclass(frozen=True)
class SkillReport:
    """Skills by group and statistic, and by table and statistic; names of statistics are columns."""

    groups: dict[tuple[str, str], Skill]
    tables: dict[tuple[str, str], Skill]

    def to_json(self) -> dict[str, Any]:
        """Convert all skills to JSON values."""
        return {
            kind: [
                {kind[:-1]: name, "statistic": column, **skill.to_json()} for (name, column), skill in skills.items()
            ]
            for kind, skills in (("groups", self.groups), ("tables", self.tables))
        }


def compute_skills(results: Sequence[ObjectResult]) -> SkillReport:
    """Compute the skills of all groups and tables.

    A group has one constant for all its tables and objects and counts every quantity once. A table has its own
    constant; its rows count although another table repeats them, but not if they are copies of a row.
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
    """Return the entries without copied rows and without quantities that an earlier entry has."""
    result, seen = [], set()
    for entry in entries:
        if not entry.is_copy and entry.quantity not in seen:
            seen.add(entry.quantity)
            result.append(entry)
    return result


@dataclass(frozen=True)
class _Place:
    """A printed row: its table, group, text, and what it measures.

    cloud: side and treatment of the cloud. target: CAD model or cloud to which distances are measured; None: the table
    prints only the number of points. columns: printed statistics.
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
    """List all entries of the thesis's tables with their reproduced values, in the order of `GROUPS`."""
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
    """Yield the entries of one printed row of an object. is_copy: whether the row repeats an earlier one."""
    for column in place.columns:
        target = None if column == POINTS else place.target
        quantity = (name, place.cloud, target, column)
        value, printed_value = float(getattr(stats, column)), float(getattr(printed, column))
        row = f"{name}, {place.row}"
        yield Entry(place.table, place.group, row, column, value, printed_value, quantity, is_copy)


def _list_rows(result: ObjectResult) -> Iterator[tuple[_Place, DistanceStats]]:
    """Yield the rows of all tables of one object, with their statistics."""
    index = [printed.printed_name for printed in build_printed_results()].index(result.printed_name)
    own = result.printed_name
    raw_real: Hashable = (REAL, int(ACTIVE_SIGNAL_COUNTS))
    raw_sim: Hashable = (SIM, "")
    for side, cloud in ((REAL, raw_real), (SIM, raw_sim)):
        yield _Place("5.2", RAW, side, cloud, None, (POINTS,)), result.cad[side]
        yield _Place("5.3", RAW, side, cloud, own, _DISTANCES), result.cad[side]
    for threshold, stats in result.force.items():
        yield _Place(f"I-{index + 1}", FORCE, f"{threshold} counts", (REAL, threshold), own, _MATCH), stats
    for (n, sigma), stats in result.sor.items():
        selected = (REAL, FORCE_FILTER, n, sigma)
        yield _Place(f"I-{index + 4}", SOR, f"N {n}, nSigma {sigma:g}", selected, own, _MATCH), stats
    spread = (SIM, SPREAD)
    yield _Place(f"I-{index + 7}", RAW, SIM, raw_sim, own, _MATCH), result.cad[SIM]
    yield _Place(f"I-{index + 7}", PROPAGATION, PROPAGATED, spread, own, _MATCH), result.cad[SPREAD]
    cleaned = (REAL, FORCE_FILTER, *PRINTED_SOR[own])
    clouds: tuple[Hashable, ...] = (raw_real, (REAL, FORCE_FILTER), cleaned, cleaned)
    for stage, staged in zip(STAGES, clouds, strict=True):
        target = SPREAD if stage == STAGES[-1] else SIM
        yield _Place(f"I-{index + 10}", TO_SIM, stage, staged, target, _MATCH), result.to_sim[stage]
    for (side, mesh), stats in result.cross.items():
        treated: Hashable = cleaned if side == REAL else spread
        table = f"I-{13 + 2 * index + (side == SIM)}"
        yield _Place(table, CROSS, f"{side} on {mesh}", treated, mesh, _DISTANCES), stats
