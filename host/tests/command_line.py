"""Runs the command line `taxel` inside the test process."""

import sys
from unittest import mock

import pytest

from taxel.cli import main as command


def exit_status(*words: object) -> int:
    """Run `taxel WORDS...` and return the exit status."""
    with mock.patch.object(sys, "argv", ["taxel", *map(str, words)]):
        try:
            command.main()
        except SystemExit as exit_request:
            return int(exit_request.code or 0)
    return 0


def refusal(capsys: pytest.CaptureFixture[str], *words: object) -> str:
    """Run `taxel WORDS...`, check that the command fails with one line on standard error, and return this line."""
    assert exit_status(*words) in (1, 2)
    lines = [line for line in capsys.readouterr().err.splitlines() if line]
    assert len(lines) == 1
    assert lines[0].startswith("taxel: ")
    return lines[0]
