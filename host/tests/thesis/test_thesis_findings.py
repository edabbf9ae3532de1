"""Findings and tables, computed from the printed numbers of the thesis, which must reproduce themselves."""

import csv
import json
from dataclasses import replace

import pytest

from taxel.cloud.distance import DistanceStats
from taxel.thesis.cloud_names import CLEANED, FILTERED, REAL, SIM, SPREAD
from taxel.thesis.findings import count_reproduced, evaluate_findings
from taxel.thesis.gap_summary import summarise_gap
from taxel.thesis.object_result import ObjectResult
from taxel.thesis.prevalence import LineShares
from taxel.thesis.printed import INCONSISTENCIES, OBJECTS, STAGES, get_printed_name, select_rows
from taxel.thesis.printed_result import build_printed_results
from taxel.thesis.shape_counts import SINGLE_APPROACHES, WHOLE_CLOUDS, ShapeCount
from taxel.thesis.statements import STATEMENTS
from taxel.thesis.tables import build_tables, compute_contributions, find_best_sor

CONTRADICTED = "prism_points"
"""Statement that the printed tables contradict for every object."""

NOT_PRINTED = {"propagation_prevalent", "crosstalk", "shape_of_whole_clouds", "shape_of_single_approaches"}
"""Statements for which the thesis prints no numbers."""


@pytest.fixture
def printed_results():
    return list(build_printed_results())


def find(findings, key):
    """Return the finding of the statement with this key."""
    return next(finding for finding in findings if finding.statement.key == key)


def test_printed_numbers_reproduce_every_finding_that_they_do_not_contradict(printed_results):
    findings = evaluate_findings(printed_results)
    assert {finding.statement.key for finding in findings} == {item.key for item in STATEMENTS} - NOT_PRINTED
    assert [finding.statement.key for finding in findings if not finding.is_reproduced] == [CONTRADICTED]


def test_statement_that_the_printed_tables_contradict_for_every_object_is_not_counted(printed_results):
    findings = evaluate_findings(printed_results)
    assert not find(findings, CONTRADICTED).is_counted
    assert count_reproduced(findings) == (28, 28)  # of 29 findings


def test_every_statement_has_a_unique_key_a_source_and_a_test_in_words():
    assert len(STATEMENTS) >= 18
    assert len({item.key for item in STATEMENTS}) == len(STATEMENTS)
    assert all("5.6" in item.source or "conclusion" in item.source for item in STATEMENTS)
    assert all(item.criterion and item.text.endswith(".") for item in STATEMENTS)


def test_object_for_which_the_printed_table_contradicts_a_statement_is_not_counted(printed_results):
    """The thesis states that distances are smallest at thresholds above 190 counts; its table of one object differs."""
    finding = find(evaluate_findings(printed_results), "smallest_above_190")
    assert finding.counted == ("rectangular", "triangular")
    assert not finding.holds["cylindrical"]
    assert finding.is_reproduced


def change_cad(**stats):
    """Return a function that changes the distances to CAD in a result. stats: by short name of the cloud, a function
    that changes its statistics.
    """
    return lambda result: replace(
        result, cad={name: stats.get(key, lambda s: s)(s) for name, s in result.cad.items() for key in [KEYS[name]]}
    )


KEYS = {REAL: "real", SIM: "sim", FILTERED: "filtered", CLEANED: "cleaned", SPREAD: "spread"}
"""Short names of the clouds, for the arguments of `change_cad`."""


def change_force(threshold, **values):
    """Return a function that changes the statistics of a result at one threshold of the force filter."""
    return lambda result: replace(result, force={**result.force, threshold: replace(result.force[threshold], **values)})


def change_stage(index, **values):
    """Return a function that changes the real-to-simulated distances of a result at one treatment stage."""
    stage = STAGES[index]
    return lambda result: replace(result, to_sim={**result.to_sim, stage: replace(result.to_sim[stage], **values)})


def change_cross(side, mesh):
    """Return a function that makes the distances of a result's cloud to one CAD model very small."""
    small = DistanceStats(9, 1e-4, 1e-4, 1e-4, 1e-4)
    return lambda result: replace(result, cross={**result.cross, (side, mesh): small})


