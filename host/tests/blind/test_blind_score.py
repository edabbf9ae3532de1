"""The figures of the score, from constructed results."""

from dataclasses import replace

import pytest

from taxel.blind.hidden import Cause, HiddenCauses
from taxel.blind.results import ParameterComparison, ReportedVerdict, WorldResult
from taxel.blind.score import compute_wilson_interval, score, share
from taxel.blind.score_sheet import score_sheet
from taxel.blind.world import World


def make_world(number: int, kind: str, *names: str, effect: str = "some effect", hand: str = "rig4") -> World:
    """Make a world that hides the named causes."""
    causes = tuple(Cause(name, effect, (f"{effect} counts=1",)) for name in names)
    return World(number, hand, 1, HiddenCauses(kind, causes, ()), "00")


def make_result(world: World, *effects: str, status: str = "explained", ratio: float = 3.0, **fields) -> WorldResult:
    """Make the result of a world whose verdict names `effects`.

    ratio: gap divided by the floor. confounded: effects that are confounded with the first effect.
    """
    verdict = ReportedVerdict(status, effects, fields.pop("confounded", ()))
    return WorldResult(world, verdict, gap=10.0 * ratio, floor=10.0, **fields)


def make_single_result(name: str, *effects: str, **fields) -> WorldResult:
    """Make the result of a world that hides the single cause `name`."""
    return make_result(make_world(0, "single", name), *effects, **fields)


def make_parameter(
    estimate: float, truth: float = 1.0, low: float | None = None, high: float | None = None, **fields
) -> ParameterComparison:
    """Make the comparison of a parameter, by default of white noise; low, high: bounds of the interval."""
    values = {
        "effect": "noise",
        "emulator_effect": "noise white",
        "name": "white_counts",
        "unit": "counts",
        "is_reference": False,
    }
    return ParameterComparison(estimate=estimate, truth=truth, low=low, high=high, **{**values, **fields})


def score_on_rig(*results: WorldResult) -> dict:
    """Return the figures of the worlds on the rig of four boards."""
    return score(results)["rig4"]


@pytest.mark.parametrize(("count", "of", "low", "high"), [
    (0, 0, 0.0, 1.0),
    (0, 10, 0.0, 0.2775),
    (10, 10, 0.7225, 1.0),
    (81, 263, 0.2553, 0.3662),  # Newcombe 1998, table I: method 3
    (15, 148, 0.0624, 0.1605),
    (0, 20, 0.0, 0.1611),
    (1, 29, 0.0061, 0.1718),
])  # fmt: skip
def test_wilson_interval_agrees_with_published_values(count, of, low, high):
    assert compute_wilson_interval(count, of) == pytest.approx([low, high], abs=1e-4)


def test_share_states_true_values_total_ratio_and_interval():
    assert share([True, False, True, True]) == {
        "count": 3,
        "of": 4,
        "share": 0.75,
        "ci95": compute_wilson_interval(3, 4),
    }


def test_share_without_values_has_no_ratio():
    assert share([])["share"] is None


def test_single_cause_is_correct_if_it_is_first_or_confounded_with_the_first():
    figures = score_on_rig(
        make_single_result("noise", "noise"),
        make_single_result("noise", "noise", "latency"),
        make_single_result("noise", "latency", "noise"),
        make_single_result("noise", "latency", confounded=("noise",)),
        make_single_result("noise", "unknown", status="unknown"),
        make_single_result("noise", status="no_gap"),
    )
    assert (figures["single_first"]["count"], figures["single_first"]["of"]) == (3, 6)
    assert figures["single_each"]["noise"]["of"] == 6
    assert figures["single_each"]["latency"]["of"] == 0


def test_accuracy_is_computed_for_gaps_from_two_floors_and_also_by_ratio_of_gap_to_floor():
    figures = score_on_rig(
        make_single_result("noise", "noise", ratio=2.0), make_single_result("noise", status="no_gap", ratio=1.9)
    )
    assert figures["single_first"]["of"] == 1
    assert figures["counts"]["single"] == {"worlds": 2, "clear": 1}
    by_ratio = {entry["from"]: (entry["count"], entry["of"]) for entry in figures["single_by_ratio"]}
    assert by_ratio == {0.0: (0, 0), 1.0: (0, 1), 2.0: (1, 1), 3.0: (0, 0), 4.0: (0, 0), 6.0: (0, 0)}


