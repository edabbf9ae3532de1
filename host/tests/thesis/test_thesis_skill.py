"""Skill of the reproduction relative to the best constant: 1 for the printed numbers, at most 0 for a constant."""

from dataclasses import replace

import numpy as np
import pytest

from taxel.cloud.distance import DistanceStats
from taxel.thesis.printed_result import build_printed_results
from taxel.thesis.skill import GROUPS, MAX_LOG_RATIO, STATISTICS, compute_skills, list_entries, select_counted


def replace_distances(result, change):
    """Return the result with `change` applied to mean, RMS, maximum and standard deviation in every table."""

    def convert(stats: DistanceStats) -> DistanceStats:
        return replace(stats, **{key: change(getattr(stats, key)) for key in STATISTICS})

    tables = {name: {key: convert(item) for key, item in getattr(result, name).items()} for name in TABLES}
    return replace(result, **tables)


TABLES = ("cad", "force", "sor", "to_sim", "cross")


def test_printed_numbers_have_a_skill_of_one():
    skills = compute_skills(build_printed_results())
    values = [skill.value for skill in (*skills.groups.values(), *skills.tables.values())]
    assert {value for value in values if value is not None} == {1.0}


def test_every_group_of_tables_has_a_skill_for_every_statistic_of_distances():
    skills = compute_skills(build_printed_results())
    assert {(group, column) for group in GROUPS for column in STATISTICS} <= set(skills.groups)


@pytest.mark.parametrize("constant_m", [0.00362, 0.001, 0.02])
def test_one_constant_for_all_distances_has_a_skill_of_at_most_zero(constant_m):
    """A skill of 1 means equal to the printed values, a skill of 0 as near to them as the best constant.

    A constant of 3.62 mm differs by less than a factor of 1.5 from 160 of 162 printed values after the filters.
    """
    results = [replace_distances(result, lambda _: constant_m) for result in build_printed_results()]
    skills = compute_skills(results)
    assert all(skill.value <= 1e-9 for (_, column), skill in skills.groups.items() if column in STATISTICS)


def test_no_other_constant_is_better_than_the_reported_constant():
    """The reported constant has the skill 0 by definition, so any other constant has at most this skill."""
    skills = compute_skills(build_printed_results()).groups
    best = skills["force filter", "mean_m"].constant
    for factor in (0.9, 0.99, 1.01, 1.1):
        results = [replace_distances(result, lambda _, m=factor * best: m) for result in build_printed_results()]
        assert compute_skills(results).groups["force filter", "mean_m"].value <= 0.0


def test_error_of_values_with_a_common_factor_is_the_factor_s_logarithm():
    """The skill is 1 minus this error, divided by the error of the best constant."""
    results = [replace_distances(result, lambda value: 1.1 * value) for result in build_printed_results()]
    skill = compute_skills(results).groups["real to sim", "rms_m"]
    assert skill.error == pytest.approx(np.log(1.1))
    assert skill.value == pytest.approx(1.0 - np.log(1.1) / skill.constant_error)


def test_repeated_quantities_are_counted_once():
    counted = select_counted(list_entries(build_printed_results()))
    numbers = {group: sum(e.group == group and e.statistic == "mean_m" for e in counted) for group in GROUPS}
    # For each of the three objects: 2 raw clouds, 10 thresholds above the raw one, 12 settings of SOR, 1 propagated
    # cloud, 4 treatments, and 2 clouds with 2 other models. One SOR row is a copy (Table I-6, N = 143, nSigma = 2).
    assert numbers == {
        "raw": 6,
        "force filter": 30,
        "SOR": 35,
        "contact propagation": 3,
        "real to sim": 12,
        "cross-shape": 12,
    }


def test_only_the_row_of_143_neighbours_is_a_copy_of_another_row():
    entries = list_entries(build_printed_results())
    copied = [entry.row for entry in entries if entry.is_copy and entry.statistic == "mean_m"]
    assert copied == ["triangular, N 143, nSigma 2"]


def test_numbers_of_points_in_the_tables_from_real_to_sim_are_repeats_of_other_tables():
    counted = select_counted(list_entries(build_printed_results()))
    assert not [entry for entry in counted if (entry.group, entry.statistic) == ("real to sim", "points")]


def test_value_of_zero_has_the_largest_deviation():
    results = [replace_distances(result, lambda _: 0.0) for result in build_printed_results()]
    assert compute_skills(results).groups["raw", "mean_m"].error == MAX_LOG_RATIO
