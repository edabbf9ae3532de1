"""The blocks of docs/how-to-bench-boards.md, run in order on emulated boards."""

import io
import re
import shlex
import sys
from pathlib import Path

import pytest
from rich.console import Console

from host.tests.bench.fake_gantry import FakeGantry, press_with
from host.tests.bench.test_bench_operator import INDENTATION
from host.tests.command_line import run_taxel
from taxel_tools import cli_bench
from taxel_tools.bench.probe import gcode
from taxel_tools.bench.probe.emulated import EmulatedProbe
from taxel_tools.bench.registry import PHASES

GUIDE = Path(__file__).parents[3] / "docs" / "how-to-bench-boards.md"
BLOCK = re.compile(r"```(\w*)\n(.*?)```", re.DOTALL)
STATUS = re.compile(r"# exit status (\d)")


class FollowingOperatorInput(io.StringIO):
    """Terminal input of an operator who follows the last instruction on the screen."""

    def __init__(self, screen):
        super().__init__()
        self.screen = screen
        self.probe = None

    def isatty(self):
        return True

    def readline(self, *size):
        """Carry out the last instruction on the screen, and confirm it with Enter."""
        text = self.screen.getvalue()
        press_instructions, release_position = list(INDENTATION.finditer(text)), text.rfind("release the probe")
        if release_position > (press_instructions[-1].start() if press_instructions else -1):
            self.probe.release()
        else:
            _, taxel, diameter_mm, force_n = press_instructions[-1].groups()
            self.probe.press(int(taxel), float(force_n), float(diameter_mm) * 1e-3)
        return "\n"


@pytest.fixture
def guide(tmp_path, monkeypatch):
    """Runs a command of the guide; its probes act on the emulated board."""
    monkeypatch.chdir(tmp_path)
    gantry = FakeGantry()
    monkeypatch.setattr(gcode.serial, "Serial", lambda port, baud, timeout: gantry)
    screen = io.StringIO()
    console = Console(file=screen, force_terminal=True, width=200)
    operator_input = FollowingOperatorInput(screen)
    original_open_probe = cli_bench.open_probe

    def open_probe(url, board, emulated, operator):
        """Open the requested probe, and let gantry and operator act on the emulated board."""
        operator_input.probe = EmulatedProbe(emulated.world, board.kind, 0, 0.005)
        gantry.on_press = press_with(board.kind, operator_input.probe)
        return original_open_probe(url, board, emulated, operator)

    monkeypatch.setattr(cli_bench, "open_probe", open_probe)

    def run(line):
        """Run one command line of the guide, and return its exit status."""
        if "--probe operator" in line:
            monkeypatch.setattr(cli_bench, "Console", lambda **options: console)
            monkeypatch.setattr(sys, "stdin", operator_input)
        return run_taxel(*shlex.split(line, comments=True)[1:])

    return run


@pytest.mark.slow
def test_the_blocks_of_the_guide_run_in_order(guide, tmp_path, capsys):
    """The exit status of a shell line is stated in its comment, otherwise it is 0.

    A TOML block is written to my-plan.toml. A block without a language is a part of the output of the last command.
    """
    outputs = []
    for kind, text in BLOCK.findall(GUIDE.read_text()):
        if kind == "toml":
            (tmp_path / "my-plan.toml").write_text(text)
        for line in text.splitlines() if kind == "sh" else ():
            expected = STATUS.search(line)
            status = guide(line)
            captured = capsys.readouterr()
            assert status == (int(expected[1]) if expected else 0), (line, captured)
            outputs.append(captured.out)
        if kind == "":
            assert text.strip() in outputs[-1]
        if kind == "python":
            exec(compile(text, str(GUIDE), "exec"), {})
            lines = capsys.readouterr().out.splitlines()
            assert [line.split()[:2] for line in lines[:2]] == [["FT-0001", "pass"], ["FT-0002", "fail"]]
            assert all(600 < int(line.split()[2]) < 800 for line in lines)  # median response to 1 N, counts
    assert len(outputs) == 7


def test_the_guide_lists_every_phase_and_every_fault():
    text = GUIDE.read_text()
    rows = re.findall(r"^\| `(\w+)` \|", text, re.MULTILINE)
    assert [name for name in rows if name in PHASES] == list(PHASES)
    source = "".join(path.read_text() for path in (GUIDE.parents[1] / "tools/taxel_tools/bench").rglob("*.py"))
    fault_names = set(re.findall(r'Fault\("([a-z ]+)"', source))
    assert len(fault_names) > 15
    assert {name for name in fault_names if name not in text} == set()
