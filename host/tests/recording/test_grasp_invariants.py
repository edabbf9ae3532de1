"""Physical invariants of simulated datasets: wrong frames of a simulator are found and named."""

import shutil

import h5py
import numpy as np
import pytest

from host.tests.command_line import run_taxel
from taxel.campaign.setup import Setup
from taxel.campaign.simulated import SimSettings, run_simulated
from taxel.grasp.plan import make_thesis_plan
from taxel.grasp.timeline import Phase, Timeline
from taxel.recording.grasp_dataset import GraspDataset
from taxel.recording.grasp_invariants import InvariantChecker

APPROACHES = (("cylinder", "side_1"), ("rectangular_prism", "top"), ("triangular_prism", "side_1"))
TIMELINE = Timeline(baseline_s=0.5, closing_s=2.0, recovery_s=0.5)


@pytest.fixture(scope="module")
def simulated(tmp_path_factory):
    """Three simulated grasps with the usual variation."""
    path = tmp_path_factory.mktemp("invariants") / "sim.h5"
    plan = [grasp for grasp in make_thesis_plan(1) if (grasp.object, grasp.approach) in APPROACHES]
    first = {(grasp.object, grasp.approach): grasp for grasp in reversed(plan)}
    settings = SimSettings(timeline=TIMELINE)
    run_simulated(path, sorted(first.values(), key=lambda grasp: grasp.id), settings, Setup(), jobs=1)
    return path


def find_violations(path):
    """Return the violations of the physical invariants in a dataset."""
    with GraspDataset(path) as data:
        return list(InvariantChecker(data).find_violations())


@pytest.fixture
def change_first_grasp(simulated, tmp_path):
    """Function `change_first_grasp(edit)`: it copies the dataset and calls `edit(grasp, frame)` for its first grasp.

    `frame` is a hold frame. The function returns the path of the copy, the id of the grasp, and `frame`.
    """

    def apply(edit):
        path = tmp_path / "sim.h5"
        shutil.copy(simulated, path)
        with h5py.File(path, "r+") as file:
            grasp_id = sorted(file["grasps"])[0]
            grasp = file["grasps"][grasp_id]
            frame = int(np.flatnonzero(grasp["phase"][:] == Phase.HOLD)[7])
            edit(grasp, frame)
        return path, grasp_id, frame

    return apply


def test_the_simulator_of_this_project_violates_no_invariant(simulated):
    assert find_violations(simulated) == []


def test_a_planted_spike_of_the_force_is_found_in_its_frame(change_first_grasp):
    def plant(grasp, frame):
        grasp["contact_force"][frame] = 6.0 * grasp["contact_force"][frame]

    path, grasp_id, frame = change_first_grasp(plant)
    assert {(v.grasp, v.frame) for v in find_violations(path)} == {(grasp_id, frame)}
    assert "force jump" in {v.kind for v in find_violations(path)}


def test_a_planted_penetration_is_found_at_its_taxel(change_first_grasp):
    taxels = []

    def plant(grasp, frame):
        taxels.append(int(grasp["contact_force"][frame].argmax()))
        values = grasp["separation"][frame]
        values[taxels[0]] = -0.004
        grasp["separation"][frame] = values

    path, grasp_id, frame = change_first_grasp(plant)
    found = find_violations(path)
    assert {(v.grasp, v.frame) for v in found} == {(grasp_id, frame)}
    assert ("penetration", taxels[0]) in {(v.kind, v.taxel) for v in found}


def test_a_planted_force_without_contact_is_found_at_its_taxel(change_first_grasp):
    taxels, newtons = [], 8.0

    def plant(grasp, frame):
        taxels.append(int(grasp["separation"][frame].argmax()))
        values = grasp["contact_force"][frame]
        values[taxels[0]] = newtons
        grasp["contact_force"][frame] = values

    path, grasp_id, frame = change_first_grasp(plant)
    assert [(v.grasp, v.frame, v.kind, v.taxel) for v in find_violations(path)] == [
        (grasp_id, frame, "force without contact", taxels[0])
    ]


def test_a_hold_frame_without_force_is_reported_as_a_force_jump(change_first_grasp):
    def plant(grasp, frame):
        grasp["contact_force"][frame] = 0.0 * grasp["contact_force"][frame]

    path, grasp_id, frame = change_first_grasp(plant)
    found = find_violations(path)
    assert {(v.grasp, v.frame, v.kind) for v in found} == {(grasp_id, frame, "force jump")}


def test_a_force_that_decreases_during_the_hold_is_reported_as_not_at_rest(change_first_grasp):
    def plant(grasp, frame):
        hold = np.flatnonzero(grasp["phase"][:] == Phase.HOLD)
        for index, number in enumerate(hold):
            grasp["contact_force"][number] = (1.0 - 0.3 * index / len(hold)) * grasp["contact_force"][number]

    path, grasp_id, _ = change_first_grasp(plant)
    assert "not at rest" in {v.kind for v in find_violations(path) if v.grasp == grasp_id}


def test_the_command_lists_the_wrong_frames_and_fails(change_first_grasp, simulated, capsys):
    def plant(grasp, frame):
        grasp["contact_force"][frame] = 6.0 * grasp["contact_force"][frame]

    path, grasp_id, frame = change_first_grasp(plant)
    assert run_taxel("show", "--check", simulated) == 0
    assert "0 frames of 3 grasps violate an invariant" in capsys.readouterr().out
    assert run_taxel("show", "--check", path) == 1
    output = capsys.readouterr().out
    assert f"grasp {grasp_id}, frame {frame}" in output
    assert "1 frames of 3 grasps violate an invariant" in output
