"""The figures of the score, from answers made up here."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from taxel.blind.answers import Answer, Compared, Named
from taxel.blind.drawing import World
from taxel.blind.hidden import Cause, Hidden
from taxel.blind.score import score, share, wilson
from taxel.blind.sheet import sheet


def world(number: int, kind: str, *names: str, form: str = "some form", hand: str = "rig4") -> World:
    causes = tuple(Cause(name, form, (f"{form} counts=1",)) for name in names)
    return World(number, hand, 1, Hidden(kind, causes, ()), "00")


def answer(own: World, *said: str, status: str = "explained", ratio: float = 3.0, **more) -> Answer:
    return Answer(own, Named(status, said, more.pop("confounded", ())), gap=10.0 * ratio, floor=10.0, **more)


def single(name: str, *said: str, **more) -> Answer:
    return answer(world(0, "single", name), *said, **more)


def row(found: float, true: float = 1.0, low: float | None = None, high: float | None = None, **more) -> Compared:
    values = {"effect": "noise", "form": "noise white", "name": "white_counts", "unit": "counts", "reference": False}
    return Compared(found=found, true=true, low=low, high=high, **{**values, **more})


def rig(*answers: Answer) -> dict:
    return score(answers)["rig4"]


@pytest.mark.parametrize(("right", "of", "low", "high"), [
    (0, 0, 0.0, 1.0),
    (0, 10, 0.0, 0.2775),
    (10, 10, 0.7225, 1.0),
    (81, 263, 0.2553, 0.3662),  # Newcombe 1998, table I: method 3
    (15, 148, 0.0624, 0.1605),
    (0, 20, 0.0, 0.1611),
    (1, 29, 0.0061, 0.1718),
])  # fmt: skip
def test_wilsons_interval(right, of, low, high):
    assert wilson(right, of) == pytest.approx([low, high], abs=1e-4)


def test_a_share_counts_what_is_true():
    assert share([True, False, True, True]) == {"right": 3, "of": 4, "share": 0.75, "ci95": wilson(3, 4)}
    assert share([])["share"] is None


def test_the_strongest_must_be_named_first_or_be_confounded_with_what_is():
    found = rig(
        single("noise", "noise"),
        single("noise", "noise", "latency"),
        single("noise", "latency", "noise"),
        single("noise", "latency", confounded=("noise",)),
        single("noise", "unknown", status="unknown"),
        single("noise", status="no_gap"),
    )
    assert (found["single_first"]["right"], found["single_first"]["of"]) == (3, 6)
    assert found["single_each"]["noise"]["of"] == 6
    assert found["single_each"]["latency"]["of"] == 0


def test_answers_are_asked_of_clear_gaps_and_told_by_gap_over_floor():
    found = rig(single("noise", "noise", ratio=2.0), single("noise", status="no_gap", ratio=1.9))
    assert found["single_first"]["of"] == 1
    assert found["counts"]["single"] == {"worlds": 2, "clear": 1}
    by_ratio = {own["from"]: (own["right"], own["of"]) for own in found["single_by_ratio"]}
    assert by_ratio == {0.0: (0, 0), 1.0: (0, 1), 2.0: (1, 1), 3.0: (0, 0), 4.0: (0, 0), 6.0: (0, 0)}


def test_a_world_that_gives_no_report_is_a_wrong_answer_everywhere():
    broken = [
        replace(answer(world(number, kind, *names)), named=Named("error", ()), gap=0.0, floor=1.0, error="KeyError: 3")
        for number, (kind, names) in enumerate(
            [("none", ()), ("single", ("noise",)), ("outside", ("unknown",)), ("several", ("noise", "latency"))]
        )
    ]
    shuffled = replace(broken[0], shuffled=Named("error", ()), seeds=(Named("error", ()),) * 3)
    found = rig(shuffled, *broken[1:])
    assert found["false_alarms"]["share"] == 1.0
    assert found["single_first"]["share"] == 0.0
    assert found["unknown"]["share"] == 0.0
    assert found["seeds"]["share"] == 0.0
    assert found["simpler"]["shuffled_says_unknown_or_no_gap"]["share"] == 0.0
    assert found["several_f1"]["f1"] == 0.0
    assert found["errors"][1] == "1: KeyError: 3"
    assert found["single_by_ratio"][0]["of"] == 0


def test_false_alarms_are_of_worlds_without_effect_whatever_their_gap():
    calm = world(0, "none")
    found = rig(
        answer(calm, status="no_gap", ratio=0.5),
        answer(calm, status="no_gap", ratio=5.0),
        answer(calm, "noise", ratio=0.5),
        answer(calm, "unknown", status="unknown", ratio=0.5),
    )
    assert (found["false_alarms"]["right"], found["false_alarms"]["of"]) == (2, 4)


def test_strangers_are_outside_or_deleted_and_shall_be_unknown():
    outside = world(0, "outside", "unknown", form="stuck_bit")
    found = rig(
        answer(outside, "unknown", status="unknown"),
        answer(outside, "noise", "unknown", status="partly_explained"),
        answer(outside, "noise"),
        answer(outside, status="no_gap"),
        single("noise", "noise", without=Named("unknown", ("unknown",))),
        single("latency", "latency", without=Named("explained", ("noise",))),
        single("latency", "latency", ratio=1.0, without=Named("explained", ("noise",))),
    )
    assert (found["unknown"]["right"], found["unknown"]["of"]) == (3, 6)
    assert (found["misnamed"]["right"], found["misnamed"]["of"]) == (2, 6)
    assert found["unknown_outside_each"]["stuck_bit"]["of"] == 4
    assert {name: own["share"] for name, own in found["unknown_withheld_each"].items()} == {
        "noise": 1.0,
        "latency": 0.0,
    }


def test_a_decoy_takes_away_what_is_not_there():
    found = rig(
        single("noise", "noise", decoy=Named("explained", ("noise",))),
        single("noise", "noise", decoy=Named("explained", ("latency",))),
    )
    assert (found["decoy_first"]["right"], found["decoy_first"]["of"]) == (1, 2)


def test_f1_of_pairs_is_of_all_names_together():
    pair = world(0, "several", "noise", "latency")
    triple = world(1, "several", "noise", "latency", "hysteresis")
    found = rig(
        answer(pair, "noise", "latency"),
        answer(triple, "noise", "stiffness", "unknown"),
        answer(triple, "noise", ratio=1.0),
    )["several_f1"]
    # named: noise, latency, noise, stiffness, of which 3 are there; there: 5
    assert (found["precision"], found["recall"], found["worlds"]) == (3 / 4, 3 / 5, 2)
    assert found["f1"] == pytest.approx(2 * 0.75 * 0.6 / 1.35)


def test_what_no_press_could_show_is_neither_asked_for_nor_wrong():
    pair = world(0, "several", "dropout", "latency")
    asked = rig(answer(pair, "latency"))["several_f1"]
    assert (asked["precision"], asked["recall"]) == (1.0, 0.5)
    for said in (("latency",), ("latency", "dropout")):
        idle = rig(answer(pair, *said, idle=("dropout",)))["several_f1"]
        assert (idle["precision"], idle["recall"]) == (1.0, 1.0)


def test_the_confusion_is_of_what_was_named_first():
    found = rig(
        single("noise", "noise"),
        single("noise", "latency", "noise"),
        single("noise", status="no_gap", ratio=1.0),
        answer(world(1, "none"), status="no_gap", ratio=0.3),
        answer(world(2, "outside", "unknown"), "unknown", status="unknown"),
        answer(world(3, "several", "noise", "latency"), "noise"),
    )
    assert found["confusion"] == {
        "noise": {"noise": 1, "latency": 1},
        "no_gap": {"no_gap": 1},
        "unknown": {"unknown": 1},
    }


def test_parameters_are_told_by_form_and_asked_in_units_that_are_defined():
    found = rig(
        single("noise", "noise", parameters=(row(1.1), row(0.7))),
        single("noise", "noise", parameters=(row(2.0, unit="1", name="slope@32"), row(1.5, unit="1", name="slope@48"))),
        single("noise", "noise", ratio=1.0, parameters=(row(100.0),)),
    )["parameters"]
    assert found["each"]["noise white: white_counts"]["of"] == 2
    assert found["each"]["noise white: white_counts"]["median_relative_error"] == pytest.approx(0.2)
    assert found["each"]["noise white: slope"]["of"] == 2
    assert found["asked"] == pytest.approx(0.2)
    assert found["others"] == pytest.approx(0.75)


def test_coverage_is_of_intervals_that_there_are():
    rows = (
        row(1.0, low=0.9, high=1.1),
        row(2.0, low=1.5, high=2.5),
        row(1.0),
        row(-1.0, true=-1.0, low=-2.0, high=0.0),
    )
    found = rig(single("noise", "noise", parameters=rows))["coverage"]
    assert (found["right"], found["of"]) == (2, 3)


def test_the_error_of_the_shrink_is_in_points():
    found = rig(single("noise", "noise", shrink=(0.80, 0.74)), single("noise", "noise", shrink=(0.5, 0.52)))["shrink"]
    assert (found["of"], found["mean_points"]) == (2, pytest.approx(4.0))


def test_seeds_are_stable_where_status_and_effects_are_the_same():
    seeds = (Named("explained", ("noise",)), Named("partly_explained", ("noise",)), Named("explained", ("latency",)))
    found = rig(single("noise", "noise", seeds=seeds))["seeds"]
    assert (found["right"], found["of"]) == (1, 3)


def test_simpler_diagnosers_and_shuffled_pairs_are_scored_beside_it():
    found = rig(
        single("noise", "noise", simpler={"rules": "noise", "effect_blind": "latency"}),
        answer(world(1, "none"), status="no_gap", shuffled=Named("unknown", ("unknown",))),
        answer(world(2, "none"), status="no_gap", shuffled=Named("no_gap", ())),
        answer(world(3, "none"), status="no_gap", shuffled=Named("explained", ("noise",))),
    )["simpler"]
    assert (found["rules"]["share"], found["effect_blind"]["share"]) == (1.0, 0.0)
    assert found["shuffled_says_unknown_or_no_gap"]["right"] == 2


def test_the_whole_hand_is_scored_on_its_own():
    found = score([single("noise", "noise"), answer(world(1, "single", "noise", hand="allegro"), "latency")])
    assert found["rig4"]["single_first"]["share"] == 1.0
    assert found["full_hand"]["single_first"]["share"] == 0.0
    assert score([single("noise", "noise")])["full_hand"] is None


def full_score() -> dict:
    shrink, hidden = (0.8, 0.7), "landlock and audit hook"
    parameters = (row(1.0, low=0.9, high=1.1),)
    return score([
        single("noise", "noise", shrink=shrink, parameters=parameters, blindfold=hidden, runtime_s=2.0),
        single("latency", "noise", blindfold="audit hook", found_places=True),
        answer(world(2, "none"), status="no_gap", ratio=0.4, blindfold=hidden, seeds=(Named("no_gap", ()),) * 9),
        answer(world(3, "several", "noise", "latency"), "noise", "latency", blindfold=hidden),
        answer(world(4, "outside", "unknown", form="stuck_bit"), "noise", blindfold=hidden),
        replace(answer(world(5, "single", "noise")), named=Named("error", ()), error="KeyError: 3"),
    ])  # fmt: skip


def test_the_sheet_marks_what_holds_and_what_is_missed():
    text = sheet(full_score(), "Made by `taxel gap blind --worlds 6`.")
    rows = {line.split(" | ")[0].removeprefix("| "): line for line in text.splitlines() if line.startswith("| ")}
    assert rows["single effect named first"] == (
        "| single effect named first | at least 95 % | 33.3 % | 3 | 6 to 79 % | **missed** |"
    )
    assert rows["false alarms on worlds without effect"].endswith("| 0.0 % | 1 | 0 to 79 % | holds |")
    assert rows["the same: confidently misnamed"].endswith("**missed** |")
    assert rows["pairs and triples, micro-F1"].endswith("| 1.00 | 1 |  | holds |")
    assert rows["predicted against measured shrink, mean difference"].endswith("| 10.0 | 1 |  | **missed** |")
    assert rows["silent board or open line that was loaded, found by place"].endswith("holds |")


@pytest.mark.parametrize(("right", "of", "mark"), [(8, 8, ""), (7, 8, ""), (10, 10, "**missed**"), (9, 10, "holds")])
def test_few_intervals_are_not_judged(right, of, mark):
    score = full_score()
    part = score["rig4"]["coverage"]
    score["rig4"]["coverage"] = {**part, "right": right, "of": of, "share": right / of, "ci95": (0.5, 1.0)}
    (line,) = [line for line in sheet(score, "").splitlines() if line.startswith("| coverage")]
    assert line.split("|")[-2].strip() == mark


def test_the_sheet_tells_its_command_what_hid_the_truth_and_what_broke():
    text = sheet(full_score(), "Made by `taxel gap blind --worlds 6`.")
    assert text.startswith("# Blind check: score sheet\n\nMade by `taxel gap blind --worlds 6`.\n")
    assert "landlock and audit hook, 4 worlds; audit hook, 1 worlds" in text
    assert "- 5: KeyError: 3" in text
    assert "| truth | error | no_gap | noise |" in text
    assert "## The whole hand" not in text


def test_every_table_of_the_sheet_has_as_many_columns_in_each_line():
    text = sheet(full_score(), "")
    for table in (part for part in text.split("\n\n") if part.startswith("|")):
        assert len({line.count("|") for line in table.splitlines()}) == 1, table


def test_a_sheet_of_nothing_is_a_sheet():
    text = sheet(score([]), "")
    assert "missed" not in text
    assert "nan" not in text
    assert not np.any(["None" in text])
