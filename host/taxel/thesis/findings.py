"""The twelve findings of the thesis, evaluated on the reproduced results."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Final

from taxel.cloud.distance import DistanceStats
from taxel.thesis.matching import CLEANED, FILTERED, REAL, SIM, SPREAD, ObjectResult
from taxel.thesis.printed import FORCE_FILTER, STAGES
from taxel.thesis.tables import compute_contributions

Results = Sequence[ObjectResult]


@dataclass(frozen=True)
class Finding:
    """A finding of the thesis, evaluated with the reproduced results.

    numbers, holds: number of the finding, and whether the finding holds, by printed name of the object. printed: the
    numbers printed in the thesis.
    """

    number: int
    statement: str
    unit: str
    numbers: dict[str, float]
    printed: tuple[float, ...]
    holds: dict[str, bool]

    @property
    def is_reproduced(self) -> bool:
        """Whether the finding holds for every object."""
        return all(self.holds.values())

    def to_json(self) -> dict[str, Any]:
        """Convert the finding of the thesis and its evaluation to JSON values."""
        return {
            "number": self.number,
            "says": self.statement,
            "unit": self.unit,
            "numbers": self.numbers,
            "thesis": self.printed,
            "holds": self.holds,
            "reproduced": self.is_reproduced,
        }


@dataclass(frozen=True)
class FurtherResult:
    """A result of the thesis in addition to its findings; no setting was fitted to it. numbers: texts by object.

    printed: the printed result, as text.
    """

    title: str
    numbers: dict[str, str]
    printed: str

    def to_json(self) -> dict[str, Any]:
        """Convert the result to JSON values."""
        return {"says": self.title, "numbers": self.numbers, "thesis": self.printed}


@dataclass(frozen=True)
class _Criterion:
    """Criterion of a finding of the thesis for one object: a number, and whether the finding holds with this number."""

    number: int
    statement: str
    unit: str
    printed: tuple[float, ...]
    compute: Callable[[ObjectResult], float]
    holds: Callable[[ObjectResult, float], bool]

    def evaluate(self, results: Results) -> Finding:
        """Compute the number of this criterion for every object, and whether the finding holds for it."""
        numbers = {result.printed_name: self.compute(result) for result in results}
        holds = {result.printed_name: bool(self.holds(result, numbers[result.printed_name])) for result in results}
        return Finding(self.number, self.statement, self.unit, numbers, self.printed, holds)


def evaluate_findings(results: Results) -> list[Finding]:
    """Evaluate all twelve findings of the thesis. results: in the order of the objects in the thesis."""
    findings = [criterion.evaluate(results) for criterion in _CRITERIA]
    findings += [_evaluate_propagation(results), _evaluate_stages(results), _evaluate_cross_match(results)]
    return sorted(findings, key=lambda finding: finding.number)


KEYS: Final = ("mean_m", "rms_m")


def _within(low: float, high: float) -> Callable[[ObjectResult, float], bool]:
    """Return a predicate: whether the number of a finding is from `low` to `high`."""
    return lambda _, value: low <= value <= high


def _at_least(low: float) -> Callable[[ObjectResult, float], bool]:
    """Return a predicate: whether the number of a finding is at least `low`."""
    return lambda _, value: value >= low


def _point_ratio(result: ObjectResult) -> float:
    """Return the number of points of the real cloud divided by that of the simulated cloud."""
    return result.cad[REAL].points / max(result.cad[SIM].points, 1)


def _mean_ratio(result: ObjectResult) -> float:
    """Return the mean distance to the CAD model of the real cloud divided by that of the simulated cloud."""
    return result.cad[REAL].mean_m / result.cad[SIM].mean_m


def _decrease(before: float, after: float) -> float:
    """Compute the relative decrease from `before` to `after`, percent."""
    return 100.0 * (before - after) / before


def _removed_share(result: ObjectResult, threshold: int) -> float:
    """Compute the share of the real points that the force filter removes at a threshold in counts, percent."""
    return _decrease(result.cad[REAL].points, result.force[threshold].points)


def _step_shares(result: ObjectResult, key: str) -> list[float]:
    """Compute the share of each treatment step in the total decrease of a distance, percent.

    key: kind of distance, such as "mean_m".
    """
    return compute_contributions({stage: getattr(result.to_sim[stage], key) for stage in STAGES})


def _is_propagation_largest(result: ObjectResult, share: float) -> bool:
    """Whether contact propagation causes more than half, and the largest share, of the decrease of the distances."""
    return share > 50.0 and all(_step_shares(result, key)[-1] == max(_step_shares(result, key)) for key in KEYS)


def _does_sor_improve(result: ObjectResult, _: float) -> bool:
    """Whether the outlier filter (SOR) decreases the mean distance and keeps at least 88 % of the points."""
    filtered, cleaned = result.cad[FILTERED], result.cad[CLEANED]
    return cleaned.mean_m < filtered.mean_m and cleaned.points >= 0.88 * filtered.points


_CRITERIA: Final = (
    _Criterion(1, "real over simulated points: 1.4 to 1.9", "1", (1.67, 1.86, 1.45), _point_ratio, _within(1.4, 1.9)),
    _Criterion(
        2, "real over simulated mean distance to CAD: at least 2.5", "1", (4.5, 5.8, 3.2), _mean_ratio, _at_least(2.5)
    ),
    _Criterion(
        3,
        "the force filter, 150 to 190 counts, lowers the real mean and RMS (number: decrease of the mean)",
        "%",
        (2.1, 14.8, 6.8),
        lambda result: _decrease(result.cad[REAL].mean_m, result.cad[FILTERED].mean_m),
        lambda result, decrease: decrease > 0 and result.cad[FILTERED].rms_m < result.cad[REAL].rms_m,
    ),
    _Criterion(
        4,
        "the force filter at 190 counts removes 5 to 20 % of the points",
        "%",
        (12.4, 11.8, 9.2),
        lambda result: _removed_share(result, FORCE_FILTER),
        _within(5.0, 20.0),
    ),
    _Criterion(
        5,
        "the force filter at 320 counts removes at least 75 % of the points",
        "%",
        (84.5, 80.5, 86.4),
        lambda result: _removed_share(result, 320),
        _at_least(75.0),
    ),
    _Criterion(
        6,
        "SOR after the force filter lowers the real mean and removes at most 12 % (number: mean after SOR, mm)",
        "mm",
        (2.90, 2.71, 4.42),
        lambda result: 1e3 * result.cad[CLEANED].mean_m,
        _does_sor_improve,
    ),
    _Criterion(
        7,
        "SOR lowers the largest real-to-sim distance more than the force filter does (number: decrease by SOR)",
        "%",
        (63.0, 45.0, 27.0),
        lambda result: _decrease(result.to_sim[STAGES[1]].max_m, result.to_sim[STAGES[2]].max_m),
        lambda result, decrease: decrease > _decrease(result.to_sim[STAGES[0]].max_m, result.to_sim[STAGES[1]].max_m),
    ),
    _Criterion(
        9,
        "simulated points after propagation over unfiltered real points: 0.85 to 1.15",
        "1",
        (0.99, 1.03, 0.94),
        lambda result: result.cad[SPREAD].points / max(result.cad[REAL].points, 1),
        _within(0.85, 1.15),
    ),
    _Criterion(
        11,
        "contact propagation is the largest step in mean and RMS, with over half of the decrease of the mean",
        "%",
        (54.0, 72.0, 61.0),
        lambda result: _step_shares(result, "mean_m")[-1],
        _is_propagation_largest,
    ),
)
"""Criteria that are evaluated for each object separately; findings 8, 10 and 12 (functions below) compare objects."""


def _evaluate_propagation(results: Results) -> Finding:
    """Evaluate finding 8 of the thesis: effect of contact propagation on the distance to the CAD model."""
    numbers = {result.printed_name: result.cad[SPREAD].mean_m / result.cad[SIM].mean_m for result in results}
    smallest = min(numbers.values())
    holds = {name: value >= 1.15 and (name == "triangular") == (value == smallest) for name, value in numbers.items()}
    statement = (
        "propagation multiplies the simulated mean distance to CAD by at least 1.15, least for the triangular prism"
    )
    return Finding(8, statement, "1", numbers, (2.05, 2.11, 1.24), holds)


def _evaluate_stages(results: Results) -> Finding:
    """Evaluate finding 10 of the thesis: the distance between real and simulated clouds decreases at every stage."""
    numbers = {
        result.printed_name: _decrease(result.to_sim[STAGES[0]].mean_m, result.to_sim[STAGES[-1]].mean_m)
        for result in results
    }
    smallest = min(numbers.values())
    holds = {
        result.printed_name: all(
            getattr(result.to_sim[after], key) < getattr(result.to_sim[before], key)
            for before, after in pairwise(STAGES)
            for key in KEYS
        )
        and (result.printed_name == "triangular") == (numbers[result.printed_name] == smallest)
        for result in results
    }
    statement = (
        "real-to-sim mean and RMS decrease at every stage, the mean least for the triangular prism (number: total "
        "decrease)"
    )
    return Finding(10, statement, "%", numbers, (47.0, 44.0, 21.0), holds)


def _evaluate_cross_match(results: Results) -> Finding:
    """Evaluate finding 12 of the thesis: each cloud is nearest to the CAD model of its own object."""
    numbers, holds = {}, {}
    for result in results:
        name = result.printed_name
        margins = {side: compute_margin(result, side) for side in (REAL, SIM)}
        is_own_nearest = all(
            min(by_mesh, key=lambda mesh: getattr(by_mesh[mesh], key)) == name
            for by_mesh in (_stats_by_mesh(result, side) for side in (REAL, SIM))
            for key in KEYS
        )
        numbers[name] = margins[REAL]
        holds[name] = is_own_nearest and margins[REAL] < margins[SIM]
    statement = (
        "every cloud is nearest to its own CAD model; real margins are below simulated ones (number: real margin)"
    )
    return Finding(12, statement, "1", numbers, (3.66, 1.32, 1.11), holds)


def _stats_by_mesh(result: ObjectResult, side: str) -> dict[str, DistanceStats]:
    """Return the distances of the object's cloud on side "real" or "sim" to every CAD model, by model name."""
    return {mesh: stats for (cloud, mesh), stats in result.cross.items() if cloud == side}


