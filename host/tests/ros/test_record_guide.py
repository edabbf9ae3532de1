"""docs/how-to-record.md: its commands run in order; and each command's --help has an example that runs."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from host.tests.command_line import exit_status
from taxel.cli import main as cli
from taxel.hand import load_hand
from taxel.hand.kinematics import kinematics_of
from taxel.recording.grasp_dataset import GraspDataset

GUIDE = Path(__file__).resolve().parents[3] / "docs" / "how-to-record.md"
BLOCK = re.compile(r"(<!-- run: no.*?-->\n)?```(\w+)\n(.*?)```", re.DOTALL)
EXAMPLE = re.compile(r"Example: (taxel .*?)\s*(?:│|╭|\n\s*\n|$)")


def commands(kind):
    """Every line of the guide's blocks of a kind."""
    return [
        line
        for left_out, found, text in BLOCK.findall(GUIDE.read_text())
        if found == kind and not left_out
        for line in text.splitlines()
    ]


def example(command):
    """The words of the example in a command's help."""
    text = CliRunner().invoke(cli.app_of(command), [command, "--help"], env={"COLUMNS": "200"}).output
    return shlex.split(EXAMPLE.search(text)[1])[1:]


def touch(path):
    """Add four taxels of the palm that were active."""
    hand = load_hand("allegro")
    places = kinematics_of(hand).taxel_positions(np.zeros(22))[hand.slice_of(0x20)][:4]
    with path.open("a") as file:
        file.writelines(f"1,cylinder,side_1,6.0,{x},{y},{z},1\n" for x, y, z in places.tolist())


def test_the_commands_of_the_guide_and_of_the_help_run(tmp_path, monkeypatch, capsys):
    """One after the other: each finds what those before it have written. Recordings end after a second."""
    pytest.importorskip("pyarrow")
    monkeypatch.chdir(tmp_path)
    (tmp_path / "joints.csv").write_text("\n".join(commands("csv")) + "\n")
    for line in commands("sh"):
        words = shlex.split(line)[1:]
        if "speed=max" in line:
            words[1] += "&duration_s=1"
        if words[0] == "import":  # nothing was pressed in a second
            touch(Path("skin.csv/active.csv"))
        status = exit_status(*words)
        assert status == 0, (line, capsys.readouterr().err)
    with GraspDataset("active.h5") as data:
        assert data["0001"].active()[0].sum() == 4
    for command in ("record", "replay", "convert"):
        words = example(command)
        assert words[0] == command
        assert exit_status(*words, *([] if command == "replay" else ["--overwrite"])) == 0, capsys.readouterr().err


def test_the_help_of_ros_has_the_example_that_the_test_of_nodes_runs():
    assert example("ros") == ["ros", "emulator:", "--seconds", "1"]


def test_the_guide_names_every_topic():
    text = GUIDE.read_text()
    for name in ("activations", "contact_cloud", "baseline", "hub_bytes", "NAME/scan"):
        assert f"/taxel/{name}`" in text
    assert any("--to pty" in line for line in GUIDE.read_text().splitlines())
