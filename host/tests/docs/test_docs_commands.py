"""The help of every command of `taxel`, including commands of plug-ins, has an example, and the example runs.

By default only quick examples run, and the options of the other examples are checked. `make docs-test`
(TAXEL_DOCS=all) also runs the other examples, with campaigns of a few grasps.
"""

import inspect
import os
import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
import typer

from host.tests.command_line import run_taxel
from host.tests.docs.page_blocks import ROOT
from taxel.cli.main import build_app

RUNS_ALL = os.environ.get("TAXEL_DOCS") == "all"
EXAMPLE = re.compile(r"\bExamples?: (.*?)(?:\n\n|\Z)", re.DOTALL)
QUICK_COMMANDS = ("taxel provision", "taxel scan")
TESTED_ELSEWHERE = ("taxel bench", "taxel flash", "taxel import", "taxel cloud convert")
"""Commands whose examples need files of the reader: the tests of the guides run them with files of their own."""

NEEDING_ROS = ("taxel ros",)

SHORTENED_EXAMPLES = (
    ("taxel grasp --source both ", "taxel grasp --source both --object cylinder --grasps 12 --overwrite "),
    ("--grasps 10 ", "--grasps 4 --overwrite "),
    ("--grasps 100000 ", "--grasps 6 "),
    ("--worlds 24", "--worlds 1"),
    (
        "taxel thesis",
        "taxel grasp --source both --grasps 12 --out out/all && "
        "taxel thesis --real out/all/real.h5 --sim out/all/sim.h5 --no-gap",
    ),
    ("taxel gap diagnose out/campaign/", "taxel gap diagnose out/demo/"),  # 12 grasps are too few for a diagnosis
    ("gap/report.json out/campaign/", "gap/report.json out/demo/"),
    ("out/more/sim.h5", "out/demo/sim.h5"),
)
"""Replacements in the examples: fewer grasps and worlds, and files that an earlier example has written."""

FIRST_COMMANDS = ("taxel demo", "taxel grasp", "taxel cloud make", "taxel gap diagnose", "taxel record")
"""Commands whose output files the examples of other commands read; these commands run first."""


def list_commands(command, path=("taxel",)) -> Iterator[tuple[str, object]]:
    """Yield (full name, command) of every command without subcommands."""
    subcommands = getattr(command, "commands", None)
    if subcommands is None:
        yield " ".join(path), command
        return
    for name, subcommand in subcommands.items():
        yield from list_commands(subcommand, (*path, name))


COMMANDS = dict(list_commands(typer.main.get_command(build_app(loads_all=True))))


def read_examples(name: str) -> list[str]:
    """Return the example command lines in the help of a command; empty without an example."""
    match = EXAMPLE.search(inspect.cleandoc(COMMANDS[name].help or ""))
    return [" ".join(part.split()) for part in match[1].split("; ")] if match else []


@pytest.mark.parametrize("name", COMMANDS)
def test_the_help_of_each_command_has_an_example_with_valid_options(name):
    lines = read_examples(name)
    assert lines, f"{name} --help has no example"
    for line in lines:
        assert line.startswith(f"{name} "), line
        words = shlex.split(line)[len(name.split()) :]
        COMMANDS[name].make_context(name, words)


def is_run_here(name: str) -> bool:
    """True if the examples of the command run in this file with the present value of TAXEL_DOCS."""
    return not name.startswith((*TESTED_ELSEWHERE, *NEEDING_ROS)) and (RUNS_ALL or name in QUICK_COMMANDS)


def sort_commands() -> list[str]:
    """List the names of all commands, with those of FIRST_COMMANDS first."""
    return sorted(
        COMMANDS, key=lambda name: FIRST_COMMANDS.index(name) if name in FIRST_COMMANDS else len(FIRST_COMMANDS)
    )


def test_the_examples_of_the_help_run(tmp_path, monkeypatch, capfd):
    """All examples run one after another in one folder, because examples read files that earlier ones have written."""
    monkeypatch.chdir(tmp_path)
    environment = {**os.environ, "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}"}
    for name in filter(is_run_here, sort_commands()):
        for line in read_examples(name):
            for example_part, shortened_part in SHORTENED_EXAMPLES:
                line = line.replace(example_part, shortened_part)
            if RUNS_ALL:
                result = subprocess.run(
                    ["bash", "-c", line], env=environment, capture_output=True, text=True, timeout=3600
                )
                assert result.returncode == 0, f"{line}\n{result.stdout[-1500:]}\n{result.stderr[-1500:]}"
            else:
                assert run_taxel(*shlex.split(line)[1:]) == 0, (line, capfd.readouterr().err)
        if name == "taxel cloud make":  # the examples of other commands read real.ply and sim.ply
            for copy in ("real", "sim"):
                shutil.copyfile("out/cylinder.ply", f"out/{copy}.ply")


def test_each_command_whose_examples_do_not_run_here_is_named_in_a_test_of_another_folder():
    """Such a test contains the last word of the command in quotation marks, as an argument of the program."""
    tests = {
        path: path.read_text()
        for path in (ROOT / "host/tests").rglob("test_*.py")
        if path.parent != Path(__file__).parent
    }
    for name in COMMANDS:
        if name.startswith(TESTED_ELSEWHERE):
            word = name.split()[-1]
            assert any(f'"{word}"' in text for text in tests.values()), name
