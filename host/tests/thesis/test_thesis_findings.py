"""The findings and tables, checked on the thesis's own numbers: whoever measured what it printed must reproduce it."""

from __future__ import annotations

import csv
from dataclasses import replace

import pytest

from taxel.cloud.distance import DistanceStats
from taxel.thesis.findings import findings, others
from taxel.thesis.gap_beside import beside
from taxel.thesis.matching import (
    CLEANED,
    FILTERED,
    REAL,
    SIM,
    SPREAD,
    ObjectResult,
)
from taxel.thesis.nearness import nearness_of
from taxel.thesis.printed import INCONSISTENT, OBJECTS, SOR_OF, STAGES, match_of, of_dataset, rows_of
from taxel.thesis.tables import PRINTED_NAMES, all_tables, best_sor, contributions

NEAR = DistanceStats(9, 1e-4, 0.0, 1e-4, 1e-4)


def matched(row, points: str = "points") -> DistanceStats:
    return DistanceStats(int(row.get(points, 0)), **match_of(row))


def as_printed(word: str) -> ObjectResult:
    """What the thesis printed of an object, as if it were ours."""
    force = {int(row["threshold_counts"]): matched(row) for row in rows_of("I_1_to_3_force_filter", word)}
    sor = {(int(row["n_neighbors"]), row["n_sigma"]): matched(row) for row in rows_of("I_4_to_6_sor", word)}
    sim, spread = (matched(row) for row in rows_of("I_7_to_9_simulation_cad", word))
    stages = rows_of("I_10_to_12_sim_to_real", word)
    cross = {
        (row["cloud_source"], row["cad_object"]): matched(row)
        for row in rows_of("I_13_to_18_cross_shape", word, "cloud_object")
    }
    (count,) = rows_of("5_2_contact_points", PRINTED_NAMES[word])
    return ObjectResult(
        word,
        word,
        int(count["grasps"]),
        {REAL: force[150], FILTERED: force[190], CLEANED: sor[SOR_OF[word]], SIM: sim, SPREAD: spread},
        force,
        sor,
        {n: n for n, _ in sor},
        {row["stage"]: matched(row, "real_points") for row in stages},
        {row["stage"]: int(row["sim_points"]) for row in stages},
        cross,
    )


@pytest.fixture
def printed_results():
    return [as_printed(word) for word in OBJECTS]


def test_the_thesis_reproduces_itself(printed_results):
    found = findings(printed_results)
    assert [one.number for one in found] == list(range(1, 13))
    assert {one.number: one.holds for one in found if not one.reproduced} == {}


def test_the_numbers_are_those_that_the_thesis_states(printed_results):
    for one in findings(printed_results):
        assert list(one.numbers.values()) == pytest.approx(list(one.thesis), rel=0.04, abs=0.06), one.number


@pytest.mark.parametrize(
    ("number", "broken"),
    [
        (1, lambda one: replace(one, cad={**one.cad, SIM: replace(one.cad[SIM], points=10)})),
        (3, lambda one: replace(one, cad={**one.cad, FILTERED: replace(one.cad[FILTERED], rms_m=1.0)})),
        (6, lambda one: replace(one, cad={**one.cad, CLEANED: replace(one.cad[CLEANED], points=100)})),
        (8, lambda one: replace(one, cad={**one.cad, SPREAD: one.cad[SIM]})),
        (10, lambda one: replace(one, to_sim={**one.to_sim, STAGES[1]: one.to_sim[STAGES[0]]})),
        (
            12,
            lambda one: replace(
                one, cross={**one.cross, (REAL, "cylindrical"): DistanceStats(9, 1e-4, 1e-4, 1e-4, 0.0)}
            ),
        ),
    ],
)
def test_a_finding_breaks_with_one_object(printed_results, number, broken):
    results = [broken(printed_results[0]), *printed_results[1:]]
    found = next(one for one in findings(results) if one.number == number)
    assert not found.reproduced
    assert not found.holds["rectangular"]


