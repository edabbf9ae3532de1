"""`taxel import`: the guide's own examples, and what a user sees of a mistake."""

import json
import re
import shlex
from pathlib import Path

import pytest
from typer.testing import CliRunner

from host.tests.command_line import exit_status
from taxel.cli import main as cli
from taxel.recording.grasp_dataset import GraspDataset

GUIDE = Path(__file__).parents[3] / "docs" / "how-to-import.md"
BLOCK = re.compile(r"```(\w+)\n(.*?)```", re.DOTALL)
FILE = re.compile(r"`(\w+\.(?:csv|toml))`")
KINDS = ("arrays", "gazebo", "active", "rollout")


def call(capsys, *words):
    """Exit status and what was printed."""
    status = exit_status(*words)
    printed = capsys.readouterr()
    return status, printed.out, printed.err


def blocks():
    """Kind and text of every block, and for a data file the name that the text before it says last."""
    text = GUIDE.read_text()
    for found in BLOCK.finditer(text):
        kind = found[1]
        before = re.sub(r"```.*?```", "", text[: found.start()], flags=re.DOTALL)
        names = [name for name in FILE.findall(before) if name.endswith(kind)]
        yield kind, found[2], names[-1] if names else ""


@pytest.fixture
def guide(tmp_path, monkeypatch):
    """The guide's data files in the present folder."""
    monkeypatch.chdir(tmp_path)
    for kind, text, name in blocks():
        if kind in ("csv", "toml"):
            (tmp_path / name).write_text(text)
    return tmp_path


def example(command):
    """The words of the guide's example of a command."""
    lines = [line for kind, text, _ in blocks() if kind == "sh" for line in text.splitlines()]
    return shlex.split(next(line for line in lines if f"import {command} " in line))[1:]


def test_the_guides_examples_run_in_order(guide, capsys):
    made = []
    for kind, text, _ in blocks():
        if kind == "python":
            exec(compile(text, str(GUIDE), "exec"), {})
        if kind == "sh":
            words = shlex.split(text)
            status, out, err = call(capsys, *words[1:])
            assert status == 0, err
            assert words[-1] in out
            made.append(words[-1])
    assert made == ["gazebo.h5", "active.h5", "rollout.h5", "arrays.h5"]
    for name in made:
        with GraspDataset(guide / name) as data:
            data.check()
            assert data["0001"].n_frames in (101, 103)
    with GraspDataset(guide / "gazebo.h5") as data:
        assert data["0001"].contact_force.sum(axis=1)[-3:].round(9).tolist() == [0.0, 2.0, 1.3]
    with GraspDataset(guide / "active.h5") as data:
        assert data["0001"].active_taxels()[0].sum() == 1
    with GraspDataset(guide / "arrays.h5") as data:
        assert data["0001"].active_taxels()[0].sum() == 1


@pytest.mark.parametrize("command", KINDS)
def test_help_has_an_example(command):
    text = CliRunner().invoke(cli.build_app("import"), ["import", command, "--help"], env={"COLUMNS": "200"}).output
    assert f"Example: taxel import {command} " in text


def test_a_file_that_exists_is_kept_without_overwrite(guide, capsys):
    (guide / "gazebo.h5").write_bytes(b"mine")
    status, _, err = call(capsys, *example("gazebo"))
    assert (status, err.count("\n")) == (1, 1)
    assert "gazebo.h5" in err
    assert (guide / "gazebo.h5").read_bytes() == b"mine"
    assert call(capsys, *example("gazebo"), "--overwrite")[0] == 0
    with GraspDataset(guide / "gazebo.h5") as data:
        data.check()


def test_json_says_what_was_imported(guide, capsys):
    status, out, err = call(capsys, *example("gazebo"), "--json")
    assert (status, err) == (0, "")
    assert json.loads(out) == {
        "file": "gazebo.h5",
        "grasps": 1,
        "frames": 103,
        "added_frames": 100,
        "contacts": 3,
        "far_contacts": 0,
        "far_force_n": 0.0,
    }


def test_a_narrow_threshold_leaves_contacts_unfelt_and_says_so(guide, capsys):
    status, out, _ = call(capsys, *example("gazebo"), "--distance-mm", "0.5")
    assert status == 0
    assert "3 of 3 contacts (3.3 N in all) reach no taxel" in out


WRONG = {
    "no hand": (["--joint-file", ""], "--joint-file and --pose-file: expected one of them, found neither"),
    "threshold": (["--distance-mm", "-1"], "--distance-mm: expected a number above 0, found -1"),
    "wrist": (["--wrist-pose", "0,0,0"], "--wrist-pose: expected x,y,z,qw,qx,qy,qz"),
    "turn": (["--wrist-pose", "0,0,0,0,0,0,0"], "--wrist-pose: expected x,y,z,qw,qx,qy,qz"),
    "noise": (["--noise-counts", "-3"], "noise_counts"),
    "hand": (["--hand", "shadow"], "shadow"),
    "calibration": (["--calibration", "none.toml"], "none.toml: file: expected a file"),
    "folder": (["--out", "nowhere/x.h5"], "nowhere"),
}


@pytest.mark.parametrize("case", WRONG)
def test_a_wrong_option_is_one_line(guide, capsys, case):
    more, said = WRONG[case]
    words = example("gazebo")
    if case == "no hand":
        at = words.index("--joint-file")
        words, more = words[:at] + words[at + 2 :], []
    status, _, err = call(capsys, *words, *more)
    assert (status, err.count("\n")) == (1, 1), err
    assert said in err


def test_mistakes_in_files_are_one_line_at_the_command_line_too(guide, capsys):
    text = (guide / "contacts.csv").read_text()
    (guide / "contacts.csv").write_text(text.replace("0.5141,-0.018", "0.5141,minus"))
    status, out, err = call(capsys, *example("gazebo"))
    assert (status, out) == (1, "")
    expected = "taxel: contacts.csv: line 4, column y: expected a finite number, found 'minus'; write it as 0.125\n"
    assert err == expected


def test_a_broken_map_and_an_unknown_sensing_are_one_line(guide, capsys):
    (guide / "map.toml").write_text("[boards\n")
    status, _, err = call(capsys, *example("rollout"))
    assert (status, err.count("\n")) == (1, 1)
    assert "map.toml: file: expected valid TOML" in err
    status, _, err = call(capsys, *example("rollout"), "--sensing", "magic")
    assert (status, err.count("\n")) == (1, 1)
    assert "--sensing: expected layer, rigid, coupled, cones, found 'magic'" in err


def test_arrays_that_are_not_there_are_one_line(guide, capsys):
    status, _, err = call(capsys, "import", "arrays", "none.npz", "--out", "x.h5")
    assert (status, err.count("\n")) == (1, 1)
    assert "none.npz" in err
