"""Runs the command line `taxel` inside the test process."""

import sys
from unittest import mock

import pytest

from taxel.cli import main as command


def run_taxel(*arguments: object) -> int:
    """Run `taxel ARGUMENTS...` in this process and return its exit status."""
    with mock.patch.object(sys, "argv", ["taxel", *map(str, arguments)]):
        try:
            command.main()
        except SystemExit as exit_request:
            return int(exit_request.code or 0)
    return 0


def run_refused_command(capsys: pytest.CaptureFixture[str], *arguments: object) -> str:
    """Run `taxel ARGUMENTS...`, check that the command fails with one line on standard error, and return this line."""
    assert run_taxel(*arguments) in (1, 2)
    lines = [line for line in capsys.readouterr().err.splitlines() if line]
    assert len(lines) == 1
    assert lines[0].startswith("taxel: ")
    return lines[0]
