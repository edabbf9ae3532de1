"""Verdict, effects and headline that follow from the probabilities."""

from __future__ import annotations

import gzip
import json
from itertools import combinations, permutations
from pathlib import Path
from types import SimpleNamespace

import pytest

from taxel.gap.effects.catalogue import OWN_EFFECTS
from taxel.gap.features.metric import Gap, Interval
from taxel.gap.verdict.headlines import (
    HEADLINES,
    MAX_WORDS,
    PREDICATES,
    REAL_AND_SIMULATED,
    TWO_REAL,
    make_either_headline,
    make_headline,
    make_open_headline,
    make_weak_headline,
)
from taxel.gap.verdict.verdict import derive_verdict, list_causes, list_leading_effects

ANSWERS = Path(__file__).parents[3] / "docs" / "blind-check-answers.jsonl.gz"

INTERVAL = Interval(400.0, 300.0, 500.0, 20.0)
GAP = Gap(Interval(20.0, 18.0, 22.0, 1.0), 5.0, INTERVAL, 440.0, 0.001, None)


NO_EXCESS = Interval(1.0, -3.0, 5.0, 2.0)

RIVALS = {"stiffness": ["gain_mismatch"], "contact_propagation": ["electrode_crosstalk"]}


def make_verdict(probabilities, sessions=5, warnings=(), remaining_excess=NO_EXCESS, sides=REAL_AND_SIMULATED):
    """Return the verdict for given probabilities, with a gap that shrinks from 20 to 8 counts. remaining_excess: counts
    squared.
    """
    shrink = SimpleNamespace(value=0.6)
    held_out = SimpleNamespace(
        session_count=sessions, shrink=shrink, remaining_excess=remaining_excess, before=20.0, after=8.0, floor2=25.0
    )
    rivals = {name: RIVALS.get(name, []) for name in list_leading_effects(probabilities)}
    return derive_verdict(GAP, probabilities, held_out, rivals, warnings, sides)


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
    """A cause is named from a probability of 0.5 on. The probabilities are independent and need not sum to 1."""
    verdict = make_verdict(probabilities)
    assert (verdict.status, verdict.effects) == (status, effects)
    assert verdict.effects == list_causes(probabilities)
    assert verdict.probabilities == probabilities


def test_the_headline_of_two_rivals_names_both_as_alternatives():
    verdict = make_verdict({"stiffness": 0.48, "gain_mismatch": 0.47, "noise": 0.01, "unknown": 0.05, "no_gap": 0.01})
    assert verdict.effects == ("unknown",)
    assert verdict.rivals == {"stiffness": ("gain_mismatch",)}
    expected = "The skin differs in stiffness or is unevenly sensitive; another contact decides."
    assert verdict.headline == expected


@pytest.mark.parametrize(
    ("probabilities", "headline"),
    [
        ({"latency": 0.47, "unknown": 0.2, "no_gap": 0.1}, "Perhaps the skin lags behind; the evidence is weak."),
        (
            {"latency": 0.2, "unknown": 0.4, "no_gap": 0.1},
            "The real skin and the simulator differ; no known cause explains it.",
        ),
        (
            {"latency": 0.2, "unknown": 0.4, "no_gap": 0.45},
            "It is open whether the real skin and the simulator differ.",
        ),
    ],
)
def test_the_headline_of_an_unnamed_cause_follows_the_largest_probability(probabilities, headline):
    verdict = make_verdict(probabilities)
    assert (verdict.effects, verdict.headline) == (("unknown",), headline)


def test_too_few_sessions_give_neither_no_gap_nor_explained():
    none = make_verdict({"noise": 0.02, "unknown": 0.01, "no_gap": 0.97}, sessions=1)
    assert none.status == "unknown"
    assert "too few sessions for a verdict: 1 recorded, needs 3" in none.one_line
    assert make_verdict({"noise": 0.98, "unknown": 0.01, "no_gap": 0.01}, sessions=2).status == "partly_explained"


@pytest.mark.parametrize(("low", "status"), [(6.0, "explained"), (7.0, "partly_explained"), (None, "explained")])
def test_a_remaining_excess_of_more_than_half_the_floor_is_stated(low, status):
    """Half the floor of 5 counts, squared, is 6.25 counts squared.

    low: lower end of the interval of the remaining excess, counts squared; None: too few sessions for an interval.
    """
    verdict = make_verdict(
        {"noise": 0.98, "unknown": 0.01, "no_gap": 0.01}, remaining_excess=Interval(100.0, low, 200.0, 10.0)
    )
    assert verdict.status == status
    assert ("10.0 counts above the floor remain" in verdict.one_line) == (status == "partly_explained")
    assert verdict.effects == ("noise",)


def test_reasons_contain_the_warnings_and_the_unknown_cause():
    reasons = make_verdict({"noise": 0.98, "unknown": 0.7, "no_gap": 0.0}, warnings=["a bound was reached"]).reasons
    assert reasons[0] == "a bound was reached"
    assert "outside the catalogue" in reasons[1]


