"""The verdict that follows from probabilities."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from taxel.gap.features.metric import Gap, Interval
from taxel.gap.verdict.verdict import (
    HEADLINES,
    REAL_AND_SIMULATED,
    TWO_REAL,
    judge_verdict,
    list_causes,
    list_questioned,
)

INTERVAL = Interval(400.0, 300.0, 500.0, 20.0)
GAP = Gap(Interval(20.0, 18.0, 22.0, 1.0), 5.0, INTERVAL, 440.0, 0.001, None)


NO_EXCESS = Interval(1.0, -3.0, 5.0, 2.0)

RIVALS = {"stiffness": ["gain_mismatch"], "contact_propagation": ["electrode_crosstalk"]}


def judge(probabilities, sessions=5, warnings=(), left=NO_EXCESS, sides=REAL_AND_SIMULATED):
    held = SimpleNamespace(sessions=sessions, shrink=SimpleNamespace(value=0.6), left2=left)
    rivals = {name: RIVALS.get(name, []) for name in list_questioned(probabilities)}
    return judge_verdict(GAP, probabilities, held, rivals, warnings, sides)


@pytest.mark.parametrize(
    ("probabilities", "status", "effects"),
    [
        ({"noise": 0.02, "unknown": 0.01, "no_gap": 0.97}, "no_gap", ()),
        ({"noise": 0.98, "latency": 0.1, "unknown": 0.01, "no_gap": 0.01}, "explained", ("noise",)),
        ({"noise": 0.6, "latency": 0.9, "unknown": 0.01, "no_gap": 0.01}, "explained", ("latency", "noise")),
        ({"noise": 0.98, "unknown": 0.7, "no_gap": 0.0}, "partly_explained", ("noise", "unknown")),
        ({"noise": 0.1, "unknown": 0.9, "no_gap": 0.1}, "unknown", ("unknown",)),
        ({"noise": 0.1, "unknown": 0.2, "no_gap": 0.1}, "unknown", ("unknown",)),
    ],
)
def test_status_and_effects_follow_from_the_probabilities(probabilities, status, effects):
    verdict = judge(probabilities)
    assert (verdict.status, verdict.effects) == (status, effects)
    assert verdict.effects == list_causes(probabilities)
    assert verdict.probabilities == probabilities


def test_two_rivals_are_reported_as_either_of_both():
    verdict = judge({"stiffness": 0.48, "gain_mismatch": 0.47, "noise": 0.01, "unknown": 0.05, "no_gap": 0.01})
    assert verdict.effects == ("unknown",)
    assert verdict.rivals == {"stiffness": ("gain_mismatch",)}
    assert verdict.headline.startswith("Either stiffness or gain mismatch")


def test_too_few_sessions_end_neither_in_no_gap_nor_in_explained():
    none = judge({"noise": 0.02, "unknown": 0.01, "no_gap": 0.97}, sessions=1)
    assert none.status == "unknown"
    assert "too few sessions for a verdict: 1 recorded, needs 3" in none.one_line
    assert judge({"noise": 0.98, "unknown": 0.01, "no_gap": 0.01}, sessions=2).status == "partly_explained"


@pytest.mark.parametrize(("low", "status"), [(6.0, "explained"), (7.0, "partly_explained"), (None, "explained")])
def test_a_remaining_excess_of_more_than_half_the_floor_is_stated(low, status):
    verdict = judge({"noise": 0.98, "unknown": 0.01, "no_gap": 0.01}, left=Interval(100.0, low, 200.0, 10.0))
    assert verdict.status == status
    assert ("10.0 counts above the floor remain" in verdict.one_line) == (status == "partly_explained")
    assert verdict.effects == ("noise",)


def test_reasons_contain_the_warnings_and_the_unknown_cause():
    reasons = judge({"noise": 0.98, "unknown": 0.7, "no_gap": 0.0}, warnings=["a bound was reached"]).reasons
    assert reasons[0] == "a bound was reached"
    assert "outside the catalogue" in reasons[1]


NAMED = [(name,) for name in HEADLINES if name != "unknown"]


@pytest.mark.parametrize("names", [*NAMED, ("my_own",), ("noise", "gain_mismatch", "contact_propagation")])
@pytest.mark.parametrize("sides", [REAL_AND_SIMULATED, TWO_REAL])
def test_headlines_have_at_most_twelve_words(names, sides):
    probabilities = {**dict.fromkeys(names, 0.9), "unknown": 0.0, "no_gap": 0.0}
    headline = judge(probabilities, sides=sides).headline
    assert len(headline.split()) <= 12
    assert "{" not in headline
    assert sides is REAL_AND_SIMULATED or "simulator" not in headline


@pytest.mark.parametrize("sessions", [1, 5])
@pytest.mark.parametrize("value", [0.0, 0.45])
def test_headlines_without_a_named_effect_have_at_most_twelve_words(sessions, value):
    for no_gap in (0.0, 0.9):
        probabilities = {"contact_propagation": value, "electrode_crosstalk": value, "unknown": 0.3, "no_gap": no_gap}
        assert len(judge(probabilities, sessions).headline.split()) <= 12
