"""`taxel import`: the examples of the guide, and the error messages for invalid options and files."""

import json
import re
import shlex
from pathlib import Path

import pytest
from typer.testing import CliRunner

from host.tests.command_line import run_taxel
from taxel.cli import main as cli
from taxel.recording.grasp_dataset import GraspDataset

GUIDE = Path(__file__).parents[3] / "docs" / "how-to-import.md"
BLOCK = re.compile(r"```(\w+)\n(.*?)```", re.DOTALL)
FILE = re.compile(r"`(\w+\.(?:csv|toml))`")
SUBCOMMANDS = ("arrays", "gazebo", "active", "rollout")
BASELINE_FRAMES = 100
EXAMPLE_FRAMES = {"gazebo.h5": 3, "active.h5": 1, "rollout.h5": 3, "arrays.h5": 1}
"""File that an example of the guide writes -> frames of its grasp after the baseline frames, in the guide's order."""


def capture_taxel(capsys, *arguments):
    """Run `taxel ARGUMENTS...`; return exit status, standard output and standard error."""
    status = run_taxel(*arguments)
    printed = capsys.readouterr()
    return status, printed.out, printed.err


def read_blocks():
    """Yield (language, text, file name) of every code block of the guide.

    The file name of a CSV or TOML block is the last file name in the prose before the block; "" for other languages.
    """
    text = GUIDE.read_text()
    for match in BLOCK.finditer(text):
        language = match[1]
        before = re.sub(r"```.*?```", "", text[: match.start()], flags=re.DOTALL)
        names = [name for name in FILE.findall(before) if name.endswith(language)]
        yield language, match[2], names[-1] if names else ""


@pytest.fixture
def guide(tmp_path, monkeypatch):
    """The data files of the guide, written to a temporary folder that is the working folder of the test."""
    monkeypatch.chdir(tmp_path)
    for language, text, name in read_blocks():
        if language in ("csv", "toml"):
            (tmp_path / name).write_text(text)
    return tmp_path


def read_example_arguments(command):
    """Return the arguments after `taxel` in the guide's example of `taxel import COMMAND`."""
    commands = [line for language, text, _ in read_blocks() if language == "sh" for line in text.splitlines()]
    return shlex.split(next(line for line in commands if f"import {command} " in line))[1:]


def test_the_examples_of_the_guide_run_in_order(guide, capsys):
    written_files = []
    for language, text, _ in read_blocks():
        if language == "python":
            exec(compile(text, str(GUIDE), "exec"), {})
        if language == "sh":
            command_line = shlex.split(text)
            output_file = command_line[-1]
            status, out, err = capture_taxel(capsys, *command_line[1:])
            assert status == 0, err
            assert output_file in out
            written_files.append(output_file)
    assert written_files == list(EXAMPLE_FRAMES)
    for name, frames in EXAMPLE_FRAMES.items():
        with GraspDataset(guide / name) as data:
            data.check()
            assert data["0001"].n_frames == BASELINE_FRAMES + frames
    with GraspDataset(guide / "gazebo.h5") as data:
        # Sums of the forces at each time of contacts.csv in the guide: no contact, 1.2 N + 0.8 N, 1.3 N.
        assert data["0001"].contact_force.sum(axis=1)[-3:].round(9).tolist() == [0.0, 2.0, 1.3]
    with GraspDataset(guide / "active.h5") as data:
        assert data["0001"].active_taxels()[0].sum() == 1
    with GraspDataset(guide / "arrays.h5") as data:
        assert data["0001"].active_taxels()[0].sum() == 1


@pytest.mark.parametrize("command", SUBCOMMANDS)
def test_the_help_of_each_command_has_an_example(command):
    text = CliRunner().invoke(cli.build_app("import"), ["import", command, "--help"], env={"COLUMNS": "200"}).output
    assert f"Example: taxel import {command} " in text


def test_an_existing_file_is_replaced_only_with_the_option_overwrite(guide, capsys):
    (guide / "gazebo.h5").write_bytes(b"earlier content")
    status, _, err = capture_taxel(capsys, *read_example_arguments("gazebo"))
    assert (status, err.count("\n")) == (1, 1)
    assert "gazebo.h5" in err
    assert (guide / "gazebo.h5").read_bytes() == b"earlier content"
    assert capture_taxel(capsys, *read_example_arguments("gazebo"), "--overwrite")[0] == 0
    with GraspDataset(guide / "gazebo.h5") as data:
        data.check()


