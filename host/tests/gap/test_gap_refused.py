"""Datasets without information are refused with a one-line message; smaller deficits are reported."""

from __future__ import annotations

import json

import h5py
import numpy as np
import pytest
from typer.testing import CliRunner

from taxel.cli.main import build_app
from taxel.gap.data.pair import read_pair
from taxel.gap.diagnosis import diagnose
from taxel.gap.errors import GapInputError
from taxel.recording.errors import DatasetError

pytestmark = pytest.mark.slow


def change_grasps(path, change):
    """Call `change(number, grasp)` for every grasp of a file."""
    with h5py.File(path, "r+") as file:
        for number, grasp in enumerate(file["grasps"].values()):
            change(number, grasp)


def remove_hold(number, grasp):
    """Mark all frames of hold as lost."""
    valid = grasp["valid"][()]
    valid[grasp["phase"][()] == 2] = False
    grasp["valid"][...] = valid


def silence_board(number, grasp):
    grasp["valid"][:, 1] = False


def set_constant_counts(number, grasp):
    grasp["raw_counts"][...] = 2426


def round_times(number, grasp):
    grasp["timestamp"][...] = np.floor(grasp["timestamp"][()])


@pytest.mark.parametrize(
    ("side", "change", "words"),
    [
        (0, remove_hold, "valid frames in hold"),
        (1, silence_board, "frames of sensor 33"),
        (0, set_constant_counts, "check the recording of the hand"),
        (1, set_constant_counts, "counts that depend on contact_force"),
        (0, round_times, "a finer clock"),
    ],
)
def test_datasets_without_information_are_refused_in_one_line(write_world, tmp_path, side, change, words):
    """side: dataset with the fault, 0: real, 1: simulated."""
    paths = write_world(tmp_path, conditions=3, sessions=3)
    change_grasps(paths[side], change)
    with pytest.raises(GapInputError, match=words) as caught:
        read_pair(*paths)
    assert paths[side] in str(caught.value)
    assert "\n" not in str(caught.value)


def test_exchanged_real_and_simulated_files_are_refused(write_world, tmp_path):
    real, sim = write_world(tmp_path, conditions=2, sessions=2)
    with pytest.raises(GapInputError, match="exchange the two files"):
        read_pair(sim, real)


def test_two_real_files_are_accepted(write_world, tmp_path):
    real, _ = write_world(tmp_path, conditions=2, sessions=2)
    assert read_pair(real, real).is_real_real


def repeat_first_counts(path):
    """Give all grasps of an approach the counts of its first grasp."""
    with h5py.File(path, "r+") as file:
        first = {}
        for grasp in file["grasps"].values():
            one = first.setdefault(grasp.attrs["approach"], grasp)
            grasp["raw_counts"][...] = one["raw_counts"][()]


def test_bit_identical_grasps_are_not_counted_as_repeats(write_world, tmp_path):
    paths = write_world(tmp_path, conditions=3, sessions=3)
    repeat_first_counts(paths[0])
    losses = read_pair(*paths).losses
    assert any("bit-identical" in loss for loss in losses)


def test_a_phase_missing_in_a_grasp_is_reported(write_world, tmp_path):
    paths = write_world(tmp_path, conditions=3, sessions=3)

    def remove_release(number, grasp):
        if number == 4:
            phase = grasp["phase"][()]
            grasp["phase"][...] = np.where(phase == 3, 4, phase)

    change_grasps(paths[0], remove_release)
    (loss,) = (loss for loss in read_pair(*paths).losses if "release" in loss)
    assert "1 of 18 grasps (0004)" in loss


def test_timestamps_in_milliseconds_are_reported(write_world, tmp_path):
    paths = write_world(tmp_path, conditions=3, sessions=3)
    change_grasps(paths[0], lambda number, grasp: grasp["timestamp"].write_direct(1e3 * grasp["timestamp"][()]))
    assert any("check the unit of time" in loss for loss in read_pair(*paths).losses)


def test_a_grasp_without_valid_frames_is_reported(write_world, tmp_path):
    paths = write_world(tmp_path, conditions=3, sessions=3)

    def lose_frames(number, grasp):
        if number == 4:
            grasp["valid"][...] = False

    change_grasps(paths[0], lose_frames)
    losses = read_pair(*paths).losses
    assert "1 of 18 grasps of the hand have no valid frame" in losses
    assert not any("baselines" in loss for loss in losses)


def test_an_empty_catalogue_gives_an_unknown_cause(write_world, tmp_path):
    from taxel.gap.effects.catalogue import OWN_EFFECTS

    paths = write_world(tmp_path, effect=lambda force, signal_counts: 0.6 * signal_counts)
    verdict = diagnose(*paths, without=list(OWN_EFFECTS)).report["verdict"]
    assert verdict["status"] == "unknown"
    assert "no effect of the catalogue was tried" in verdict["one_line"]


def test_names_with_square_brackets_are_printed_unchanged(write_world, tmp_path):
    real, sim = write_world(tmp_path, conditions=2, sessions=3)

    def rename_approach(number, grasp):
        if grasp.attrs["approach"] == "press_0":
            grasp.attrs["approach"] = "press[/bold]0"

    change_grasps(real, rename_approach)
    out = tmp_path / "[/bold]x"
    result = CliRunner().invoke(build_app("gap"), ["gap", "diagnose", real, sim, "--out", str(out)])
    assert result.exit_code == 0, result.output
    assert "[/bold]x/report.html" in result.output
    assert "press[/bold]0" in (out / "report.html").read_text()
    assert json.loads((out / "report.json").read_text())["format"] == "taxel-gap-report"
    assert sorted(path.name for path in out.iterdir()) == ["report.html", "report.json"]


@pytest.mark.parametrize("place", ["file", "page"])
def test_a_failed_write_of_the_report_keeps_the_existing_files(write_world, tmp_path, place):
    real, sim = write_world(tmp_path, conditions=2, sessions=3)
    out = tmp_path / "out"
    if place == "file":
        out.write_text("old")
    else:
        (out / "report.html").mkdir(parents=True)
        (out / "report.json").write_text("old")
    result = CliRunner().invoke(build_app("gap"), ["gap", "diagnose", real, sim, "--out", str(out), "--overwrite"])
    assert result.exit_code != 0
    assert "--out" in str(result.exception)
    assert (out if place == "file" else out / "report.json").read_text() == "old"


def test_apply_does_not_overwrite_the_real_dataset(write_world, tmp_path):
    real, sim = write_world(tmp_path, conditions=2, sessions=3)
    report = tmp_path / "report.json"
    report.write_text(json.dumps(diagnose(real, sim).report))
    command = ["gap", "apply", str(report), sim, "--out", real, "--overwrite"]
    result = CliRunner().invoke(build_app(command[0]), command)
    assert isinstance(result.exception, GapInputError)
    assert "a file other than the inputs" in str(result.exception)


def test_a_session_number_beyond_63_bits_is_refused(write_world, tmp_path):
    paths = write_world(tmp_path, conditions=2, sessions=3)

    def set_huge_session(number, grasp):
        grasp.attrs["session"] = np.uint64(2**63)

    change_grasps(paths[0], set_huge_session)
    with pytest.raises(DatasetError, match="2\\^63 - 1"):
        read_pair(*paths)
