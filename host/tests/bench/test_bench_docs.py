"""The blocks of docs/how-to-bench-boards.md, run in their order on emulated boards."""

from __future__ import annotations

import io
import re
import shlex
import sys
from pathlib import Path

import pytest
from rich.console import Console

from host.tests.bench.fake_gantry import FakeGantry, pressing
from host.tests.bench.test_bench_operator import PRESS
from host.tests.command_line import exit_status
from taxel_tools import cli_bench
from taxel_tools.bench.phases import PHASES
from taxel_tools.bench.probe import gcode
from taxel_tools.bench.probe.emulated import EmulatedProbe

GUIDE = Path(__file__).parents[3] / "docs" / "how-to-bench-boards.md"
BLOCK = re.compile(r"```(\w*)\n(.*?)```", re.DOTALL)
STATUS = re.compile(r"# exit status (\d)")


class Hands(io.StringIO):
    """A terminal at which somebody does what the last line on the screen says."""

    def __init__(self, screen):
        super().__init__()
        self.screen = screen
        self.finger = None

    def isatty(self):
        return True

    def readline(self, *size):
        told = self.screen.getvalue()
        pressed, let_go = list(PRESS.finditer(told)), told.rfind("let go")
        if let_go > (pressed[-1].start() if pressed else -1):
            self.finger.release()
        else:
            _, taxel, diameter_mm, force_n = pressed[-1].groups()
            self.finger.press(int(taxel), float(force_n), float(diameter_mm) * 1e-3)
        return "\n"


@pytest.fixture
def guide(tmp_path, monkeypatch):
    """Runs a command of the guide; its probes press the emulated board."""
    monkeypatch.chdir(tmp_path)
    gantry = FakeGantry()
    monkeypatch.setattr(gcode.serial, "Serial", lambda port, baud, timeout: gantry)
    screen = io.StringIO()
    console = Console(file=screen, force_terminal=True, width=200)
    hands = Hands(screen)
    real = cli_bench.open_probe

    def open_probe(text, station, emulated, person):
        hands.finger = EmulatedProbe(emulated.world, station.kind, 0, 0.005)
        gantry.on_press = pressing(station.kind, hands.finger)
        return real(text, station, emulated, person)

    monkeypatch.setattr(cli_bench, "open_probe", open_probe)

    def run(line):
        if "--probe operator" in line:
            monkeypatch.setattr(cli_bench, "Console", lambda **options: console)
            monkeypatch.setattr(sys, "stdin", hands)
        return exit_status(*shlex.split(line, comments=True)[1:])

    return run


def test_the_guides_blocks_run_in_their_order(guide, tmp_path, capsys):
    seen = []
    for kind, text in BLOCK.findall(GUIDE.read_text()):
        if kind == "toml":
            (tmp_path / "my-plan.toml").write_text(text)
        for line in text.splitlines() if kind == "sh" else ():
            expected = STATUS.search(line)
            status = guide(line)
            told = capsys.readouterr()
            assert status == (int(expected[1]) if expected else 0), (line, told)
            seen.append(told.out)
        if kind == "":
            assert text.strip() in seen[-1]
        if kind == "python":
            exec(compile(text, str(GUIDE), "exec"), {})
            lines = capsys.readouterr().out.splitlines()
            assert [line.split()[:2] for line in lines[:2]] == [["FT-0001", "pass"], ["FT-0002", "fail"]]
            assert all(600 < int(line.split()[2]) < 800 for line in lines)
    assert len(seen) == 7


def test_every_phase_and_every_word_of_a_fault_is_in_the_guide():
    text = GUIDE.read_text()
    rows = re.findall(r"^\| `(\w+)` \|", text, re.MULTILINE)
    assert [name for name in rows if name in {phase.name for phase in PHASES}] == [phase.name for phase in PHASES]
    source = "".join(path.read_text() for path in (GUIDE.parents[1] / "tools/taxel_tools/bench").rglob("*.py"))
    named = set(re.findall(r'Fault\("([a-z ]+)"', source))
    assert len(named) > 15
    assert {name for name in named if name not in text} == set()
