"""The thesis's twelve findings, each judged on our results: reproduced or not, with its numbers."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from itertools import pairwise
from typing import Any, Final

from taxel.cloud.distance import DistanceStats
from taxel.thesis.matching import CLEANED, FILTERED, REAL, SIM, SPREAD, ObjectResult
from taxel.thesis.printed import FORCE_FILTER, STAGES
from taxel.thesis.tables import contributions

Results = Sequence[ObjectResult]


@dataclass(frozen=True)
class Finding:
    """number, says: the finding. numbers: by object's thesis word; thesis: the same there. reproduced: for all."""

    number: int
    says: str
    unit: str
    numbers: dict[str, float]
    thesis: tuple[float, ...]
    holds: dict[str, bool]

    @property
    def reproduced(self) -> bool:
        """For every object."""
        return all(self.holds.values())

    def to_json(self) -> dict[str, Any]:
        """For files."""
        return {**asdict(self), "reproduced": self.reproduced}


@dataclass(frozen=True)
class Other:
    """What the thesis reports beside its findings, never fitted: ours and the thesis's."""

    says: str
    numbers: dict[str, str]
    thesis: str


def findings(results: Results) -> list[Finding]:
    """All twelve. results: in the thesis's order of objects."""
    return [
        _each(
            results,
            1,
            "real over simulated points: 1.4 to 1.9",
            "1",
            (1.67, 1.86, 1.45),
            _more,
            _within(1.4, 1.9),
        ),
        _each(
            results,
            2,
            "real over simulated mean distance to CAD: at least 2.5",
            "1",
            (4.5, 5.8, 3.2),
            _farther,
            _above(2.5),
        ),
        _each(
            results,
            3,
            "the force filter, 150 to 190 counts, lowers the real mean and RMS (number: fall of the mean)",
            "%",
            (2.1, 14.8, 6.8),
            lambda one: _fall(one.cad[REAL].mean_m, one.cad[FILTERED].mean_m),
            lambda one, fall: fall > 0 and one.cad[FILTERED].rms_m < one.cad[REAL].rms_m,
        ),
        _each(
            results,
            4,
            "it removes 5 to 20 % of the points",
            "%",
            (12.4, 11.8, 9.2),
            lambda one: _removed(one, FORCE_FILTER),
            _within(5.0, 20.0),
        ),
        _each(
            results,
            5,
            "at 320 counts at least 75 % are removed",
            "%",
            (84.5, 80.5, 86.4),
            lambda one: _removed(one, 320),
            _above(75.0),
        ),
        _each(
            results,
            6,
            "SOR after it lowers the real mean and removes at most 12 % (number: mean after, mm)",
            "mm",
            (2.90, 2.71, 4.42),
            lambda one: 1e3 * one.cad[CLEANED].mean_m,
            lambda one, _: (
                one.cad[CLEANED].mean_m < one.cad[FILTERED].mean_m
                and one.cad[CLEANED].points >= 0.88 * one.cad[FILTERED].points
            ),
        ),
        _each(
            results,
            7,
            "the largest real-to-sim distance falls more by SOR than by the force filter (number: by SOR)",
            "%",
            (63.0, 45.0, 27.0),
            lambda one: _fall(one.to_sim[STAGES[1]].max_m, one.to_sim[STAGES[2]].max_m),
            lambda one, fall: fall > _fall(one.to_sim[STAGES[0]].max_m, one.to_sim[STAGES[1]].max_m),
        ),
        _spread(results),
        _each(
            results,
            9,
            "propagated simulated over raw real points: 0.85 to 1.15",
            "1",
            (0.99, 1.03, 0.94),
            lambda one: one.cad[SPREAD].points / max(one.cad[REAL].points, 1),
            _within(0.85, 1.15),
        ),
        _stages(results),
        _each(
            results,
            11,
            "contact propagation is the largest step in mean and RMS, over half of the mean's fall",
            "%",
            (54.0, 72.0, 61.0),
            lambda one: _shares(one, "mean_m")[-1],
            lambda one, share: share > 50.0 and all(_shares(one, key)[-1] == max(_shares(one, key)) for key in KEYS),
        ),
        _told(results),
    ]


KEYS: Final = ("mean_m", "rms_m")

Judge = Callable[[ObjectResult, float], bool]


def _each(
    results: Results,
    number: int,
    says: str,
    unit: str,
    thesis: tuple[float, ...],
    figure: Callable[[ObjectResult], float],
    judge: Judge,
) -> Finding:
    numbers = {one.thesis: figure(one) for one in results}
    holds = {one.thesis: bool(judge(one, numbers[one.thesis])) for one in results}
    return Finding(number, says, unit, numbers, thesis, holds)