def test_tables_of_the_thesis_beside_itself_have_a_ratio_of_one(printed_results, tmp_path):
    tables = all_tables(printed_results)
    assert [table.number for table in tables][2:5] == ["I-1", "I-2", "I-3"]
    assert {f"I-{number}" for number in range(1, 19)} | {"5.2", "5.3", "5.4", "5.5"} <= {one.number for one in tables}
    for table in tables:
        for row in table.rows:
            for column in table.columns:
                ratio = row.ratio(column)
                if ratio is not None and table.number not in ("5.4", "5.13"):
                    assert ratio == pytest.approx(1.0, rel=0.02), (table.number, row.key, column)
    tables[0].write(tmp_path / tables[0].file_name)
    with (tmp_path / "table_5_2.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert rows[0]["object"] == "rectangular"
    assert float(rows[0]["real_points_ours"]) == float(rows[0]["real_points_thesis"]) == 3504.0


def test_what_the_text_says_and_its_tables_do_not(printed_results):
    surge, lowest, best, sor = others(printed_results)
    assert surge.numbers == {"rectangular": "16.0 %", "cylindrical": "27.4 %", "triangular": "12.5 %"}
    assert lowest.numbers["cylindrical"] == "at most 190"
    assert best.numbers["cylindrical"] == "20 / 2, 2759 / 2, 690 / 3"
    assert "; ".join(best.numbers.values()) == best.thesis
    assert sor.numbers["cylindrical"] == "no"
    assert all(INCONSISTENT)


def test_contributions_are_shares_of_the_whole_fall():
    assert contributions(dict(zip(STAGES, (4.0, 3.0, 2.5, 2.0), strict=True))) == [50.0, 25.0, 25.0]
    assert contributions(dict.fromkeys(STAGES, 1.0)) == [0.0, 0.0, 0.0]


def test_objects_are_known_by_the_beginning_of_their_names():
    assert of_dataset("cylinder") == "cylindrical"
    assert of_dataset("Rectangular prism") == "rectangular"
    assert of_dataset("mug") == "mug"


def test_the_best_settings_have_the_smallest_mean(printed_results):
    assert best_sor(printed_results[0]) == (20, 1.0)


def test_the_diagnosis_stands_beside_the_steps(printed_results):
    entries = [
        {"name": "contact_propagation", "in_verdict": True, "shapley_share": 0.6},
        {"name": "noise", "in_verdict": True, "shapley_share": 0.2},
        {"name": "latency", "in_verdict": False, "shapley_share": 0.0},
    ]
    report = {"effects": entries, "verdict": {"one_line": "x", "effects": ["contact_propagation", "noise"]}}
    printed = {
        word: {row["stage"]: row["mean_m"] for row in rows_of("I_10_to_12_sim_to_real", word)} for word in OBJECTS
    }
    found = beside(report, printed_results, printed)
    assert found.finds_largest
    assert found.shares == pytest.approx({"contact_propagation": 75.0, "noise": 25.0})
    assert all(ours == pytest.approx(theirs) for ours, theirs in found.steps.values())


def test_distances_as_printed_are_all_near_and_one_that_is_not_is_named(printed_results):
    near = nearness_of(all_tables(printed_results))
    assert near.near == len(near.distances) == 234
    first = printed_results[0]
    own = first.cross[REAL, "cylindrical"]
    cross = {**first.cross, (REAL, "cylindrical"): replace(own, mean_m=0.5 * own.mean_m, rms_m=1.4 * own.rms_m)}
    less = nearness_of(all_tables([replace(first, cross=cross), *printed_results[1:]]))
    assert (less.near, len(less.distances)) == (233, 234)
    assert "Table I-13, cylindrical, mean: " in less.one_line
    assert "0.500 of the thesis's" in less.one_line
    assert [one["ratio"] for one in less.to_json()["farthest"]] == [pytest.approx(0.5)]
