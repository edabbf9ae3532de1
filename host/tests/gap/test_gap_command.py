"""`taxel gap diagnose`: written files, printed verdict, and refused inputs with one error line."""

from __future__ import annotations

import json
from pathlib import Path

import h5py
import numpy as np
import pytest

from host.tests.command_line import run_taxel


@pytest.fixture(scope="module")
def paths(write_world, tmp_path_factory):
    return write_world(tmp_path_factory.mktemp("pair"), conditions=4, sessions=3)


def test_the_diagnose_command_writes_report_and_page_and_prints_the_verdict(capsys, paths, tmp_path):
    assert run_taxel("gap", "diagnose", *paths, "--out", tmp_path / "gap") == 0
    report = json.loads((tmp_path / "gap" / "report.json").read_text())
    assert report["verdict"]["status"] == "no_gap"
    assert "No gap" in capsys.readouterr().out
    assert (tmp_path / "gap" / "report.html").stat().st_size > 10_000


def test_an_existing_report_is_replaced_only_with_overwrite(capsys, paths, tmp_path):
    report = tmp_path / "report.json"
    report.write_text("mine")
    assert run_taxel("gap", "diagnose", *paths, "--out", tmp_path) == 1
    assert "exists already" in capsys.readouterr().err
    assert report.read_text() == "mine"
    assert run_taxel("gap", "diagnose", *paths, "--out", tmp_path, "--overwrite", "--json") == 0
    assert json.loads(capsys.readouterr().out)["verdict"] == json.loads(report.read_text())["verdict"]


def change_simulation(paths, tmp_path, change):
    """Return the paths of the real dataset and of a changed copy of the simulated dataset."""
    copy = tmp_path / "sim.h5"
    copy.write_bytes(Path(paths[1]).read_bytes())
    with h5py.File(copy, "r+") as file:
        change(file)
    return paths[0], str(copy)


def test_frames_of_the_simulator_that_violate_physics_are_reported(capsys, paths, tmp_path):
    def plant_spike(file):
        grasp = file["grasps/0000"]
        frame = int(np.flatnonzero(grasp["phase"][:] == 2)[-3])
        grasp["contact_force"][frame] = 30.0 * grasp["contact_force"][frame] + 5.0

    real, sim = change_simulation(paths, tmp_path, plant_spike)
    assert run_taxel("gap", "diagnose", *paths, "--out", tmp_path / "intact") == 0
    assert "faulty grasp" not in capsys.readouterr().out
    assert run_taxel("gap", "diagnose", real, sim, "--out", tmp_path / "spike") == 0
    assert "Faulty grasp of the simulator: 0000: force jump" in " ".join(capsys.readouterr().out.split())
    assert "0000: force jump" in (tmp_path / "spike" / "report.html").read_text()


def rename_approaches(file):
    for grasp in file["grasps"].values():
        grasp.attrs["approach"] = "other"


def move_a_taxel(file):
    file["taxels/position"][3] = np.array([0.5, 0.0, 0.0])


def swap_lines(file):
    file["taxels/rx"][0], file["taxels/rx"][1] = 1, 0


def remove_baseline(file):
    """Give the first 105 of the 110 baseline frames of a grasp the phase closing, so that too few remain."""
    grasp = file["grasps/0000"]
    phase = grasp["phase"][:]
    phase[:105] = 1
    grasp["phase"][:] = phase


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (rename_approaches, ("/grasps", "an (object, approach) of", "simulate the recorded grasps")),
        (move_a_taxel, ("/taxels/position[3]", "the same taxels in the same order")),
        (swap_lines, ("/taxels/rx[0]", "the same taxels in the same order")),
        (remove_baseline, ("/grasps/0000", "baseline")),
    ],
)
def test_files_of_different_hands_or_objects_give_one_error_line(capsys, paths, tmp_path, change, words):
    pair = change_simulation(paths, tmp_path, change)
    assert run_taxel("gap", "diagnose", *pair, "--out", tmp_path / "gap") == 1
    lines = [line for line in capsys.readouterr().err.splitlines() if line]
    assert len(lines) == 1
    assert lines[0].startswith("taxel: ")
    assert all(word in lines[0] for word in words)
    assert not (tmp_path / "gap").exists()