def test_world_without_a_report_is_counted_as_wrong_in_every_figure():
    failed = ReportedVerdict("error", ())
    results = [
        replace(make_result(make_world(number, kind, *names)), verdict=failed, gap=0.0, floor=1.0, error="KeyError: 3")
        for number, (kind, names) in enumerate(
            [("none", ()), ("single", ("noise",)), ("outside", ("unknown",)), ("several", ("noise", "latency"))]
        )
    ]
    first_result = replace(results[0], verdict_shuffled=failed, verdicts_by_seed=(failed,) * 3)
    figures = score_on_rig(first_result, *results[1:])
    assert figures["false_alarms"]["share"] == 1.0
    assert figures["single_first"]["share"] == 0.0
    assert figures["unknown"]["share"] == 0.0
    assert figures["seeds"]["share"] == 0.0
    assert figures["simpler"]["shuffled_says_unknown_or_no_gap"]["share"] == 0.0
    assert figures["several_f1"]["f1"] == 0.0
    assert figures["errors"][1] == "1: KeyError: 3"
    assert figures["single_by_ratio"][0]["of"] == 0


def test_named_effect_or_unknown_cause_in_a_world_without_a_cause_is_a_false_alarm_for_any_gap():
    world_without_cause = make_world(0, "none")
    figures = score_on_rig(
        make_result(world_without_cause, status="no_gap", ratio=0.5),
        make_result(world_without_cause, status="no_gap", ratio=5.0),
        make_result(world_without_cause, "noise", ratio=0.5),
        make_result(world_without_cause, "unknown", status="unknown", ratio=0.5),
    )
    assert (figures["false_alarms"]["count"], figures["false_alarms"]["of"]) == (2, 4)


def test_only_an_unknown_cause_is_correct_for_causes_outside_or_removed_from_the_catalogue():
    """Six clear worlds: four with a cause outside the catalogue, two with the hidden effect removed (withheld).

    Correct: the answer contains "unknown" (3 of 6). Misnamed: the answer names effects without it (2 of 6). The last
    result is not counted, because its gap is below two floors.
    """
    outside = make_world(0, "outside", "unknown", effect="stuck_bit")
    figures = score_on_rig(
        make_result(outside, "unknown", status="unknown"),
        make_result(outside, "noise", "unknown", status="partly_explained"),
        make_result(outside, "noise"),
        make_result(outside, status="no_gap"),
        make_single_result("noise", "noise", verdict_withheld=ReportedVerdict("unknown", ("unknown",))),
        make_single_result("latency", "latency", verdict_withheld=ReportedVerdict("explained", ("noise",))),
        make_single_result("latency", "latency", ratio=1.0, verdict_withheld=ReportedVerdict("explained", ("noise",))),
    )
    assert (figures["unknown"]["count"], figures["unknown"]["of"]) == (3, 6)
    assert (figures["misnamed"]["count"], figures["misnamed"]["of"]) == (2, 6)
    assert figures["unknown_outside_each"]["stuck_bit"]["of"] == 4
    assert {name: entry["share"] for name, entry in figures["unknown_withheld_each"].items()} == {
        "noise": 1.0,
        "latency": 0.0,
    }


def test_decoy_is_scored_by_whether_the_first_effect_is_still_the_hidden_cause():
    """Decoy verdict: the diagnosis without an effect of the catalogue that is not the hidden cause."""
    figures = score_on_rig(
        make_single_result("noise", "noise", verdict_decoy=ReportedVerdict("explained", ("noise",))),
        make_single_result("noise", "noise", verdict_decoy=ReportedVerdict("explained", ("latency",))),
    )
    assert (figures["decoy_first"]["count"], figures["decoy_first"]["of"]) == (1, 2)


def test_micro_f1_pools_the_names_of_all_worlds_with_a_clear_gap():
    pair = make_world(0, "several", "noise", "latency")
    triple = make_world(1, "several", "noise", "latency", "hysteresis")
    figures = score_on_rig(
        make_result(pair, "noise", "latency"),
        make_result(triple, "noise", "stiffness", "unknown"),
        make_result(triple, "noise", ratio=1.0),  # a gap of one floor is no clear gap: this world does not count
    )["several_f1"]
    # named: noise, latency, noise, stiffness, of which 3 are true ("unknown" is no name); true causes: 5
    assert (figures["precision"], figures["recall"], figures["worlds"]) == (3 / 4, 3 / 5, 2)
    assert figures["f1"] == pytest.approx(2 * 0.75 * 0.6 / 1.35)


