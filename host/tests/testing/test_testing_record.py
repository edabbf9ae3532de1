"""Limits, and outcomes of measurements, phases and tests."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from taxel_tools.testing.record import Finding, Limit, Outcome, judge_phase, judge_test, judge_value

BOUNDS = st.none() | st.floats(-1e6, 1e6)


@pytest.mark.parametrize(
    ("limit", "text"),
    [
        (Limit(None, 8.0), "<= 8"),
        (Limit(3.0, None), ">= 3"),
        (Limit(5.0, 20.0), "5 to 20"),
        (Limit(-1.5, 0.25), "-1.5 to 0.25"),
        (Limit(2.0, 2.0), "= 2"),
        (Limit(None, None), "no limit"),
        (Limit(None, 1234567.0), "<= 1234567"),
    ],
)
def test_a_limit_is_formatted_with_mathematical_signs(limit, text):
    assert str(limit) == text


@pytest.mark.parametrize("value", [math.nan, None, "5"])
def test_a_value_that_is_not_a_number_is_never_within_a_limit(value):
    for limit in (Limit(None, 8.0), Limit(0.0, None), Limit(None, None)):
        assert not limit.contains(value)
        assert limit.severity(value) == math.inf


def test_bounds_are_included_in_the_limit():
    assert Limit(5.0, 20.0).contains(5.0)
    assert Limit(5.0, 20.0).contains(20.0)
    assert not Limit(5.0, 20.0).contains(math.nextafter(20.0, 21.0))


@pytest.mark.parametrize(
    ("low", "high", "value", "severity"),
    [
        (None, 8.0, 33.6, 4.2),
        (None, 8.0, 4.0, 0.5),
        (None, 8.0, -4.0, 0.0),
        (3.0, None, 1.5, 2.0),
        (3.0, None, 6.0, 0.5),
        (3.0, None, 0.0, math.inf),
        (3.0, None, -1.0, math.inf),
        (5.0, 20.0, 40.0, 2.0),
        (5.0, 20.0, 2.5, 2.0),
        (5.0, 20.0, 10.0, 0.5),
        (None, 0.0, 1.0, math.inf),
        (None, 0.0, 0.0, 0.0),
        (0.0, None, -1.0, math.inf),
        (-10.0, 10.0, -20.0, 2.0),
        (None, -5.0, -2.5, 2.0),
        (None, 8.0, math.inf, math.inf),
        (None, 8.0, -math.inf, 0.0),
    ],
)
def test_severity_is_the_factor_beyond_the_bound(low, high, value, severity):
    assert Limit(low, high).severity(value) == pytest.approx(severity)


@given(BOUNDS, BOUNDS, st.floats(allow_nan=False))
def test_severity_is_above_1_exactly_outside_the_limit(first, second, value):
    low, high = (min(first, second), max(first, second)) if None not in (first, second) else (first, second)
    limit = Limit(low, high)
    assert (limit.severity(value) <= 1.0) == limit.contains(value)
    assert limit.severity(value) >= 0.0


@pytest.mark.parametrize("bound", [1.0, math.nextafter(2.0, 0.0), 3.0, 5e-324])
def test_the_severity_of_the_next_float_beyond_a_bound_is_above_1(bound):
    assert Limit(None, bound).severity(math.nextafter(bound, math.inf)) > 1.0
    assert Limit(None, bound).severity(math.nextafter(bound, 0.0)) < 1.0
    assert Limit(bound, None).severity(math.nextafter(bound, 0.0)) > 1.0


@pytest.mark.parametrize(("low", "high"), [(2.0, 1.0), (math.nan, None), (None, math.nan)])
def test_an_empty_limit_is_refused(low, high):
    with pytest.raises(ValueError, match="expected a lower bound below the upper bound"):
        Limit(low, high)


def test_even_nan_passes_without_a_limit_and_fails_with_one():
    assert judge_value(math.nan, None) is Outcome.PASS
    assert judge_value(math.nan, Limit(None, 8.0)) is Outcome.FAIL


def test_a_phase_without_measurements_passes_unless_it_has_a_finding():
    assert judge_phase([], []) is Outcome.PASS
    assert judge_phase([], [Finding("open line", "TX 3", "fix it", 2.0)]) is Outcome.FAIL


def test_a_test_without_phases_is_skipped():
    assert judge_test([]) is Outcome.SKIP


def test_findings_are_sorted_by_severity(full_record):
    assert [finding.place for finding in full_record.findings()] == ["TX 5", "TX 3"]
