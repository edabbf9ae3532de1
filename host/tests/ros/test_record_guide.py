"""docs/how-to-record.md: its commands run in order; and each command's --help has an example that runs."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest
from typer.testing import CliRunner

from host.tests.command_line import exit_status
from taxel.cli import main as cli
from taxel.recording.grasp_dataset import GraspDataset

GUIDE = Path(__file__).resolve().parents[3] / "docs" / "how-to-record.md"
BLOCK = re.compile(r"```(\w+)\n(.*?)```", re.DOTALL)
EXAMPLE = re.compile(r"Example: (taxel .*?)\s*(?:│|╭|\n\s*\n|$)")


def commands(kind):
    """Every line of the guide's blocks of a kind."""
    return [line for found, text in BLOCK.findall(GUIDE.read_text()) if found == kind for line in text.splitlines()]


def example(command):
    """The words of the example in a command's help."""
    text = CliRunner().invoke(cli.app, [command, "--help"], env={"COLUMNS": "200"}).output
    return shlex.split(EXAMPLE.search(text)[1])[1:]


def test_the_commands_of_the_guide_and_of_the_help_run(tmp_path, monkeypatch, capsys, recorded):
    """One after the other: each finds what those before it have written. The recording stands for longer ones."""
    pytest.importorskip("pyarrow")
    monkeypatch.chdir(tmp_path)
    (tmp_path / "joints.csv").write_text("\n".join(commands("csv")) + "\n")
    for line in commands("sh"):
        words = shlex.split(line)[1:]
        if "speed=max" in line:
            words[1] += "&duration_s=1"
        if words[0] == "import":  # nothing was pressed in a second
            folded = ["--overwrite", "--object", "cylinder", "--joints", ",".join(["0"] * 22)]
            assert exit_status("convert", recorded.path, "skin.csv", *folded) == 0
        status = exit_status(*words)
        assert status == 0, (line, capsys.readouterr().err)
    with GraspDataset("active.h5") as data:
        assert data["0001"].active()[0].sum() > 3
    for command in ("record", "replay", "convert"):
        words = example(command)
        assert words[0] == command
        assert exit_status(*words, *([] if command == "replay" else ["--overwrite"])) == 0, capsys.readouterr().err


def test_the_help_of_ros_has_the_example_that_the_test_of_nodes_runs():
    assert example("ros") == ["ros", "emulator:", "--seconds", "1"]


def test_the_guide_names_every_topic(recorded, tmp_path):
    text = GUIDE.read_text()
    for name in ("activations", "contact_cloud", "baseline", "hub_bytes", "NAME/scan"):
        assert f"/taxel/{name}`" in text
    assert any("--to pty" in line for line in commands("text"))