def test_unobservable_causes_are_neither_required_nor_wrong():
    pair = make_world(0, "several", "dropout", "latency")
    observable = score_on_rig(make_result(pair, "latency"))["several_f1"]
    assert (observable["precision"], observable["recall"]) == (1.0, 0.5)
    for effects in (("latency",), ("latency", "dropout")):
        unobservable = score_on_rig(make_result(pair, *effects, unobservable_causes=("dropout",)))["several_f1"]
        assert (unobservable["precision"], unobservable["recall"]) == (1.0, 1.0)


def test_confusion_table_counts_the_first_effect_of_clear_worlds_with_at_most_one_cause():
    figures = score_on_rig(
        make_single_result("noise", "noise"),
        make_single_result("noise", "latency", "noise"),
        make_single_result("noise", status="no_gap", ratio=1.0),
        make_result(make_world(1, "none"), status="no_gap", ratio=0.3),
        make_result(make_world(2, "outside", "unknown"), "unknown", status="unknown"),
        make_result(make_world(3, "several", "noise", "latency"), "noise"),
    )
    assert figures["confusion"] == {
        "noise": {"noise": 1, "latency": 1},
        "no_gap": {"no_gap": 1},
        "unknown": {"unknown": 1},
    }


def test_parameter_errors_are_medians_by_emulator_effect_and_parameter_with_a_limit_for_certain_units():
    figures = score_on_rig(
        make_single_result("noise", "noise", parameters=(make_parameter(1.1), make_parameter(0.7))),
        make_single_result(
            "noise",
            "noise",
            parameters=(make_parameter(2.0, unit="1", name="slope@32"), make_parameter(1.5, unit="1", name="slope@48")),
        ),
        # The gap does not exceed the floor clearly, so the errors of this world are not counted.
        make_single_result("noise", "noise", ratio=1.0, parameters=(make_parameter(100.0),)),
    )["parameters"]
    assert figures["each"]["noise white: white_counts"]["of"] == 2
    assert figures["each"]["noise white: white_counts"]["median_relative_error"] == pytest.approx(0.2)
    assert figures["each"]["noise white: slope"]["of"] == 2
    assert figures["asked"] == pytest.approx(0.2)  # units with a limit, here counts: median of 0.1 and 0.3
    assert figures["others"] == pytest.approx(0.75)  # units without a limit: median of 1.0 and 0.5


def test_coverage_is_the_share_of_true_parameters_within_their_interval_without_parameters_lacking_one():
    """The true value is 1.0, in the last row -1.0. The second interval lacks the true value; the third row has none."""
    rows = (
        make_parameter(1.0, low=0.9, high=1.1),
        make_parameter(2.0, low=1.5, high=2.5),
        make_parameter(1.0),
        make_parameter(-1.0, truth=-1.0, low=-2.0, high=0.0),
    )
    figures = score_on_rig(make_single_result("noise", "noise", parameters=rows))["coverage"]
    assert (figures["count"], figures["of"]) == (2, 3)


def test_error_of_the_shrink_is_in_percentage_points():
    """The predicted and the measured shrink differ by 6 and by 2 percentage points: 4 on average."""
    figures = score_on_rig(
        make_single_result("noise", "noise", shrink=(0.80, 0.74)),
        make_single_result("noise", "noise", shrink=(0.5, 0.52)),
    )["shrink"]
    assert (figures["of"], figures["mean_points"]) == (2, pytest.approx(4.0))


def test_verdicts_of_seeds_agree_if_status_and_effects_are_equal():
    seeds = (
        ReportedVerdict("explained", ("noise",)),
        ReportedVerdict("partly_explained", ("noise",)),
        ReportedVerdict("explained", ("latency",)),
    )
    figures = score_on_rig(make_single_result("noise", "noise", verdicts_by_seed=seeds))["seeds"]
    assert (figures["count"], figures["of"]) == (1, 3)


def test_reference_diagnosers_and_exchanged_simulations_are_scored():
    figures = score_on_rig(
        make_single_result("noise", "noise", baseline_verdicts={"rules": "noise", "effect_blind": "latency"}),
        make_result(make_world(1, "none"), status="no_gap", verdict_shuffled=ReportedVerdict("unknown", ("unknown",))),
        make_result(make_world(2, "none"), status="no_gap", verdict_shuffled=ReportedVerdict("no_gap", ())),
        make_result(make_world(3, "none"), status="no_gap", verdict_shuffled=ReportedVerdict("explained", ("noise",))),
    )["simpler"]
    assert (figures["rules"]["share"], figures["effect_blind"]["share"]) == (1.0, 0.0)
    assert figures["shuffled_says_unknown_or_no_gap"]["count"] == 2


