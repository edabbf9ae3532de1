"""docs/how-to-flash-boards.md: every command of the page runs on the emulated hand."""

import importlib
import re
import shlex
import sys
from pathlib import Path

import pytest

from host.tests.command_line import run_taxel
from taxel.hand import load_hand
from taxel.hand.world import WorldSettings, format_world
from taxel_protocol.bootloader import LAYOUTS, BootDevice
from taxel_tools.files.cyacd import write_cyacd
from taxel_tools.files.intel_hex import write_intel_hex
from taxel_tools.signing import load_development_key, load_private_key, sign_file, sign_images

ROOT = Path(__file__).resolve().parents[3]
GUIDE = ROOT / "docs" / "how-to-flash-boards.md"
BLOCK = re.compile(r"```(\w+)\n(.*?)```", re.DOTALL)
TOML_NAME = re.compile(r"`([\w.-]+\.toml)`")


def read_commands():
    """Read the lines of all shell blocks of the guide."""
    return [line for kind, text in BLOCK.findall(GUIDE.read_text()) if kind == "sh" for line in text.splitlines()]


@pytest.fixture
def folder(tmp_path, monkeypatch, make_image):
    """The files that the guide uses, in the current folder, and a fake OpenOCD on the PATH."""
    monkeypatch.chdir(tmp_path)
    text = GUIDE.read_text()
    for block in BLOCK.finditer(text):
        if block[1] == "toml":
            (tmp_path / TOML_NAME.findall(text[: block.start()])[-1]).write_text(block[2])
    for name, device in (("board", BootDevice.BOARD), ("hub", BootDevice.HUB)):
        for slot in (0, 1):
            image = make_image(slot, version=(1, 2, 0), device=device, size=300)
            row = LAYOUTS[device].first_rows[slot]
            path = tmp_path / f"{name}-1.2.0-{'ab'[slot]}.cyacd"
            path.write_text(write_cyacd(image, row))
            sign_images([path], load_development_key())
    (tmp_path / "bootloader.hex").write_text(write_intel_hex(bytes(4096), 0))
    assert run_taxel("keygen", tmp_path / "release") == 0
    sign_file(tmp_path / "bootloader.hex", load_private_key(tmp_path / "release.key", None))
    (tmp_path / "openocd").write_text("#!/bin/sh\n")
    (tmp_path / "openocd").chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path))
    return tmp_path


def run_guide_command(arguments):
    """Run a command of the guide in this process, and return its exit status."""
    if arguments[0] == "taxel":
        return run_taxel(*arguments[1:])
    assert arguments[0] == "python"
    script = ROOT / arguments[1]
    sys.path.insert(0, str(script.parent))
    try:
        return importlib.import_module(script.stem).main(arguments[2:])
    finally:
        sys.path.remove(str(script.parent))


@pytest.mark.parametrize("line", read_commands())
def test_each_command_of_the_guide_runs(folder, capsys, line):
    if line.startswith("taxel keygen"):
        for path in folder.glob("release.*"):
            path.unlink()
    status = run_guide_command(shlex.split(line))
    captured = capsys.readouterr()
    assert status == 0, captured.err
    assert "Traceback" not in captured.err


def test_the_guide_shows_every_command_and_its_plan_names_a_board_of_the_hand():
    guide_commands = "\n".join(read_commands())
    for part in ("taxel scan", "taxel provision", "taxel flash", "--hub", "--swd", "--dry-run", "power_cuts.py"):
        assert part in guide_commands
    plan = next(text for kind, text in BLOCK.findall(GUIDE.read_text()) if "taxel_provisioning" in text)
    unique_id = re.search(r'unique_id = "(\w+)"', plan)[1]
    assert unique_id in format_world(load_hand("original"), WorldSettings())
