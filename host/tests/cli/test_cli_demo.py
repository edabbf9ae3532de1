"""Text of the opened seal."""

import pytest

from taxel.cli.demo import MOST_LINES, _shorten


@pytest.mark.parametrize(
    ("number", "end"), [(1, "line 0"), (MOST_LINES, f"line {MOST_LINES - 1}"), (MOST_LINES + 2, "; and 2 more lines")]
)
def test_many_effect_lines_are_shortened(number, end):
    text = _shorten([f"line {index}" for index in range(number)])
    assert text.startswith("line 0")
    assert text.endswith(end)
