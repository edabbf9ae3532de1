"""Error messages are one printable line of limited length, whatever text of a file they contain."""

from hypothesis import given
from hypothesis import strategies as st

from taxel.errors import LONGEST_MESSAGE, FieldError, TaxelError, fit_line
from taxel.gap.errors import GapInputError
from taxel.hand.errors import UnknownBoardError

TEXT = st.text(st.characters(), max_size=60) | st.sampled_from(["\x1b[2J", "a\r\nb", "x" * 100_000, "\ud800", "\u2028"])


@given(TEXT, TEXT)
def test_message_is_one_printable_line(name: str, value: str) -> None:
    errors = (
        TaxelError(f"{name}: expected a name, found {value}; correct the name"),
        FieldError(name, value, "a number", value, "correct the field"),
        GapInputError(name, "a dataset", value, "record it again"),
        UnknownBoardError(name, value, [value]),
    )
    for message in map(str, errors):
        assert message.isprintable()
        assert len(message) <= LONGEST_MESSAGE + len("...")


def test_spaces_of_a_path_are_kept() -> None:
    assert str(TaxelError("/data/two  spaces.csv: expected a file")) == "/data/two  spaces.csv: expected a file"


def test_line_ends_and_tabs_become_spaces() -> None:
    assert fit_line("first\n   second\tthird\r\n") == "first second third"