def compute_margin(result: ObjectResult, side: str) -> float:
    """Compute how clearly a cloud matches its own object.

    The result is the smallest mean distance to the CAD model of another object, divided by the mean distance to the
    model of the object itself. side: "real" or "sim".
    """
    by_mesh = _stats_by_mesh(result, side)
    other_means = [stats.mean_m for mesh, stats in by_mesh.items() if mesh != result.printed_name]
    return min(other_means) / by_mesh[result.printed_name].mean_m if other_means else float("inf")


def compute_further_results(results: Results) -> list[FurtherResult]:
    """Compute results besides the findings: points removed from 190 to 200 counts, best filters, comparison."""
    removed = {
        result.printed_name: f"{_removed_share(result, 200) - _removed_share(result, 190):.1f} %" for result in results
    }
    best_threshold = {
        result.printed_name: (
            "above 190"
            if min(result.force, key=lambda threshold: result.force[threshold].mean_m) > FORCE_FILTER
            else "at most 190"
        )
        for result in results
    }
    sor_contributes_more = {
        result.printed_name: "yes" if _step_shares(result, "mean_m")[1] > _step_shares(result, "mean_m")[0] else "no"
        for result in results
    }
    best_settings = {
        result.printed_name: ", ".join(f"{n} / {sigma:g}" for n, sigma in find_best_settings(result))
        for result in results
    }
    return [
        FurtherResult("points removed between 190 and 200 counts", removed, "16, 27, 12.5 %"),
        FurtherResult(
            "threshold with the smallest mean distance",
            best_threshold,
            "text: above 190; table: at most 190 for the cylinder",
        ),
        FurtherResult(
            "SOR settings (printed N / nSigma) with the smallest mean distance, to 0.01 mm",
            best_settings,
            "20 / 1; 20 / 2, 2759 / 2, 690 / 3; 716 / 2",
        ),
        FurtherResult(
            "SOR contributes more than the force filter", sor_contributes_more, "text: yes; table: no for the cylinder"
        ),
    ]


PRINTED_RESOLUTION_M: Final = 1e-5
"""Resolution of the printed distances."""


def find_best_settings(result: ObjectResult) -> list[tuple[int, float]]:
    """Find all settings (N, nSigma) of the outlier filter with the smallest mean distance to the CAD model.

    Distances are compared at the resolution printed in the thesis.
    """
    rounded = {key: round(stats.mean_m / PRINTED_RESOLUTION_M) for key, stats in result.sor.items()}
    return [key for key, value in rounded.items() if value == min(rounded.values())]
