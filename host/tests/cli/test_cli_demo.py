"""Lines that `taxel demo` prints about the effects of the opened sealed world."""

import pytest

from taxel.cli.demo import MOST_LINES, _shorten


@pytest.mark.parametrize(
    ("number", "end"), [(1, "line 0"), (MOST_LINES, f"line {MOST_LINES - 1}"), (MOST_LINES + 2, "; and 2 more lines")]
)
def test_effect_lines_beyond_the_limit_are_replaced_by_their_number(number, end):
    text = _shorten([f"line {index}" for index in range(number)])  # the first line is "line 0"
    assert text.startswith("line 0")
    assert text.endswith(end)