FAILURES = [
    ("denser", change_cad(real=lambda s: replace(s, points=10))),
    ("noisier", change_cad(sim=lambda s: replace(s, std_m=0.001))),
    ("simulation_nearer", change_cad(sim=lambda s: replace(s, rms_m=0.002))),
    ("outliers", change_cad(sim=lambda s: replace(s, max_m=0.03))),
    ("force_filter_falls", change_force(170, mean_m=0.0050)),
    ("surge", change_force(200, rms_m=0.0030)),
    ("surge", change_force(210, mean_m=0.0090)),
    ("surge_removes_data", change_force(200, points=3000)),
    ("smallest_above_190", change_force(180, rms_m=0.0001)),
    ("high_threshold_not_semantic", change_force(320, points=3000)),
    ("majority_above_190", change_force(190, points=1000)),
    ("sor_improves", change_cad(cleaned=lambda s: replace(s, rms_m=0.01))),
    ("sor_n_of_prism", lambda r: replace(r, sor={**r.sor, (701, 2.0): replace(r.sor[701, 2.0], mean_m=0.001)})),
    ("sor_sigma_of_box", lambda r: replace(r, sor={**r.sor, (20, 4.0): replace(r.sor[20, 4.0], mean_m=0.001)})),
    ("one_sor_setting", change_cad(filtered=lambda s: replace(s, rms_m=0.001))),
    ("propagation_densifies", change_cad(spread=lambda s: replace(s, points=9000))),
    ("propagation_worsens", change_cad(spread=lambda s: replace(s, rms_m=0.0001))),
    ("propagation_nears_reality", change_cad(spread=lambda s: replace(s, mean_m=0.03))),
    ("treatment_removes_outliers", change_cad(cleaned=lambda s: replace(s, max_m=0.05))),
    ("sor_removes_outliers", change_stage(2, max_m=0.0299)),
    ("continuous_decrease", change_stage(1, rms_m=0.0043)),
    ("same_trend", change_stage(1, rms_m=0.0030)),
    ("sor_against_force", change_stage(1, mean_m=0.00320)),
    ("propagation_largest", change_stage(3, mean_m=0.0030)),
    ("prism_force_step", change_stage(1, mean_m=0.00395)),
    ("prism_forces_higher", change_force(190, points=3400)),
    ("prism_propagation_step", change_stage(3, mean_m=0.0030)),
    ("own_model_nearest", change_cross(SIM, "cylindrical")),
]
"""Keys of statements, each with a change of the rectangular prism's printed result for which the statement fails."""


@pytest.mark.parametrize(("key", "change"), FAILURES)
def test_finding_that_fails_for_the_rectangular_prism_is_not_reproduced_and_names_it(printed_results, key, change):
    finding = find(evaluate_findings([change(printed_results[0]), *printed_results[1:]]), key)
    assert not finding.is_reproduced
    assert "rectangular" in finding.failed
    assert finding.reason.startswith("fails for ")


def test_every_statement_with_printed_numbers_has_a_test_case_in_which_it_fails():
    """Exceptions: the statement that the printed numbers contradict; "sor_settings_vary", which has its own test."""
    assert {key for key, _ in FAILURES} == {item.key for item in STATEMENTS} - NOT_PRINTED - {
        CONTRADICTED,
        "sor_settings_vary",
    }


def test_finding_that_sor_settings_vary_is_not_reproduced_with_the_same_best_setting_for_all_objects(printed_results):
    best = {"rectangular": (20, 2.0), "cylindrical": (20, 2.0), "triangular": (20, 2.0)}  # N and nSigma
    changed = [
        replace(r, sor={**r.sor, best[r.printed_name]: replace(r.sor[best[r.printed_name]], mean_m=0.0001)})
        for r in printed_results
    ]
    assert not find(evaluate_findings(changed), "sor_settings_vary").is_reproduced


@pytest.mark.parametrize(
    ("key", "prevalence", "lines", "is_reproduced"),
    [
        ("propagation_prevalent", {FILTERED: 0.5, CLEANED: 0.6, SPREAD: 1.0}, None, True),
        ("propagation_prevalent", {FILTERED: 0.5, CLEANED: 1.0, SPREAD: 1.0}, None, False),
        ("crosstalk", {}, LineShares(0.6, 0.3), True),
        ("crosstalk", {}, LineShares(0.3, 0.6), False),
        ("crosstalk", {}, LineShares(0.0, 0.0), False),
    ],
)
def test_findings_on_prevalence_and_crosstalk_follow_from_the_results_alone(
    printed_results, key, prevalence, lines, is_reproduced
):
    """The thesis prints no numbers for these findings.

    Prevalent: propagation changes more grasps than each filter. Crosstalk: removed points share a line with a
    contact more often (first number of `LineShares`) than inactive taxels do (second number).
    """
    results = [replace(result, prevalence=prevalence, line_shares=lines) for result in printed_results]
    finding = find(evaluate_findings(results), key)
    assert finding.is_reproduced == is_reproduced
    assert finding.printed == {}


