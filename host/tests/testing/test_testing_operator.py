"""Operators: at a terminal, scripted, and none."""

import io
import pickle

import pytest
from rich.console import Console

from taxel_tools.testing.operator import NoOperator, OperatorNeededError, TerminalOperator


@pytest.fixture
def terminal(monkeypatch):
    """Factory of an operator who types the given lines, and of the terminal's output."""

    def make(*lines, **options):
        """Create an operator who types the given lines, and return it with the output of the terminal."""
        output = io.StringIO()
        monkeypatch.setattr("sys.stdin", io.StringIO("".join(f"{line}\n" for line in lines)))
        return TerminalOperator(Console(file=output, soft_wrap=True), **options), output

    return make


def test_the_question_for_the_serial_number_is_repeated_after_an_empty_answer(terminal):
    operator, _ = terminal("", "  ", " AB-0001 ")
    assert operator.read_serial_number() == "AB-0001"


def test_the_question_for_the_serial_number_is_repeated_after_an_invalid_answer(terminal, make_plan):
    plan = make_plan('serial_pattern = "[A-Z]{2}-[0-9]{4}"\n[phases.a]\n')
    operator, output = terminal("0001", "AB-0001", check_serial_number=plan.check_serial_number)
    assert operator.read_serial_number() == "AB-0001"
    assert "expected a number that matches [A-Z]{2}-[0-9]{4}, found '0001'" in output.getvalue()


def test_a_prompt_shows_its_text_unchanged_and_waits(terminal):
    operator, output = terminal("")
    operator.prompt("press [bold]TX 3[/bold] with 1 N")
    assert "press [bold]TX 3[/bold] with 1 N" in output.getvalue()


def test_the_end_of_the_terminal_input_is_an_error(terminal):
    operator, _ = terminal()
    with pytest.raises(OperatorNeededError, match="no operator to answer 'serial number:'"):
        operator.read_serial_number()


def test_every_method_without_an_operator_is_an_error():
    for call in (lambda: NoOperator().read_serial_number(), lambda: NoOperator().prompt("x")):
        with pytest.raises(OperatorNeededError) as caught_error:
            call()
        assert str(pickle.loads(pickle.dumps(caught_error.value))) == str(caught_error.value)


def test_a_phase_that_needs_an_operator_ends_with_one_error_line(make_plan, phase, run):
    touch = phase("touch", lambda context, options, log: NoOperator().prompt("press TX 3"), is_automatic=False)
    record = run(make_plan("[phases.touch]\n"), [touch])
    assert record.phases[0].problem.startswith("no operator to answer 'press TX 3'; run the test at a terminal")
