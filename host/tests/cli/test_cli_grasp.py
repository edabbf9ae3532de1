"""`taxel grasp`: invalid options, existing files, and the files and summaries of a short campaign."""

import io
import json
import shutil
from contextlib import redirect_stdout
from functools import partial
from pathlib import Path

import h5py
import pytest

from host.tests.command_line import run_refused_command, run_taxel
from taxel.cli import grasp, show
from taxel.grasp.timeline import Timeline
from taxel.recording.grasp_dataset import GraspDataset

SHORT = Timeline(baseline_s=0.6, closing_s=0.6, hold_s=0.3, release_s=0.4, recovery_s=0.2)


@pytest.mark.parametrize(
    ("arguments", "expected_start"),
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
        (["--source", "emulated", "--effect", "best"], "taxel: effects: expected thesis or lines "),
        (["--source", "both", "--effect", "best"], "taxel: effects: expected thesis or lines "),
        (["--source", "sim", "--effect", "none"], "taxel: --effect none: this value is now the option --no-effects"),
        (
            ["--source", "sim", "--effect", "thesis", "--no-effects"],
            "taxel: --effect and --no-effects: expected",
        ),
        (["--source", "physical", "--arm", "ur5e"], "taxel: --arm: expected rtde:HOST or simulated, found 'ur5e'"),
        (["--source", "physical", "--arm", "simulated", "--can", "usb"], "taxel: usb: is not the URL of a CAN channel"),
        (["--source", "sim", "--calibration", "missing.toml"], "taxel: missing.toml: "),
    ],
)
def test_an_invalid_option_gives_one_error_line_and_creates_no_file(arguments, expected_start, capsys, tmp_path):
    assert run_refused_command(capsys, "grasp", *arguments, "--out", str(tmp_path / "new")).startswith(expected_start)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["--source", "sim"], "taxel: --out: expected the dataset to write, found none; give --out FILE"),
        (
            ["--source", "sim", "--check-motion"],
            "taxel: --check-motion: expected --source physical, found --source sim",
        ),
        (
            ["--source", "physical", "--arm-start", "0,0,0,0,0,0"],
            "taxel: --arm-start: expected --check-motion, found none; a physical arm reports its own start",
        ),
        (
            ["--source", "physical", "--check-motion", "--arm-start", "0,x"],
            "taxel: --arm-start: expected six angles in degrees such as 0,-90,0,-90,0,0, found '0,x'",
        ),
    ],
)
def test_wrong_options_of_a_motion_check_give_one_error_line(arguments, expected, capsys):
    assert run_refused_command(capsys, "grasp", *arguments) == expected


def test_a_motion_check_prints_the_plan_and_names_an_infeasible_start(capsys):
    arguments = ["grasp", "--source", "physical", "--check-motion", "--grasps", "1", "--json"]
    assert run_taxel(*arguments) == 0
    (motion,) = json.loads(capsys.readouterr().out)
    assert motion["feasible"]
    assert motion["duration_s"] > 0
    assert len(motion["waypoints_rad"][0]) == 22  # 6 joints of the arm, 16 of the hand
    assert run_taxel(*arguments, "--arm-start", "0,0,0,0,0,0") == 1
    captured = capsys.readouterr()
    assert not json.loads(captured.out)[0]["feasible"]
    assert "start posture in collision: " in captured.err
    assert len(captured.err.strip().splitlines()) == 1


def test_an_effect_refused_by_the_emulator_is_named_in_the_error(capsys, tmp_path):
    out = tmp_path / "real.h5"
    assert run_taxel("grasp", "--source", "emulated", "--out", out, "--effect", "noise x") == 1
    assert "(found 'effect noise x')" in capsys.readouterr().err
    assert not out.exists()


@pytest.mark.parametrize("source", ["emulated", "sim", "physical"])
def test_an_existing_file_is_refused_and_not_changed(source, capsys, tmp_path):
    out = tmp_path / "some.h5"
    out.write_text("kept")
    line = run_refused_command(capsys, "grasp", "--source", source, "--out", str(out))
    assert line == f"taxel: {out}: exists already; choose another --out, or give --resume or --overwrite"
    assert out.read_text() == "kept"


def test_source_both_creates_no_file_if_one_of_its_files_exists(capsys, tmp_path):
    (tmp_path / "sim.h5").write_text("kept")
    assert "sim.h5: exists already" in run_refused_command(capsys, "grasp", "--source", "both", "--out", str(tmp_path))
    assert [path.name for path in tmp_path.iterdir()] == ["sim.h5"]


@pytest.fixture(scope="module")
def short_grasps():
    """Let the emulator and the simulator make grasps of 2.1 s, the sum of the durations of SHORT."""
    with pytest.MonkeyPatch.context() as patch:
        for name in ("EmulatedSettings", "SimSettings"):
            patch.setattr(grasp, name, partial(getattr(grasp, name), timeline=SHORT))
        yield