def test_json_output_counts_frames_and_contacts(guide, capsys):
    """The example contacts.csv of the guide has rows at three times, which become frames, and three contacts."""
    status, out, err = capture_taxel(capsys, *read_example_arguments("gazebo"), "--json")
    assert (status, err) == (0, "")
    assert json.loads(out) == {
        "file": "gazebo.h5",
        "grasps": 1,
        "frames": BASELINE_FRAMES + 3,
        "added_frames": BASELINE_FRAMES,
        "contacts": 3,
        "far_contacts": 0,
        "far_force_n": 0.0,
    }


def test_contacts_beyond_the_distance_threshold_are_reported_with_their_force(guide, capsys):
    status, out, _ = capture_taxel(capsys, *read_example_arguments("gazebo"), "--distance-mm", "0.5")
    assert status == 0
    assert "3 of 3 contacts (3.3 N in total) act on no taxel" in out


INVALID_OPTIONS = {  # case: (options added to the example, expected text of the error)
    "no joint angles and no poses": (
        ["--joint-file", ""],
        "--joint-file and --pose-file: expected one of them, found neither",
    ),
    "negative distance": (["--distance-mm", "-1"], "--distance-mm: expected a number above 0, found -1"),
    "wrist pose of three numbers": (["--wrist-pose", "0,0,0"], "--wrist-pose: expected x,y,z,qw,qx,qy,qz"),
    "quaternion of length zero": (["--wrist-pose", "0,0,0,0,0,0,0"], "--wrist-pose: expected x,y,z,qw,qx,qy,qz"),
    "negative noise": (["--noise-counts", "-3"], "noise_counts"),
    "unknown hand": (["--hand", "shadow"], "shadow"),
    "missing calibration": (["--calibration", "none.toml"], "none.toml: file: expected a file"),
    "file instead of a folder": (["--out", f"{__file__}/x.h5"], "Not a directory"),
}


@pytest.mark.parametrize("case", INVALID_OPTIONS)
def test_an_invalid_option_gives_one_error_line(guide, capsys, case):
    options, message = INVALID_OPTIONS[case]
    arguments = read_example_arguments("gazebo")
    if case == "no joint angles and no poses":
        option = arguments.index("--joint-file")
        arguments, options = arguments[:option] + arguments[option + 2 :], []
    status, _, err = capture_taxel(capsys, *arguments, *options)
    assert (status, err.count("\n")) == (1, 1), err
    assert message in err


def test_an_invalid_number_in_a_file_gives_one_error_line_with_line_and_column(guide, capsys):
    text = (guide / "contacts.csv").read_text()
    (guide / "contacts.csv").write_text(text.replace("0.5184,-0.0070,0.2737", "0.5184,minus,0.2737"))
    status, out, err = capture_taxel(capsys, *read_example_arguments("gazebo"))
    assert (status, out) == (1, "")
    expected = "taxel: contacts.csv: line 4, column y: expected a finite number, found 'minus'; write it as 0.125\n"
    assert err == expected


def test_an_invalid_map_file_gives_one_error_line(guide, capsys):
    (guide / "map.toml").write_text("[boards\n")
    status, _, err = capture_taxel(capsys, *read_example_arguments("rollout"))
    assert (status, err.count("\n")) == (1, 1)
    assert "map.toml: line 1, column 8: expected valid TOML" in err


def test_an_unknown_sensing_level_gives_one_error_line(guide, capsys):
    status, _, err = capture_taxel(capsys, *read_example_arguments("rollout"), "--sensing", "magic")
    assert (status, err.count("\n")) == (1, 1)
    assert "--sensing: expected layer, rigid, coupled, cones, found 'magic'" in err


def test_a_missing_array_file_gives_one_error_line(guide, capsys):
    status, _, err = capture_taxel(capsys, "import", "arrays", "none.npz", "--out", "x.h5")
    assert (status, err.count("\n")) == (1, 1)
    assert "none.npz" in err
