"""docs/how-to-record.md: its commands run in order, and the help of each command has an example that runs."""

import re
import shlex
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from host.tests.command_line import run_taxel
from taxel.cli import main as cli
from taxel.hand import load_hand
from taxel.hand.kinematics import build_kinematics
from taxel.recording.grasp_dataset import GraspDataset

GUIDE = Path(__file__).resolve().parents[3] / "docs" / "how-to-record.md"
BLOCK = re.compile(r"(<!-- run: no.*?-->\n)?```(\w+)\n(.*?)```", re.DOTALL)
EXAMPLE = re.compile(r"Example: (taxel .*?)\s*(?:│|╭|\n\s*\n|$)")


def read_block_lines(language):
    """Return the lines of all code blocks of the guide in a language, except blocks that are marked not to run."""
    return [
        line
        for is_excluded, block_language, text in BLOCK.findall(GUIDE.read_text())
        if block_language == language and not is_excluded
        for line in text.splitlines()
    ]


def read_example(command):
    """Return the arguments of the example in the help of a command, without `taxel`."""
    text = CliRunner().invoke(cli.build_app(command), [command, "--help"], env={"COLUMNS": "200"}).output
    return shlex.split(EXAMPLE.search(text)[1])[1:]


def add_active_taxels(path):
    """Append four active taxels of the palm to a file of active taxels."""
    hand = load_hand("original")
    centres = build_kinematics(hand).compute_taxel_positions(np.zeros(22))[hand.get_slice(0x15)][:4]
    with path.open("a") as file:
        file.writelines(f"1,cylinder,side_1,6.0,{x},{y},{z},1\n" for x, y, z in centres.tolist())


def test_commands_of_the_guide_and_of_the_help_run(tmp_path, monkeypatch, capsys):
    """The commands run in the order of the guide and use each other's files. Recordings end after one second."""
    pytest.importorskip("pyarrow")
    monkeypatch.chdir(tmp_path)
    (tmp_path / "joints.csv").write_text("\n".join(read_block_lines("csv")) + "\n")
    for line in read_block_lines("sh"):
        arguments = shlex.split(line)[1:]
        if "speed=max" in line:
            arguments[1] += "&duration_s=1"
        if arguments[0] == "import":  # a recording of one second has no contact
            add_active_taxels(Path("skin.csv/active.csv"))
        status = run_taxel(*arguments)
        assert status == 0, (line, capsys.readouterr().err)
    with GraspDataset("active.h5") as data:
        assert data["0001"].active_taxels()[0].sum() == 4  # those of `add_active_taxels`
    for command in ("record", "replay", "convert"):
        arguments = read_example(command)
        assert arguments[0] == command
        assert run_taxel(*arguments, *([] if command == "replay" else ["--overwrite"])) == 0, capsys.readouterr().err


def test_help_of_ros_has_the_example_that_test_ros_nodes_runs():
    assert read_example("ros") == ["ros", "emulator:", "--seconds", "1"]


def test_guide_names_the_topics_of_the_skin():
    text = GUIDE.read_text()
    for name in ("activations", "contact_cloud", "baseline", "hub_bytes", "NAME/scan"):
        assert f"/taxel/{name}`" in text


def test_guide_describes_the_playback_on_a_pseudo_terminal():
    assert "--to pty" in GUIDE.read_text()
