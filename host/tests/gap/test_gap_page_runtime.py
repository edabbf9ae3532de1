"""Run time of a diagnosis as text on the report page."""

import pytest

from taxel.gap.page.inputs_section import format_runtime


@pytest.mark.parametrize(("seconds", "text"), [
    (None, "run time not stated"),
    (60.0, "run time 1 minute 0 s"),
    (119.4, "run time 1 minute 59 s"),
    (119.7, "run time 2 minutes 0 s"),
])  # fmt: skip
def test_run_time_is_rounded_before_it_is_divided_into_minutes_and_seconds(seconds: float | None, text: str) -> None:
    assert format_runtime(seconds).replace("\u202f", " ").replace("\xa0", " ") == text
