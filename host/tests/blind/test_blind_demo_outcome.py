"""Outcomes of demonstrations, and the score of several demonstrations."""

import pytest

from taxel.blind.demo_outcome import DemoOutcome, format_score, judge
from taxel.blind.grasp_world import GraspWorld
from taxel.blind.hidden import Cause, HiddenCauses


def make_world(*names: str) -> GraspWorld:
    """Make a world that hides the named causes."""
    kind = {0: "none", 1: "single", 2: "several"}[len(names)]
    causes = tuple(Cause(name, f"{name} form", (f"{name} form",)) for name in names)
    return GraspWorld(1, HiddenCauses(kind, causes, ()), "")


def make_verdict(**probabilities: float) -> dict[str, object]:
    """Make a verdict that names the causes with a probability of at least 0.5."""
    named = [name for name, value in probabilities.items() if value >= 0.5 and name != "no_gap"]
    return {"effects": named, "probabilities": probabilities}


@pytest.mark.parametrize(
    ("hidden", "probabilities", "is_right", "is_surely_wrong"),
    [
        (("noise",), {"noise": 0.9, "no_gap": 0.01}, True, False),
        (("noise",), {"noise": 0.9, "latency": 0.6}, True, False),
        (("noise",), {"noise": 0.6, "latency": 0.9}, False, True),
        (("noise",), {"unknown": 0.9}, False, False),
        (("noise",), {"no_gap": 0.99}, False, False),
        (("noise", "latency"), {"latency": 0.9, "noise": 0.8}, True, False),
        (("noise", "latency"), {"latency": 0.9}, False, False),
        ((), {"no_gap": 0.99}, True, False),
        ((), {"unknown": 0.7}, False, False),
        ((), {"noise": 0.85}, False, True),
    ],
)
def test_outcome_is_right_if_the_most_probable_effects_are_hidden_and_surely_wrong_if_another_reaches_0_8(
    hidden, probabilities, is_right, is_surely_wrong
):
    outcome = judge(make_world(*hidden), [2.0] * len(hidden), make_verdict(**probabilities))
    assert (outcome.is_right, outcome.is_surely_wrong) == (is_right, is_surely_wrong)


def test_cause_below_half_a_floor_is_not_expected_to_be_named():
    world = make_world("noise", "latency")
    outcome = judge(world, [3.0, 0.4], make_verdict(noise=0.9, no_gap=0.01))
    assert (outcome.expected, outcome.sizes, outcome.is_right) == (("noise",), (3.0, 0.4), True)


def test_no_named_cause_is_right_if_all_hidden_causes_are_below_half_a_floor():
    world = make_world("noise", "latency")
    assert judge(world, [0.1, 0.4], make_verdict(no_gap=0.9)).is_right
    assert not judge(world, [0.1, 0.4], make_verdict(noise=0.9)).is_right


def test_score_states_number_share_interval_and_wrong_statements():
    """Of ten demonstrations, the first is not right, and one is surely wrong. The interval is that of 9 of 10."""
    outcomes = [DemoOutcome(1, (), (), (), (), {}, number > 0, number == 3) for number in range(10)]
    assert format_score(outcomes) == (
        "9 of 10 right (90 %, interval 55 to 100 %), wrong with a probability of 0.8 or more: 1"
    )
