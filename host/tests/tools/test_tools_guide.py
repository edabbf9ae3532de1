"""docs/how-to-flash-boards.md: every command of it runs, on the emulated hand."""

from __future__ import annotations

import importlib
import re
import shlex
import sys
from pathlib import Path

import pytest

from host.tests.command_line import exit_status
from taxel.hand import load_hand
from taxel.hand.world import WorldSettings, world_text
from taxel_protocol.bootloader import LAYOUTS, BootDevice
from taxel_tools.files.cyacd import write_cyacd
from taxel_tools.files.intel_hex import write_intel_hex

ROOT = Path(__file__).resolve().parents[3]
GUIDE = ROOT / "docs" / "how-to-flash-boards.md"
BLOCK = re.compile(r"```(\w+)\n(.*?)```", re.DOTALL)
NAMED = re.compile(r"`([\w.-]+\.toml)`")


def commands():
    """Every line of the guide's shell blocks."""
    return [line for kind, text in BLOCK.findall(GUIDE.read_text()) if kind == "sh" for line in text.splitlines()]


@pytest.fixture
def folder(tmp_path, monkeypatch, make_image):
    """The files that the guide speaks of, in the present folder; an OpenOCD on the PATH."""
    monkeypatch.chdir(tmp_path)
    text = GUIDE.read_text()
    for found in BLOCK.finditer(text):
        if found[1] == "toml":
            (tmp_path / NAMED.findall(text[: found.start()])[-1]).write_text(found[2])
    for name, device in (("board", BootDevice.BOARD), ("hub", BootDevice.HUB)):
        for slot in (0, 1):
            image = make_image(slot, version=(1, 2, 0), device=device, size=300)
            row = LAYOUTS[device].first_rows[slot]
            (tmp_path / f"{name}-1.2.0-{'ab'[slot]}.cyacd").write_text(write_cyacd(image, row))
    (tmp_path / "bootloader.hex").write_text(write_intel_hex(bytes(4096), 0))
    (tmp_path / "openocd").write_text("#!/bin/sh\n")
    (tmp_path / "openocd").chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path))
    return tmp_path


def call(words):
    """Exit status of a command of the guide, in this process."""
    if words[0] == "taxel":
        return exit_status(*words[1:])
    assert words[0] == "python"
    script = ROOT / words[1]
    sys.path.insert(0, str(script.parent))
    try:
        return importlib.import_module(script.stem).main(words[2:])
    finally:
        sys.path.remove(str(script.parent))


@pytest.mark.parametrize("line", commands())
def test_a_command_of_the_guide_runs(folder, capsys, line):
    status = call(shlex.split(line))
    told = capsys.readouterr()
    assert status == 0, told.err
    assert "Traceback" not in told.err


def test_the_guide_shows_every_command_and_the_plans_board_is_in_the_hand():
    shown = "\n".join(commands())
    for part in ("taxel scan", "taxel provision", "taxel flash", "--hub", "--swd", "--dry-run", "power_cuts.py"):
        assert part in shown
    plan = next(text for kind, text in BLOCK.findall(GUIDE.read_text()) if "taxel_provisioning" in text)
    unique_id = re.search(r'unique_id = "(\w+)"', plan)[1]
    assert unique_id in world_text(load_hand("allegro"), WorldSettings())