@pytest.fixture(scope="module")
def paired_campaign(short_grasps, tmp_path_factory) -> tuple[Path, str]:
    """Folder of a campaign of two grasps with --source both, and the standard output of the command."""
    out = tmp_path_factory.mktemp("campaign") / "new" / "folder"
    options = ["--source", "both", "--grasps", "2", "--object", "cylinder", "--jobs", "1", "--json"]
    with redirect_stdout(io.StringIO()) as standard_output:
        assert run_taxel("grasp", *options, "--out", out) == 0
    return out, standard_output.getvalue()


def test_source_both_creates_a_real_and_a_simulated_file_of_the_same_grasps(paired_campaign):
    folder, _ = paired_campaign
    assert sorted(path.name for path in folder.iterdir()) == ["real.h5", "sim.h5"]
    with GraspDataset(folder / "real.h5", baseline_frames=10) as real, GraspDataset(folder / "sim.h5", 10) as sim:
        real.check()
        sim.check()
        assert (real.source, sim.source) == ("real", "sim")
        assert real.ids == sim.ids
        assert len(real) == 2
        assert {grasp.object for grasp in real} == {"cylinder"}
        assert (real.taxels.position == sim.taxels.position).all()


def test_json_output_counts_grasps_and_contact_points_of_each_object(paired_campaign):
    folder, output = paired_campaign
    summary = json.loads(output)
    assert set(summary) == {str(folder / "real.h5"), str(folder / "sim.h5")}
    for objects in summary.values():
        assert objects["cylinder"]["grasps"] == 2
        assert objects["cylinder"]["points"] > 20
        assert (objects["cylinder"]["failed"], objects["cylinder"]["repeated"]) == (0, 0)
        assert objects["cylinder"]["failures"] == {}
        assert objects["triangular_prism"] == {"grasps": 0, "points": 0}


def test_resuming_a_complete_campaign_prints_its_table(paired_campaign, capsys):
    path = paired_campaign[0] / "sim.h5"
    options = ["--source", "sim", "--grasps", "2", "--object", "cylinder", "--jobs", "1", "--resume"]
    assert run_taxel("grasp", *options, "--out", path) == 0
    output = capsys.readouterr().out
    assert "cylinder" in output
    assert f"{path}: cylinder: 0 of 2 grasps failed, 0 attempts repeated" in output.replace("\n", "")


def test_show_prints_the_failed_grasps_of_a_campaign(paired_campaign, capsys, tmp_path):
    path = paired_campaign[0] / "real.h5"
    assert run_taxel("show", path, "--out", tmp_path) == 0
    assert f"{path}: cylinder: 0 of 2 grasps failed, 0 attempts repeated" in capsys.readouterr().out.splitlines()


def rename_grasps(path: Path, out: Path) -> Path:
    """Copy a dataset, and put an x before the id of every grasp. Return the path of the copy."""
    shutil.copyfile(path, out)
    with h5py.File(out, "a") as file:
        for name in list(file["grasps"]):
            file.move(f"grasps/{name}", f"grasps/x{name}")
    return out


def test_show_draws_the_same_condition_of_datasets_without_common_ids(paired_campaign, tmp_path, monkeypatch):
    real, sim = (paired_campaign[0] / f"{source}.h5" for source in ("real", "sim"))
    with GraspDataset(sim) as data:
        ids = {grasp.id for grasp in data}
    chosen = []
    monkeypatch.setattr(show, "save_grasp", lambda paths, out, grasps: chosen.append(grasps))
    renamed = rename_grasps(sim, tmp_path / "renamed.h5")
    assert run_taxel("show", real, renamed, "--out", tmp_path) == 0  # the condition: object and approach
    ((first, second),) = chosen
    assert first in ids
    assert second == f"x{first}"


def test_the_original_sensing_writes_a_dataset_of_the_original_hand(tmp_path):
    taxels_of_the_original_hand = 1037
    out = tmp_path / "original.h5"
    options = ("--source", "sim", "--sensing", "original", "--grasps", "1", "--jobs", "1")
    assert run_taxel("grasp", *options, "--out", out) == 0
    with GraspDataset(out) as data:
        data.check()
        assert "original sensing" in data.generator
        assert data[data.ids[0]].raw_counts.shape[1] == taxels_of_the_original_hand


def test_the_original_sensing_is_refused_for_another_source(tmp_path, capsys):
    line = run_refused_command(capsys, "grasp", "--source", "both", "--sensing", "original", "--out", tmp_path / "x")
    assert "--sensing original: expected --source sim" in line