def test_whole_hand_is_scored_separately():
    figures = score(
        [make_single_result("noise", "noise"), make_result(make_world(1, "single", "noise", hand="allegro"), "latency")]
    )
    assert figures["rig4"]["single_first"]["share"] == 1.0
    assert figures["full_hand"]["single_first"]["share"] == 0.0
    assert score([make_single_result("noise", "noise")])["full_hand"] is None


def compute_full_score() -> dict:
    """Compute the score of six worlds of different kinds, one of them without a report."""
    shrink, landlock = (0.8, 0.7), "landlock and audit hook"
    parameters = (make_parameter(1.0, low=0.9, high=1.1),)
    seeds = (ReportedVerdict("no_gap", ()),) * 9
    return score([
        make_single_result("noise", "noise", shrink=shrink, parameters=parameters, isolation=landlock, runtime_s=2.0),
        make_single_result("latency", "noise", isolation="audit hook", is_location_found=True),
        make_result(make_world(2, "none"), status="no_gap", ratio=0.4, isolation=landlock, verdicts_by_seed=seeds),
        make_result(make_world(3, "several", "noise", "latency"), "noise", "latency", isolation=landlock),
        make_result(make_world(4, "outside", "unknown", effect="stuck_bit"), "noise", isolation=landlock),
        replace(
            make_result(make_world(5, "single", "noise")), verdict=ReportedVerdict("error", ()), error="KeyError: 3"
        ),
    ])  # fmt: skip


def test_sheet_marks_met_and_missed_limits():
    """One of three single causes is named first (33.3 %). The shrink is predicted as 80 % and measured as 70 %."""
    text = score_sheet(compute_full_score(), "Made by `taxel gap blind --worlds 6`.")
    rows = {line.split(" | ")[0].removeprefix("| "): line for line in text.splitlines() if line.startswith("| ")}
    assert rows["single effect named first"] == (
        "| single effect named first | at least 95 % | 33.3 % | 3 | 6 to 79 % | **missed** |"
    )
    assert rows["false alarms in worlds without a cause"].endswith("| 0.0 % | 1 | 0 to 79 % | met |")
    assert rows["the same: named without an unknown cause"].endswith("**missed** |")
    assert rows["two or three causes, micro-F1"].endswith("| 1.00 | 1 |  | met |")
    assert rows["predicted and measured shrink, mean absolute difference"].endswith("| 10.0 | 1 |  | **missed** |")
    assert rows["loaded location of a failed board or open line reported"].endswith("met |")


@pytest.mark.parametrize(("count", "of", "mark"), [(8, 8, ""), (7, 8, ""), (10, 10, "**missed**"), (9, 10, "met")])
def test_coverage_is_compared_with_its_limit_from_ten_intervals_on(count, of, mark):
    figures = compute_full_score()
    coverage = figures["rig4"]["coverage"]
    figures["rig4"]["coverage"] = {**coverage, "count": count, "of": of, "share": count / of, "ci95": (0.5, 1.0)}
    (line,) = [line for line in score_sheet(figures, "").splitlines() if line.startswith("| coverage")]
    assert line.split("|")[-2].strip() == mark


def test_sheet_states_command_isolation_and_errors():
    text = score_sheet(compute_full_score(), "Made by `taxel gap blind --worlds 6`.")
    assert text.startswith("# Blind check: score sheet\n\nMade by `taxel gap blind --worlds 6`.\n")
    assert "landlock and audit hook, 4 worlds; audit hook, 1 worlds" in text
    assert "- 5: KeyError: 3" in text
    assert "| truth | error | no_gap | noise |" in text
    assert "## The whole hand" not in text


def test_every_line_of_a_table_has_the_same_number_of_columns():
    text = score_sheet(compute_full_score(), "")
    for table in (paragraph for paragraph in text.split("\n\n") if paragraph.startswith("|")):
        assert len({line.count("|") for line in table.splitlines()}) == 1, table


def test_sheet_without_worlds_contains_neither_missed_limits_nor_nan_nor_none():
    text = score_sheet(score([]), "")
    assert "missed" not in text
    assert "nan" not in text
    assert "None" not in text
