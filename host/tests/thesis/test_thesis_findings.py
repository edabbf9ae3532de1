"""Findings and tables, computed from the printed numbers of the thesis, which must reproduce themselves."""

import csv
from dataclasses import replace

import pytest

from taxel.cloud.distance import DistanceStats
from taxel.thesis.distance_agreement import compare_distances
from taxel.thesis.findings import compute_further_results, evaluate_findings
from taxel.thesis.gap_summary import summarise_gap
from taxel.thesis.matching import (
    CLEANED,
    FILTERED,
    REAL,
    SIM,
    SPREAD,
    ObjectResult,
)
from taxel.thesis.printed import (
    INCONSISTENCIES,
    OBJECTS,
    PRINTED_SOR,
    STAGES,
    get_distances,
    get_printed_name,
    select_rows,
)
from taxel.thesis.tables import TITLES, build_tables, compute_contributions, find_best_sor


def parse_stats(row, points: str = "points") -> DistanceStats:
    """Statistics of a printed row; `points` is the column of the number of points."""
    return DistanceStats(int(row.get(points, 0)), **get_distances(row))


def build_printed_result(name: str) -> ObjectResult:
    """The printed numbers of an object as if they were measured."""
    force = {int(row["threshold_counts"]): parse_stats(row) for row in select_rows("I_1_to_3_force_filter", name)}
    sor = {(int(row["n_neighbors"]), row["n_sigma"]): parse_stats(row) for row in select_rows("I_4_to_6_sor", name)}
    sim, spread = (parse_stats(row) for row in select_rows("I_7_to_9_simulation_cad", name))
    stages = select_rows("I_10_to_12_sim_to_real", name)
    cross = {
        (row["cloud_source"], row["cad_object"]): parse_stats(row)
        for row in select_rows("I_13_to_18_cross_shape", name, "cloud_object")
    }
    (count,) = select_rows("5_2_contact_points", TITLES[name])
    return ObjectResult(
        name,
        name,
        int(count["grasps"]),
        {REAL: force[150], FILTERED: force[190], CLEANED: sor[PRINTED_SOR[name]], SIM: sim, SPREAD: spread},
        force,
        sor,
        {n: n for n, _ in sor},
        {row["stage"]: parse_stats(row, "real_points") for row in stages},
        {row["stage"]: int(row["sim_points"]) for row in stages},
        cross,
    )


@pytest.fixture
def printed_results():
    return [build_printed_result(name) for name in OBJECTS]


def test_printed_numbers_reproduce_every_finding(printed_results):
    findings = evaluate_findings(printed_results)
    assert [finding.number for finding in findings] == list(range(1, 13))
    assert {finding.number: finding.holds for finding in findings if not finding.is_reproduced} == {}


def test_numbers_of_findings_equal_the_printed_numbers(printed_results):
    for finding in evaluate_findings(printed_results):
        printed = pytest.approx(list(finding.printed), rel=0.04, abs=0.06)
        assert list(finding.numbers.values()) == printed, finding.number


@pytest.mark.parametrize(
    ("number", "change"),
    [
        (1, lambda result: replace(result, cad={**result.cad, SIM: replace(result.cad[SIM], points=10)})),
        (3, lambda result: replace(result, cad={**result.cad, FILTERED: replace(result.cad[FILTERED], rms_m=1.0)})),
        (6, lambda result: replace(result, cad={**result.cad, CLEANED: replace(result.cad[CLEANED], points=100)})),
        (8, lambda result: replace(result, cad={**result.cad, SPREAD: result.cad[SIM]})),
        (10, lambda result: replace(result, to_sim={**result.to_sim, STAGES[1]: result.to_sim[STAGES[0]]})),
        (
            12,
            lambda result: replace(
                result, cross={**result.cross, (REAL, "cylindrical"): DistanceStats(9, 1e-4, 1e-4, 1e-4, 0.0)}
            ),
        ),
    ],
)
def test_finding_that_fails_for_one_object_is_not_reproduced(printed_results, number, change):
    results = [change(printed_results[0]), *printed_results[1:]]
    finding = next(finding for finding in evaluate_findings(results) if finding.number == number)
    assert not finding.is_reproduced
    assert not finding.holds["rectangular"]


def test_tables_from_printed_numbers_have_a_ratio_of_one(printed_results, tmp_path):
    tables = build_tables(printed_results)
    assert [table.number for table in tables][2:5] == ["I-1", "I-2", "I-3"]
    assert {f"I-{number}" for number in range(1, 19)} | {"5.2", "5.3", "5.4", "5.5"} <= {
        table.number for table in tables
    }
    for table in tables:
        for row in table.rows:
            for column in table.columns:
                ratio = row.ratio(column)
                if ratio is not None:
                    assert ratio == pytest.approx(1.0, rel=0.02), (table.number, row.key, column)
    tables[0].write(tmp_path / tables[0].file_name)
    with (tmp_path / "table_5_2.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert rows[0]["object"] == "rectangular"
    assert float(rows[0]["real_points_ours"]) == float(rows[0]["real_points_thesis"]) == 3504.0


def test_further_results_computed_from_printed_numbers_are_those_of_the_thesis(printed_results):
    removed, threshold, settings, sor = compute_further_results(printed_results)
    assert removed.numbers == {"rectangular": "16.0 %", "cylindrical": "27.4 %", "triangular": "12.5 %"}
    assert threshold.numbers["cylindrical"] == "at most 190"
    assert settings.numbers["cylindrical"] == "20 / 2, 2759 / 2, 690 / 3"
    assert "; ".join(settings.numbers.values()) == settings.printed
    assert sor.numbers["cylindrical"] == "no"
    assert all(INCONSISTENCIES), "each inconsistency of the thesis has a text"


def test_contributions_are_shares_of_the_total_decrease():
    assert compute_contributions(dict(zip(STAGES, (4.0, 3.0, 2.5, 2.0), strict=True))) == [50.0, 25.0, 25.0]
    assert compute_contributions(dict.fromkeys(STAGES, 1.0)) == [0.0, 0.0, 0.0]


def test_printed_name_depends_on_the_first_letters_of_a_name():
    assert get_printed_name("cylinder") == "cylindrical"
    assert get_printed_name("Rectangular prism") == "rectangular"
    assert get_printed_name("mug") == "mug"


def test_best_sor_settings_have_the_smallest_mean(printed_results):
    assert find_best_sor(printed_results[0]) == (20, 1.0)


def test_gap_summary_has_shares_of_causes_and_steps(printed_results):
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
    assert summary.shares == pytest.approx({"contact_propagation": 75.0, "noise": 25.0})
    assert all(value == pytest.approx(printed) for value, printed in summary.steps.values())


def test_printed_distances_agree_and_a_deviating_one_is_listed(printed_results):
    agreement = compare_distances(build_tables(printed_results))
    assert agreement.count_within_factor == len(agreement.distances) == 234
    first = printed_results[0]
    stats = first.cross[REAL, "cylindrical"]
    cross = {**first.cross, (REAL, "cylindrical"): replace(stats, mean_m=0.5 * stats.mean_m, rms_m=1.4 * stats.rms_m)}
    changed = compare_distances(build_tables([replace(first, cross=cross), *printed_results[1:]]))
    assert (changed.count_within_factor, len(changed.distances)) == (233, 234)
    assert "Table I-13, cylindrical, mean: " in changed.summary
    assert "ratio 0.500" in changed.summary
    assert [item["ratio"] for item in changed.to_json()["farthest"]] == [pytest.approx(0.5)]
