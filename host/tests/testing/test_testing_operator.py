"""Who answers: somebody at a terminal, a script, nobody."""

from __future__ import annotations

import io
import pickle

import pytest
from rich.console import Console

from taxel_tools.testing.operator import NoOperator, OperatorNeededError, ScriptedOperator, TerminalOperator


@pytest.fixture
def terminal(monkeypatch):
    """An operator who types these lines, and what the terminal showed."""

    def make(*lines, **options):
        shown = io.StringIO()
        monkeypatch.setattr("sys.stdin", io.StringIO("".join(f"{line}\n" for line in lines)))
        return TerminalOperator(Console(file=shown, soft_wrap=True), **options), shown

    return make


def test_a_serial_number_is_asked_for_until_there_is_one(terminal):
    operator, _ = terminal("", "  ", " AB-0001 ")
    assert operator.ask_serial() == "AB-0001"


def test_a_serial_number_that_cannot_be_is_asked_for_again(terminal, plan_of):
    plan = plan_of('serial_pattern = "[A-Z]{2}-[0-9]{4}"\n[phases.a]\n')
    operator, shown = terminal("0001", "AB-0001", check_serial=plan.check_serial)
    assert operator.ask_serial() == "AB-0001"
    assert "expected one that matches [A-Z]{2}-[0-9]{4}, found '0001'" in shown.getvalue()


def test_a_prompt_shows_its_text_as_it_is_and_waits(terminal, capsys):
    operator, shown = terminal("")
    operator.prompt("press [bold]TX 3[/bold] with 1 N")
    assert "press [bold]TX 3[/bold] with 1 N" in shown.getvalue()


def test_a_confirmation_takes_only_yes_or_no(terminal):
    operator, shown = terminal("perhaps", "Y", "no")
    assert operator.confirm("does [red]LED 1[/red] blink?") is True
    assert shown.getvalue() == "does [red]LED 1[/red] blink? (y/n) " * 2
    assert operator.confirm("does the LED blink?") is False


def test_a_terminal_that_ends_says_that_somebody_is_needed(terminal):
    operator, _ = terminal()
    with pytest.raises(OperatorNeededError, match="nobody is there to answer 'serial number:'"):
        operator.ask_serial()


def test_a_script_answers_in_its_order(terminal):
    pressed = []
    operator = ScriptedOperator(["AB-0001", True, "no"], on_prompt=pressed.append)
    assert operator.ask_serial() == "AB-0001"
    operator.prompt("press TX 3")
    assert [operator.confirm("one?"), operator.confirm("two?")] == [True, False]
    assert pressed == ["press TX 3"]
    assert operator.heard == ["serial number", "press TX 3", "one?", "two?"]
    with pytest.raises(OperatorNeededError, match="three"):
        operator.confirm("three?")


def test_nobody_answers_nothing():
    for ask in (lambda: NoOperator().ask_serial(), lambda: NoOperator().prompt("x"), lambda: NoOperator().confirm("x")):
        with pytest.raises(OperatorNeededError) as caught:
            ask()
        assert str(pickle.loads(pickle.dumps(caught.value))) == str(caught.value)


def test_a_phase_that_needs_somebody_ends_with_one_line(plan_of, phase, run):
    touch = phase("touch", lambda context, options, log: NoOperator().prompt("press TX 3"), automatic=False)
    record = run(plan_of("[phases.touch]\n"), [touch])
    assert record.phases[0].problem.startswith("nobody is there to answer 'press TX 3'; run the test at a terminal")
