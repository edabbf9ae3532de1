"""`taxel grasp`: what it refuses, and what it makes."""

import io
import json
from contextlib import redirect_stdout
from functools import partial
from pathlib import Path

import pytest

from host.tests.command_line import exit_status, refusal
from taxel.cli import grasp
from taxel.grasp.timeline import Timeline
from taxel.recording.grasp_dataset import GraspDataset

SHORT = Timeline(baseline_s=0.6, closing_s=1.0, hold_s=0.5, release_s=0.5, recovery_s=0.3)


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (["--source", "robot"], "taxel: --source: expected emulated, sim, physical, both, found 'robot'"),
        (["--source", "sim", "--sessions", "0"], "taxel: --sessions: expected 1 to 6, found 0"),
        (["--source", "sim", "--sessions", "7"], "taxel: --sessions: expected 1 to 6, found 7"),
        (["--source", "sim", "--grasps", "-1"], "taxel: grasp: Invalid value for '--grasps': -1"),
        (["--source", "sim", "--seed", "-1"], "taxel: grasp: Invalid value for '--seed': -1"),
        (["--source", "sim", "--jobs", "-1"], "taxel: grasp: Invalid value for '--jobs': -1"),
        (["--source", "sim", "--sensing", "best"], "taxel: --sensing: expected layer, "),
        (["--source", "both", "--sensing", "best"], "taxel: --sensing: expected layer, "),
        (["--source", "sim", "--object", "ball"], "taxel: --object: expected one of cylinder, "),
        (["--source", "emulated", "--effect", "best"], "taxel: effects: expected thesis, none, or lines "),
        (["--source", "both", "--effect", "best"], "taxel: effects: expected thesis, none, or lines "),
        (["--source", "physical", "--arm", "ur5e"], "taxel: --arm: expected rtde:HOST or simulated, found 'ur5e'"),
        (["--source", "physical", "--arm", "simulated", "--can", "usb"], "taxel: usb: is not the URL of a CAN channel"),
        (["--source", "sim", "--calibration", "missing.toml"], "taxel: missing.toml: "),
    ],
)
def test_a_bad_option_is_one_line_and_makes_nothing(arguments, complaint, capsys, tmp_path):
    assert refusal(capsys, "grasp", *arguments, "--out", str(tmp_path / "new")).startswith(complaint)
    assert list(tmp_path.iterdir()) == []


def test_effects_that_the_emulator_refuses_are_named(capsys, tmp_path):
    out = tmp_path / "real.h5"
    assert exit_status("grasp", "--source", "emulated", "--out", out, "--effect", "noise x") == 1
    assert "(found 'effect noise x')" in capsys.readouterr().err
    assert not out.exists()


@pytest.mark.parametrize("source", ["emulated", "sim", "physical"])
def test_a_file_that_exists_is_refused_and_kept(source, capsys, tmp_path):
    out = tmp_path / "some.h5"
    out.write_text("kept")
    line = refusal(capsys, "grasp", "--source", source, "--out", str(out))
    assert line == f"taxel: {out}: exists already; choose another --out, or give --resume or --overwrite"
    assert out.read_text() == "kept"


def test_of_both_none_is_begun_if_one_exists(capsys, tmp_path):
    (tmp_path / "sim.h5").write_text("kept")
    assert "sim.h5: exists already" in refusal(capsys, "grasp", "--source", "both", "--out", str(tmp_path))
    assert [path.name for path in tmp_path.iterdir()] == ["sim.h5"]


@pytest.fixture(scope="module")
def shorter():
    """Grasps of three seconds."""
    with pytest.MonkeyPatch.context() as patch:
        for name in ("EmulatedSettings", "SimSettings"):
            patch.setattr(grasp, name, partial(getattr(grasp, name), timeline=SHORT))
        yield


@pytest.fixture(scope="module")
def both(shorter, tmp_path_factory) -> tuple[Path, str]:
    """(the folder of two grasps, standard output)."""
    out = tmp_path_factory.mktemp("campaign") / "new" / "folder"
    options = ["--source", "both", "--grasps", "2", "--object", "cylinder", "--jobs", "1", "--json"]
    with redirect_stdout(io.StringIO()) as told:
        assert exit_status("grasp", *options, "--out", out) == 0
    return out, told.getvalue()


def test_both_makes_a_real_and_a_simulated_file_of_the_same_grasps(both):
    out = both[0]
    assert sorted(path.name for path in out.iterdir()) == ["real.h5", "sim.h5"]
    with GraspDataset(out / "real.h5", baseline_frames=10) as real, GraspDataset(out / "sim.h5", 10) as sim:
        real.check()
        sim.check()
        assert (real.source, sim.source) == ("real", "sim")
        assert real.ids == sim.ids
        assert len(real) == 2
        assert {grasp.object for grasp in real} == {"cylinder"}
        assert (real.taxels.position == sim.taxels.position).all()


def test_json_on_standard_output_says_what_was_made(both):
    out, told = both
    found = json.loads(told)
    assert set(found) == {str(out / "real.h5"), str(out / "sim.h5")}
    for counted in found.values():
        assert counted["cylinder"]["grasps"] == 2
        assert counted["cylinder"]["points"] > 20
        assert counted["triangular_prism"] == {"grasps": 0, "points": 0}


def test_a_whole_campaign_is_resumed_at_once_and_reported_as_a_table(both, capsys):
    path = both[0] / "sim.h5"
    options = ["--source", "sim", "--grasps", "2", "--object", "cylinder", "--jobs", "1", "--resume"]
    assert exit_status("grasp", *options, "--out", path) == 0
    assert "cylinder" in capsys.readouterr().out
