"""Median and worst result over several seeds."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from statistics import median, median_low
from typing import Any, Final

from taxel.thesis.findings import Finding, count_reproduced, evaluate_findings
from taxel.thesis.object_result import ObjectResult
from taxel.thesis.seed_result import SeedResult
from taxel.thesis.settings import SEARCH_SEEDS
from taxel.thesis.skill import ALL_STATISTICS, GROUPS, SkillReport, compute_skills

SCORED_COLUMNS: Final = tuple(ALL_STATISTICS)


@dataclass(frozen=True)
class Spread:
    """Median and worst of one number over the seeds."""

    median: float
    worst: float

    def to_json(self) -> dict[str, float]:
        """Convert to JSON values."""
        return {"median": self.median, "worst": self.worst}


@dataclass(frozen=True)
class FindingSummary:
    """One finding over all seeds.

    finding: the finding for the shown seed. reproduced: number of seeds that reproduce the finding. seeds: number of
    all seeds. numbers: median of the finding's number over the seeds, by object. example: the finding for the first
    seed that does not reproduce it; None if all seeds do.
    """

    finding: Finding
    reproduced: int
    seeds: int
    numbers: dict[str, float]
    example: Finding | None

    @property
    def is_reproduced(self) -> bool:
        """Whether more than half of the seeds reproduce the finding."""
        return 2 * self.reproduced > self.seeds

    @property
    def reason(self) -> str:
        """Reason why the first such seed does not reproduce the finding, or why it is not counted; "" if all do."""
        return "" if self.example is None else self.example.reason

    def to_json(self) -> dict[str, Any]:
        """Convert to JSON values: the finding for the shown seed, and medians, numbers of seeds and outcome over all
        seeds.
        """
        return {
            **self.finding.to_json(),
            "median_numbers": self.numbers,
            "seeds": self.seeds,
            "seeds_reproduced": self.reproduced,
            "reproduced": self.is_reproduced,
            "reason": self.reason,
        }


class Summary:
    """Findings and skills of one or more seeds."""

    def __init__(self, seeds: Sequence[SeedResult]) -> None:
        """Evaluate findings and skills of every seed. seeds: one or more."""
        self.seeds = tuple(seeds)
        self.findings = [evaluate_findings(result.objects, result.shapes) for result in self.seeds]
        self.skills: list[SkillReport] = [compute_skills(result.objects) for result in self.seeds]

    @cached_property
    def reproduced(self) -> Spread:
        """Number of reproduced findings: median and smallest number over the seeds."""
        return _spread([count_reproduced(findings)[0] for findings in self.findings], min)

    @cached_property
    def counted(self) -> int:
        """Number of counted findings: those that the printed tables do not contradict for every object."""
        return count_reproduced(self.findings[0])[1]

    @cached_property
    def shown(self) -> int:
        """Index of the seed whose tables and figures are shown: the first with the median number of reproduced
        findings.

        For an even number of seeds, the median is the smaller of the two middle numbers.
        """
        counts = [count_reproduced(findings)[0] for findings in self.findings]
        return counts.index(median_low(counts))

    @property
    def shown_results(self) -> tuple[ObjectResult, ...]:
        """Results of the shown seed."""
        return self.seeds[self.shown].objects

    @property
    def unseen(self) -> bool:
        """Whether no seed of these results was used in the search of settings; False for existing datasets."""
        return all(result.seed is not None and result.seed not in SEARCH_SEEDS for result in self.seeds)

    def get_skill(self, group: str, column: str) -> Spread | None:
        """Return median and worst skill of a group of tables in one column; None if no seed has a defined skill."""
        values = [report.groups[group, column].value for report in self.skills if (group, column) in report.groups]
        defined = [value for value in values if value is not None]
        return _spread(defined, min) if defined else None

    def summarise_findings(self) -> list[FindingSummary]:
        """Summarise every finding over all seeds, in the order of the findings' numbers."""
        result = []
        for finding in self.findings[self.shown]:
            same = [one for findings in self.findings for one in findings if one.number == finding.number]
            numbers = {name: median(one.numbers[name] for one in same) for name in finding.numbers}
            example = next((one for one in same if not one.is_reproduced), None)
            reproduced = sum(one.is_reproduced for one in same)
            result.append(FindingSummary(finding, reproduced, len(same), numbers, example))
        return result

    def summarise_shapes(self) -> dict[tuple[str, int], Spread]:
        """Return median and worst share of identified clouds, percent, over the seeds.

        Keys: kind of cloud (whole clouds or single approaches) and number of candidate models.
        """
        keys = dict.fromkeys((count.group, count.models) for result in self.seeds for count in result.shapes)
        shares: dict[tuple[str, int], list[float]] = {key: [] for key in keys}
        for result in self.seeds:
            for key, values in shares.items():
                counts = [count for count in result.shapes if (count.group, count.models) == key]
                total = sum(count.total for count in counts)
                values.append(100.0 * sum(count.identified for count in counts) / max(total, 1))
        return {key: _spread(values, min) for key, values in shares.items()}

    def to_json(self) -> dict[str, Any]:
        """Convert findings, skills and shapes to JSON values."""
        skills = [
            {"group": group, "statistic": column, **spread.to_json()}
            for group in GROUPS
            for column in SCORED_COLUMNS
            if (spread := self.get_skill(group, column)) is not None
        ]
        return {
            "seeds": [result.seed for result in self.seeds],
            "unseen": self.unseen,
            "shown_seed": self.seeds[self.shown].seed,
            "reproduced": self.reproduced.to_json(),
            "counted": self.counted,
            "findings": [item.to_json() for item in self.summarise_findings()],
            "skill": skills,
            "skill_of_shown_seed": self.skills[self.shown].to_json(),
            "shapes": [
                {"group": group, "models": models, **spread.to_json()}
                for (group, models), spread in self.summarise_shapes().items()
            ],
        }


def _spread(values: Sequence[float], worst: Callable[[Sequence[float]], float]) -> Spread:
    """Return median and worst of one or more numbers. worst: function that selects the worst number, `min` or `max`."""
    return Spread(float(median(values)), float(worst(values)))
