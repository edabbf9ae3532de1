"""Every command of `taxel`, those of entry points too: its --help has an example, and the example runs.

What takes a second runs here; `make docs-test` (TAXEL_DOCS=all) runs the others too, on campaigns of a few grasps. Here
their words are checked against the command's own options.
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

from host.tests.command_line import exit_status
from host.tests.docs.page_blocks import ROOT
from taxel.cli.main import build_app

ALL = os.environ.get("TAXEL_DOCS") == "all"
EXAMPLE = re.compile(r"\bExamples?: (.*?)(?:\n\n|\Z)", re.DOTALL)
QUICK = ("taxel provision", "taxel scan")
ELSEWHERE = ("taxel bench", "taxel flash", "taxel import", "taxel cloud convert")
"""Commands whose examples take up the reader's own files: other tests run them on such."""

NEEDS_ROS = ("taxel ros",)

STAND_INS = (
    ("taxel grasp --source both ", "taxel grasp --source both --object cylinder --grasps 12 --overwrite "),
    ("--grasps 10 ", "--grasps 4 --overwrite "),
    ("--grasps 100000 ", "--grasps 6 "),
    ("--worlds 24", "--worlds 1"),
    (
        "taxel thesis",
        "taxel grasp --source both --grasps 12 --out out/all && "
        "taxel thesis --real out/all/real.h5 --sim out/all/sim.h5 --no-gap",
    ),
    ("taxel gap diagnose out/campaign/", "taxel gap diagnose out/demo/"),  # 12 grasps tell nothing
    ("gap/report.json out/campaign/", "gap/report.json out/demo/"),
    ("out/more/sim.h5", "out/demo/sim.h5"),
)
"""What the examples run with instead: a few grasps, worlds and files that are there."""

ORDER = ("taxel demo", "taxel grasp", "taxel cloud make", "taxel gap diagnose", "taxel record")
"""These first: the others take up what they leave."""


def walk(command, path=("taxel",)) -> Iterator[tuple[str, object]]:
    """Every command that does something, by its full name."""
    inner = getattr(command, "commands", None)
    if inner is None:
        yield " ".join(path), command
        return
    for name, one in inner.items():
        yield from walk(one, (*path, name))


COMMANDS = dict(walk(typer.main.get_command(build_app(loads_all=True))))


def examples(name: str) -> list[str]:
    """What the help of a command says to type."""
    found = EXAMPLE.search(inspect.cleandoc(COMMANDS[name].help or ""))
    return [" ".join(part.split()) for part in found[1].split("; ")] if found else []


@pytest.mark.parametrize("name", COMMANDS)
def test_help_has_an_example_of_the_command_with_options_that_it_has(name):
    lines = examples(name)
    assert lines, f"{name} --help has no example"
    for line in lines:
        assert line.startswith(f"{name} "), line
        words = shlex.split(line)[len(name.split()) :]
        COMMANDS[name].make_context(name, words)


def runs_here(name: str) -> bool:
    """Whether the example runs in this file, now."""
    return not name.startswith((*ELSEWHERE, *NEEDS_ROS)) and (ALL or name in QUICK)


def in_order() -> list[str]:
    """Those that leave files first."""
    return sorted(COMMANDS, key=lambda name: ORDER.index(name) if name in ORDER else len(ORDER))


def test_the_examples_run(tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    environment = {**os.environ, "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}"}
    for name in filter(runs_here, in_order()):
        for line in examples(name):
            for old, new in STAND_INS:
                line = line.replace(old, new)
            if ALL:
                done = subprocess.run(
                    ["bash", "-c", line], env=environment, capture_output=True, text=True, timeout=3600
                )
                assert done.returncode == 0, f"{line}\n{done.stdout[-1500:]}\n{done.stderr[-1500:]}"
            else:
                assert exit_status(*shlex.split(line)[1:]) == 0, (line, capfd.readouterr().err)
        if name == "taxel cloud make":
            for copy in ("real", "sim"):
                shutil.copyfile("out/cylinder.ply", f"out/{copy}.ply")


def test_the_others_run_in_their_guides_tests():
    tests = {
        path: path.read_text()
        for path in (ROOT / "host/tests").rglob("test_*.py")
        if path.parent != Path(__file__).parent
    }
    for name in COMMANDS:
        if name.startswith(ELSEWHERE):
            word = name.split()[-1]
            assert any("BLOCK" in text or f'"{word}"' in text for text in tests.values()), name
