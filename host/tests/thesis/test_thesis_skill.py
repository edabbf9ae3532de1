"""Skill of the reproduction: a constant scores 0, repeats count once."""

from dataclasses import replace

import numpy as np
import pytest

from taxel.cloud.distance import DistanceStats
from taxel.thesis.printed_result import build_printed_results
from taxel.thesis.skill import GROUPS, MAX_LOG_RATIO, STATISTICS, compute_skills, list_entries, select_counted


def replace_distances(result, change):
    """The result with `change` applied to every statistic of every cloud."""
    apply = dict.fromkeys(STATISTICS, change)

    def convert(stats: DistanceStats) -> DistanceStats:
        return replace(stats, **{key: function(getattr(stats, key)) for key, function in apply.items()})

    tables = {name: {key: convert(item) for key, item in getattr(result, name).items()} for name in TABLES}
    return replace(result, **tables)


TABLES = ("cad", "force", "sor", "to_sim", "cross")


def test_printed_numbers_have_a_skill_of_one():
    skills = compute_skills(build_printed_results())
    values = [skill.value for skill in (*skills.groups.values(), *skills.tables.values())]
    assert {value for value in values if value is not None} == {1.0}
    assert {(group, column) for group in GROUPS for column in STATISTICS} <= set(skills.groups)


@pytest.mark.parametrize("constant_m", [0.00362, 0.001, 0.02])
def test_one_constant_has_no_skill(constant_m):
    """3.62 mm passes the former criterion (a factor of 1.5) for 160 of 162 filtered entries."""
    results = [replace_distances(result, lambda _: constant_m) for result in build_printed_results()]
    skills = compute_skills(results)
    assert all(skill.value <= 1e-9 for (_, column), skill in skills.groups.items() if column in STATISTICS)


def test_best_constant_is_the_median_of_the_logarithms():
    skills = compute_skills(build_printed_results()).groups
    best = skills["force filter", "mean_m"].constant
    for factor in (0.9, 0.99, 1.01, 1.1):
        results = [replace_distances(result, lambda _, m=factor * best: m) for result in build_printed_results()]
        assert compute_skills(results).groups["force filter", "mean_m"].value <= 0.0


def test_common_factor_costs_its_logarithm():
    results = [replace_distances(result, lambda value: 1.1 * value) for result in build_printed_results()]
    skill = compute_skills(results).groups["real to sim", "rms_m"]
    assert skill.error == pytest.approx(np.log(1.1))
    assert skill.value == pytest.approx(1.0 - np.log(1.1) / skill.constant_error)


def test_repeated_quantities_count_once():
    entries = list_entries(build_printed_results())
    counted = select_counted(entries)
    numbers = {group: sum(e.group == group and e.statistic == "mean_m" for e in counted) for group in GROUPS}
    # SOR: 36 printed rows, of which one is a copy (Table I-6, N = 143, nSigma = 2)
    assert numbers == {
        "raw": 6,
        "force filter": 30,
        "SOR": 35,
        "contact propagation": 3,
        "real to sim": 12,
        "cross-shape": 12,
    }
    assert [entry.row for entry in entries if entry.is_copy and entry.statistic == "mean_m"] == [
        "triangular, N 143, nSigma 2"
    ]
    points = [entry for entry in counted if entry.statistic == "points"]
    assert sum(entry.group == "real to sim" for entry in points) == 0  # printed in other tables, too


def test_value_of_zero_counts_as_the_largest_deviation():
    results = [replace_distances(result, lambda _: 0.0) for result in build_printed_results()]
    assert compute_skills(results).groups["raw", "mean_m"].error == MAX_LOG_RATIO
