"""Faulty grasps of a simulated dataset are found, excluded and reported."""

from __future__ import annotations

import h5py
import numpy as np
import pytest

from taxel.gap.data.pair import read_pair
from taxel.gap.data.simulator_faults import HANDLING_EXCLUDED, HANDLING_KEPT
from taxel.gap.diagnosis import diagnose
from taxel.recording.grasp_format import Phase

GRASP = "0003"


def add_force_spike(group):
    """Multiply the forces of one frame of hold by 20."""
    force = group["contact_force"][...]
    force[np.flatnonzero(group["phase"][...] == Phase.HOLD)[3]] *= 20.0
    group["contact_force"][...] = force


def freeze_contact(group):
    """Repeat the fourth frame of hold until the end of the grasp."""
    frame = np.flatnonzero(group["phase"][...] == Phase.HOLD)[3]
    for name in ("raw_counts", "contact_force", "separation"):
        values = group[name][...]
        values[frame:] = values[frame]
        group[name][...] = values


def remove_object(group):
    group["contact_force"][...] = 0.0
    group["raw_counts"][...] = group["raw_counts"][0]


FAULTS = {
    "force jump": add_force_spike,
    "contact in the recovery": freeze_contact,
    "the object is missing": remove_object,
}


def damage(path, change, names=(GRASP,)):
    """Change grasps of a file by the function `change`."""
    with h5py.File(path, "r+") as file:
        for name in names:
            change(file["grasps"][name])


@pytest.mark.parametrize("words", FAULTS)
def test_a_faulty_grasp_is_excluded_and_named(write_world, tmp_path, words):
    real, sim = write_world(tmp_path)
    grasps = len(read_pair(real, sim).sim)
    damage(sim, FAULTS[words])
    pair = read_pair(real, sim)
    (fault,) = pair.faults
    assert (fault.grasp, fault.handled) == (GRASP, HANDLING_EXCLUDED)
    assert words in fault.problem
    assert len(pair.sim) == grasps - 1


def test_a_fault_of_one_simulated_grasp_changes_neither_cause_nor_gap(write_world, tmp_path):
    paths = write_world(tmp_path, effect=lambda force, signal: np.minimum(signal, 500.0))
    before = diagnose(*paths).report
    damage(paths[1], add_force_spike)
    after = diagnose(*paths).report
    assert after["verdict"]["effects"][0] == before["verdict"]["effects"][0] == "saturation"
    assert after["gap"]["value"] == pytest.approx(before["gap"]["value"], rel=0.05)
    assert before["inputs"]["problems"] == []
    (problem,) = after["inputs"]["problems"]
    assert (problem["file"], problem["grasp"], problem["handled"]) == ("sim", GRASP, HANDLING_EXCLUDED)


def test_faults_of_many_grasps_are_kept_and_reported(write_world, tmp_path):
    real, sim = write_world(tmp_path)
    with h5py.File(sim) as file:
        names = sorted(file["grasps"])
    damage(sim, add_force_spike, names[: len(names) // 2])
    pair = read_pair(real, sim)
    assert len(pair.sim) == len(names)
    assert {one.handled for one in pair.faults} == {HANDLING_KEPT}
    report = diagnose(real, sim).report
    assert any("violate physics" in reason for reason in report["verdict"]["reasons"])


def test_a_simulator_without_faults_has_no_problems(write_world, tmp_path):
    assert read_pair(*write_world(tmp_path)).faults == ()