def test_95_percent_of_single_approaches_suffice_while_every_whole_cloud_must_be_identified(printed_results):
    shapes = [ShapeCount(SINGLE_APPROACHES, 3, name, 19 if name == "rectangular" else 20, 20) for name in OBJECTS]
    shapes += [ShapeCount(WHOLE_CLOUDS, 3, name, 1 if name == "triangular" else 2, 2) for name in OBJECTS]
    findings = evaluate_findings(printed_results, shapes)
    assert find(findings, "shape_of_single_approaches").is_reproduced  # 59 of 60
    assert not find(findings, "shape_of_whole_clouds").is_reproduced  # 5 of 6


def test_results_are_restored_from_json(printed_results):
    first = replace(
        printed_results[0], iterations={"top": 10}, prevalence={SPREAD: 1.0}, line_shares=LineShares(0.5, 0.25)
    )
    assert ObjectResult.from_json(json.loads(json.dumps(first.to_json()))) == first
    assert ObjectResult.from_json(json.loads(json.dumps(printed_results[1].to_json()))) == printed_results[1]


def test_all_tables_of_chapter_5_and_appendix_i_are_built(printed_results):
    numbers = {table.number for table in build_tables(printed_results)}
    assert {f"I-{number}" for number in range(1, 19)} | {"5.1", "5.2", "5.3", "5.4", "5.5"} <= numbers


def test_tables_from_printed_numbers_have_ratios_of_one(printed_results):
    for table in build_tables(printed_results):
        for row in table.rows:
            for column in table.columns:
                ratio = row.ratio(column)
                if ratio is not None:
                    assert ratio == pytest.approx(1.0, rel=0.02), (table.number, row.key, column)


def test_csv_file_of_a_table_contains_reproduced_and_printed_values(printed_results, tmp_path):
    table = next(table for table in build_tables(printed_results) if table.number == "5.2")
    table.write(tmp_path / table.file_name)
    with (tmp_path / "table_5_2.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert rows[0]["object"] == "rectangular"
    assert float(rows[0]["real_points_ours"]) == float(rows[0]["real_points_thesis"]) == 3504.0  # printed in Table 5.2


def test_table_of_grasps_compares_the_iterations_of_each_approach_with_the_printed_number(printed_results):
    first = replace(printed_results[0], iterations={"wide_side_1": 6, "top": 9})
    grasps = build_tables([first, *printed_results[1:]])[0]
    ratios = {row.key[1]: row.ratio("iterations") for row in grasps.rows if row.key[0] == "rectangular"}
    assert ratios["Wide side face 1"] == 1.0
    assert ratios["Top face"] == 0.9  # 9 of 10
    assert ratios["Side edge"] is None  # not in the dataset
    assert len(grasps.rows) == 15


def test_each_inconsistency_of_the_thesis_has_a_text():
    assert all(INCONSISTENCIES)


def test_contributions_are_percentages_of_the_total_decrease_and_zero_without_a_decrease():
    assert compute_contributions(dict(zip(STAGES, (4.0, 3.0, 2.5, 2.0), strict=True))) == [50.0, 25.0, 25.0]
    assert compute_contributions(dict.fromkeys(STAGES, 1.0)) == [0.0, 0.0, 0.0]


def test_printed_name_depends_on_the_first_letters_of_a_name():
    assert get_printed_name("cylinder") == "cylindrical"
    assert get_printed_name("Rectangular prism") == "rectangular"
    assert get_printed_name("mug") == "mug"


def test_best_sor_setting_of_the_rectangular_prism_is_that_of_table_5_4(printed_results):
    assert find_best_sor(printed_results[0]) == (20, 1.0)


def test_gap_summary_contains_percentages_of_named_causes_and_of_treatment_steps(printed_results):
    entries = [
        {"name": "contact_propagation", "in_verdict": True, "shapley_share": 0.6},
        {"name": "noise", "in_verdict": True, "shapley_share": 0.2},
        {"name": "latency", "in_verdict": False, "shapley_share": 0.0},
    ]
    report = {"effects": entries, "verdict": {"one_line": "x", "effects": ["contact_propagation", "noise"]}}
    printed = {
        name: {row["stage"]: row["mean_m"] for row in select_rows("I_10_to_12_sim_to_real", name)} for name in OBJECTS
    }
    summary = summarise_gap(report, printed_results, printed)
    assert summary.is_largest_cause_found
    assert summary.shares == pytest.approx({"contact_propagation": 75.0, "noise": 25.0})  # 0.6 and 0.2 of 0.8
    assert all(value == pytest.approx(printed) for value, printed in summary.steps.values())
