"""What a gap without a name is called: unknown, unless it is one delicate press."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from taxel.gap.metric import LEAST_MARGIN_COUNTS, Gap, Interval, Terms
from taxel.gap.verdict import judge_verdict

FLOOR = 2.0
MARGIN = 3.0 * FLOOR**2
ROUND = SimpleNamespace(trials=(None,), best=None)
NOTHING = SimpleNamespace(explained=0.0, is_local=False, fits=0.0, rounds=(ROUND,))
HELD = SimpleNamespace(reducible=None, shrink=SimpleNamespace(value=0.0), left2=0.0)


def gap_of(cells: list[float]) -> Gap:
    """Each cell's share of the excess, counts^2, on one feature and taxel."""
    excess = np.array(cells)[:, None, None] * len(cells)
    value = float(np.sum(cells))
    interval = Interval(value, 0.9 * value, 1.1 * value, 0.05 * value)
    size = Interval(float(np.sqrt(value + FLOOR**2)), None, None, None)
    return Gap(size, FLOOR, interval, 1.1 * value, 1e-4, Terms(excess + FLOOR**2, np.full(excess.shape, FLOOR**2)))


@pytest.mark.parametrize(
    ("cells", "status"),
    [
        ([1.4 * MARGIN, *[0.02 * MARGIN] * 9], "no_gap"),  # one press
        ([0.8 * MARGIN, *[0.08 * MARGIN] * 9], "unknown"),  # the others as well
        ([5.0 * MARGIN, *[0.02 * MARGIN] * 9], "unknown"),  # too much for a touch
        ([1.4 * MARGIN, *[0.02 * MARGIN] * 5], "unknown"),  # too few presses to say so
    ],
)
def test_a_small_gap_of_a_single_condition_is_no_gap(cells, status):
    assert MARGIN > LEAST_MARGIN_COUNTS**2
    presses = [("cylinder", str(number)) for number in range(len(cells))]
    verdict = judge_verdict(gap_of(cells), NOTHING, (), HELD, cells=presses)
    assert verdict.status == status
    assert ("one condition (cylinder 0)" in verdict.one_line) == (status == "no_gap")


def entry(**changes):
    return {"name": "presses", "scope": "board", "share": 0.9, "counts2": 2.0 * MARGIN, "p_value": 0.001} | changes


@pytest.mark.parametrize(
    ("bank", "status"),
    [
        ([], "explained"),
        ([entry()], "partly_explained"),
        ([entry(p_value=0.02)], "explained"),  # may be chance
        ([entry(p_value=None)], "explained"),  # too few sessions to test it
        ([entry(share=0.4)], "explained"),  # one of many
        ([entry(counts2=0.5 * MARGIN)], "explained"),  # no gap of its own
    ],
)
def test_a_significant_remainder_is_reported_as_an_unknown_cause(bank, status):
    found = SimpleNamespace(explained=0.9, is_local=False, fits=0.9, rounds=(ROUND,))
    held = SimpleNamespace(reducible=0.97, shrink=SimpleNamespace(value=0.8), left2=0.0)
    verdict = judge_verdict(gap_of([10.0 * MARGIN] * 10), found, ("stiffness",), held, bank=bank)
    assert verdict.status == status
    assert ("unknown" in verdict.effects) == (status != "explained")


@pytest.mark.parametrize(("reducible", "status"), [(0.9, "explained"), (0.1, "no_gap"), (None, "no_gap")])
def test_within_the_margin_an_effect_must_reduce_the_reducible_gap(reducible, status):
    found = SimpleNamespace(explained=0.9, is_local=False, fits=0.9, rounds=(ROUND,))
    held = SimpleNamespace(reducible=reducible, shrink=SimpleNamespace(value=0.3), left2=0.0)
    verdict = judge_verdict(gap_of([0.08 * MARGIN] * 10), found, ("noise",), held)
    assert verdict.status == status
    assert verdict.one_line.endswith("counts is due to noise (the hand has more noise).") == (status == "no_gap")