def test_the_sentence_has_the_gap_and_the_shrink_of_held_out_sessions():
    probabilities = {"noise": 0.98, "unknown": 0.01, "no_gap": 0.01}
    line = make_verdict(probabilities).one_line
    assert "from 20.0 to 8.0 counts, by 60 %; the rest agrees with the floor of 5.0 counts" in line
    # With the interval of the remaining excess above 0, the rest does not agree with the floor.
    line = make_verdict(probabilities, remaining_excess=Interval(39.0, 2.0, 76.0, 18.0)).one_line
    assert "from 20.0 to 8.0 counts, by 60 %; the floor is 5.0 counts" in line


NAMES = [*OWN_EFFECTS, "my_own", "a_plugin_with_a_very_long_name", "{real}"]
PAIRS = list(permutations(NAMES, 2))


@pytest.mark.parametrize("sides", [REAL_AND_SIMULATED, TWO_REAL])
def test_headlines_of_every_effect_and_pair_have_at_most_twelve_words(sides):
    headlines = [
        make_headline(names, sides, is_partial, is_tentative, probability)
        for names in [*((name,) for name in NAMES), *PAIRS, *permutations(NAMES, 3)]
        for is_partial in (False, True)
        for is_tentative in (False, True)
        for probability in (0.6, 0.9)
    ]
    headlines += [make_either_headline(first, second, sides) for first, second in PAIRS]
    headlines += [make_weak_headline(name, sides) for name in NAMES]
    headlines += [sides.fill(HEADLINES["unknown"]), make_open_headline(sides)]
    for headline in headlines:
        assert len(headline.split()) <= MAX_WORDS, headline
        assert headline[0].isupper(), headline
        assert headline.endswith("."), headline
        assert "_" not in headline, headline
        assert sides is REAL_AND_SIMULATED or "simul" not in headline, headline


@pytest.mark.parametrize("name", OWN_EFFECTS)
def test_every_effect_of_the_catalogue_has_a_headline_of_its_own(name):
    assert name in HEADLINES
    assert 1 < len(PREDICATES[name].split()) <= 3
    assert len(set(PREDICATES.values())) == len(PREDICATES)
    assert not {"gap", "floor", "excess", "catalogue", "effect"} & set(HEADLINES[name].lower().split())


def test_a_cause_below_the_probability_of_80_percent_is_called_probable():
    assert make_verdict({"noise": 0.7, "unknown": 0.0, "no_gap": 0.0}).headline == "Probably the skin is noisier."
    assert (
        make_verdict({"noise": 0.8, "unknown": 0.0, "no_gap": 0.0}).headline
        == "The real skin is noisier than the simulator."
    )


def list_probabilities():
    """Yield probabilities for every status, with each effect and each pair of effects."""
    for names in [(), *((name,) for name in NAMES), *combinations(NAMES, 2)]:
        for value, unknown, no_gap in (
            (0.9, 0.1, 0.0),
            (0.6, 0.7, 0.0),
            (0.9, 0.8, 0.0),
            (0.4, 0.2, 0.1),
            (0.4, 0.8, 0.1),
            (0, 0, 0.9),
        ):
            yield {**dict.fromkeys(names, value), "unknown": unknown, "no_gap": no_gap}


@pytest.mark.parametrize("sessions", [1, 2, 5])
@pytest.mark.parametrize("sides", [REAL_AND_SIMULATED, TWO_REAL])
def test_headlines_of_every_status_have_at_most_twelve_words(sides, sessions):
    statuses = set()
    for probabilities in list_probabilities():
        for excess in (NO_EXCESS, Interval(100.0, 60.0, 200.0, 10.0)):
            verdict = make_verdict(probabilities, sessions, remaining_excess=excess, sides=sides)
            statuses.add(verdict.status)
            assert len(verdict.headline.split()) <= MAX_WORDS, verdict.headline
            assert sides is REAL_AND_SIMULATED or "simul" not in verdict.headline
    few = {"unknown", "partly_explained"}
    assert statuses == (few if sessions < 3 else few | {"explained", "no_gap"})


def test_headlines_of_all_named_sets_of_the_score_sheet_have_at_most_twelve_words():
    """The score sheet has status, named effects and rivals of each sealed world, but no probabilities."""
    with gzip.open(ANSWERS, "rt", encoding="utf-8") as lines:
        named = [json.loads(line)["named"] for line in lines]
    assert len(named) > 500
    for verdict in named:
        known = [name for name in verdict["effects"] if name != "unknown"]
        if not known:
            continue
        is_partial = verdict["status"] != "explained"
        for probability in (0.6, 0.9):
            headline = make_headline(known, REAL_AND_SIMULATED, is_partial, probability=probability)
            assert len(headline.split()) <= MAX_WORDS, headline