def _within(low: float, high: float) -> Judge:
    return lambda _, value: low <= value <= high


def _above(low: float) -> Judge:
    return lambda _, value: value >= low


def _more(one: ObjectResult) -> float:
    return one.cad[REAL].points / max(one.cad[SIM].points, 1)


def _farther(one: ObjectResult) -> float:
    return one.cad[REAL].mean_m / one.cad[SIM].mean_m


def _fall(before: float, after: float) -> float:
    return 100.0 * (before - after) / before


def _removed(one: ObjectResult, threshold: int) -> float:
    return _fall(one.cad[REAL].points, one.force[threshold].points)


def _spread(results: Results) -> Finding:
    numbers = {one.thesis: one.cad[SPREAD].mean_m / one.cad[SIM].mean_m for one in results}
    least = min(numbers.values())
    holds = {name: value >= 1.15 and (name == "triangular") == (value == least) for name, value in numbers.items()}
    says = "propagation multiplies the simulated mean distance to CAD by 1.15 at least, the triangular prism's least"
    return Finding(8, says, "1", numbers, (2.05, 2.11, 1.24), holds)


def _stages(results: Results) -> Finding:
    numbers = {one.thesis: _fall(one.to_sim[STAGES[0]].mean_m, one.to_sim[STAGES[-1]].mean_m) for one in results}
    least = min(numbers.values())
    holds = {
        one.thesis: all(
            getattr(one.to_sim[after], key) < getattr(one.to_sim[before], key)
            for before, after in pairwise(STAGES)
            for key in KEYS
        )
        and (one.thesis == "triangular") == (numbers[one.thesis] == least)
        for one in results
    }
    says = "real-to-sim mean and RMS fall at every stage; the triangular prism's mean falls least (number: whole fall)"
    return Finding(10, says, "%", numbers, (47.0, 44.0, 21.0), holds)


def _shares(one: ObjectResult, key: str) -> list[float]:
    return contributions({stage: getattr(one.to_sim[stage], key) for stage in STAGES})


def _told(results: Results) -> Finding:
    numbers, holds = {}, {}
    for one in results:
        margins = {side: margin(one, side) for side in (REAL, SIM)}
        best = all(
            min(own, key=lambda word: getattr(own[word], key)) == one.thesis
            for own in (_own(one, side) for side in (REAL, SIM))
            for key in KEYS
        )
        numbers[one.thesis] = margins[REAL]
        holds[one.thesis] = best and margins[REAL] < margins[SIM]
    says = "all clouds match their own CAD best; the real margins lie below the simulated ones (number: real margin)"
    return Finding(12, says, "1", numbers, (3.66, 1.32, 1.11), holds)


def _own(one: ObjectResult, side: str) -> dict[str, DistanceStats]:
    return {mesh: match for (cloud, mesh), match in one.cross.items() if cloud == side}


def margin(one: ObjectResult, side: str) -> float:
    """Mean distance to the best other CAD model over that to the object's own."""
    own = _own(one, side)
    others = [match.mean_m for mesh, match in own.items() if mesh != one.thesis]
    return min(others) / own[one.thesis].mean_m if others else float("inf")


def others(results: Results) -> list[Other]:
    """The surge from 190 to 200 counts, the settings that are best, and what the text says of them."""
    surge = {one.thesis: f"{_removed(one, 200) - _removed(one, 190):.1f} %" for one in results}
    falls = {
        one.thesis: "above 190" if min(one.force, key=lambda t: one.force[t].mean_m) > FORCE_FILTER else "at most 190"
        for one in results
    }
    sor = {one.thesis: "yes" if _shares(one, "mean_m")[1] > _shares(one, "mean_m")[0] else "no" for one in results}
    best = {one.thesis: ", ".join(f"{n} / {sigma:g}" for n, sigma in best_sors(one)) for one in results}
    return [
        Other("points that go between 190 and 200 counts", surge, "16, 27, 12.5 %"),
        Other("threshold with the smallest mean distance", falls, "text: above 190; its table: not for the cylinder"),
        Other(
            "SOR settings (N / deviations, N as the thesis counts) with the smallest mean distance, to 0.01 mm",
            best,
            "20 / 1; 20 / 2, 2759 / 2, 690 / 3; 716 / 2",
        ),
        Other("SOR contributes more than the force filter", sor, "text: yes; its table: not for the cylinder"),
    ]


PRINTED_M: Final = 1e-5
"""To which the thesis prints distances."""


def best_sors(one: ObjectResult) -> list[tuple[int, float]]:
    """All settings of the sweep with the smallest mean distance to the CAD model, as the thesis prints it."""
    printed = {key: round(match.mean_m / PRINTED_M) for key, match in one.sor.items()}
    return [key for key, value in printed.items() if value == min(printed.values())]
