"""Tests of the thesis's qualitative statements on the distance from the real to the simulated cloud.

The treatment has three steps: force filter, statistical outlier filter (SOR), contact propagation. As in
`finding_tests`, a test of one object returns a number and whether the statement holds.
"""

from collections.abc import Mapping

import numpy as np

from taxel.thesis.finding_tests import KEYS, SIGNIFICANT, compute_decrease
from taxel.thesis.object_result import ObjectResult
from taxel.thesis.printed import STAGES
from taxel.thesis.printed_result import build_printed_results
from taxel.thesis.statement import Evidence, Outcome
from taxel.thesis.tables import compute_contributions

FORCE_STEP, SOR_STEP, PROPAGATION_STEP = 0, 1, 2
"""Steps of the treatment, for `decline`."""


def decline(result: ObjectResult, step: int, key: str = "mean_m") -> float:
    """Compute how much a treatment step decreases the real-to-sim distance, millimetres; negative for an increase.

    step: `FORCE_STEP`, `SOR_STEP` or `PROPAGATION_STEP`. key: statistic of the distance.
    """
    return 1e3 * float(getattr(result.to_sim[STAGES[step]], key) - getattr(result.to_sim[STAGES[step + 1]], key))


def sor_removes_farther_points(result: ObjectResult) -> Outcome:
    """Test whether SOR lowers the largest real-to-sim distance more than the force filter does.

    Returned number: decrease by SOR, percent.
    """
    largest = [result.to_sim[stage].max_m for stage in STAGES]
    by_force, by_sor = compute_decrease(largest[0], largest[1]), compute_decrease(largest[1], largest[2])
    return by_sor, by_sor > by_force


def decreases_continuously(result: ObjectResult) -> Outcome:
    """Test whether mean and RMS of the real-to-sim distance decrease at every treatment step.

    Returned number: decrease of the mean over all steps, percent.
    """
    holds = all(decline(result, step, key) > 0.0 for step in range(3) for key in KEYS)
    return compute_decrease(result.to_sim[STAGES[0]].mean_m, result.to_sim[STAGES[-1]].mean_m), holds


def _get_shares(result: ObjectResult, key: str) -> list[float]:
    """Return the share of each treatment step in the decrease of a real-to-sim distance, percent. key: statistic."""
    return compute_contributions({stage: getattr(result.to_sim[stage], key) for stage in STAGES})


def has_same_trend(result: ObjectResult) -> Outcome:
    """Test whether the three treatment steps have the same order by decrease of the mean and by decrease of the RMS.

    Returned number: largest difference between the shares by mean and by RMS, percent.
    """
    declines = [[decline(result, step, key) for step in range(3)] for key in KEYS]
    mean, rms = (_get_shares(result, key) for key in KEYS)
    difference = max(abs(first - second) for first, second in zip(mean, rms, strict=True))
    return difference, bool(np.array_equal(np.argsort(declines[0]), np.argsort(declines[1])))


def compare_sor_and_force(evidence: Evidence) -> Mapping[str, Outcome]:
    """Test whether the filter with the larger contribution, SOR or force filter, is that of Tables I-10 to I-12.

    The contribution of a filter is its decrease of the mean real-to-sim distance.
    Returned number: contribution of SOR minus that of the force filter, millimetres.
    """

    def compare(result: ObjectResult) -> float:
        """Return the number of one object."""
        return decline(result, SOR_STEP) - decline(result, FORCE_STEP)

    printed = {result.printed_name: compare(result) for result in build_printed_results()}
    return {
        result.printed_name: (compare(result), (compare(result) > 0.0) == (printed[result.printed_name] > 0.0))
        for result in evidence.results
    }


def is_propagation_largest(result: ObjectResult) -> Outcome:
    """Test whether contact propagation decreases mean and RMS of the real-to-sim distance more than each filter does.

    Returned number: share of propagation in the decrease of the mean, percent.
    """
    declines = [[decline(result, step, key) for step in range(3)] for key in KEYS]
    return _get_shares(result, KEYS[0])[-1], all(steps[-1] > max(0.0, *steps[:-1]) for steps in declines)


def is_prism_force_step_small(evidence: Evidence) -> Mapping[str, Outcome]:
    """Test whether the force filter decreases the mean real-to-sim distance much less for the triangular prism.

    Returned number: decrease, millimetres. For another object, the statement holds if its decrease is much larger.
    """
    declines = {result.printed_name: decline(result, FORCE_STEP) for result in evidence.results}
    prism = declines["triangular"]
    holds = {name: SIGNIFICANT * prism <= value for name, value in declines.items() if name != "triangular"}
    holds["triangular"] = all(holds.values())
    return {name: (value, holds[name]) for name, value in declines.items()}
