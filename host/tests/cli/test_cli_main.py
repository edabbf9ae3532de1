"""The program loads what a command needs, and knows all of them."""

from __future__ import annotations

import signal
import subprocess
import sys

import typer

from host.tests.command_line import exit_status
from taxel.cli.main import build_app


def names(app: typer.Typer) -> set[str]:
    return set(typer.main.get_command(app).commands)  # type: ignore[attr-defined]


def test_one_command_alone_is_still_a_command():
    assert names(build_app("gap")) == {"gap"}
    assert names(build_app("record")) == {"record"}
    assert names(build_app("bench")) == {"bench"}


def test_without_a_known_name_all_are_there():
    every = names(build_app(loads_all=True))
    assert {"gap", "cloud", "import", "record", "thesis", "bench", "flash"} <= every
    assert names(build_app("no_such_command")) == every
    assert names(build_app("--help")) == every


def test_a_diagnosis_does_not_load_what_others_draw_with():
    program = "import sys; from taxel.cli.main import build_app; build_app('gap'); print(*sys.modules)"
    found = subprocess.run([sys.executable, "-c", program], check=True, capture_output=True, text=True).stdout.split()
    assert "taxel.gap.diagnosis" in found
    assert not {"matplotlib", "taxel.cli.thesis", "taxel.blind.run", "taxel_tools.bench"} & set(found)


def test_a_command_leaves_signals_to_the_program_that_ran_it(capsys):
    """Children of a pool that the tests forked later took SIGTERM for Ctrl-C, and hung now and then."""
    before = signal.getsignal(signal.SIGTERM)
    assert exit_status("cloud", "convert", "none.ply", "out.ply") == 1
    assert signal.getsignal(signal.SIGTERM) is before
