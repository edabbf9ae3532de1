"""Faulty grasps of a simulated dataset are found, left out and reported."""

from __future__ import annotations

import h5py
import numpy as np
import pytest

from taxel.gap.data.pair import read_pair
from taxel.gap.data.simulator_faults import KEPT, LEFT_OUT
from taxel.gap.diagnosis import diagnose
from taxel.recording.grasp_format import Phase

GRASP = "0003"


def spike(group):
    force = group["contact_force"][...]
    force[np.flatnonzero(group["phase"][...] == Phase.HOLD)[3]] *= 20.0
    group["contact_force"][...] = force


def stop(group):
    frame = np.flatnonzero(group["phase"][...] == Phase.HOLD)[3]
    for name in ("raw_counts", "contact_force", "separation"):
        values = group[name][...]
        values[frame:] = values[frame]
        group[name][...] = values


def lose_object(group):
    group["contact_force"][...] = 0.0
    group["raw_counts"][...] = group["raw_counts"][0]


FAULTS = {"force jump": spike, "contact in the recovery": stop, "the object is missing": lose_object}


def damage(path, change, names=(GRASP,)):
    with h5py.File(path, "r+") as file:
        for name in names:
            change(file["grasps"][name])


@pytest.mark.parametrize("words", FAULTS)
def test_a_faulty_grasp_is_left_out_and_named(world, tmp_path, words):
    real, sim = world(tmp_path)
    grasps = len(read_pair(real, sim).sim)
    damage(sim, FAULTS[words])
    pair = read_pair(real, sim)
    (fault,) = pair.faults
    assert (fault.grasp, fault.handled) == (GRASP, LEFT_OUT)
    assert words in fault.problem
    assert len(pair.sim) == grasps - 1


def test_a_fault_of_one_grasp_changes_neither_cause_nor_gap(world, tmp_path):
    paths = world(tmp_path, effect=lambda force, signal: np.minimum(signal, 500.0))
    before = diagnose(*paths).report
    damage(paths[1], spike)
    after = diagnose(*paths).report
    assert after["verdict"]["effects"][0] == before["verdict"]["effects"][0] == "saturation"
    assert after["gap"]["value"] == pytest.approx(before["gap"]["value"], rel=0.05)
    assert before["inputs"]["problems"] == []
    (problem,) = after["inputs"]["problems"]
    assert (problem["file"], problem["grasp"], problem["handled"]) == ("sim", GRASP, LEFT_OUT)


def test_faults_of_many_grasps_are_kept_and_reported(world, tmp_path):
    real, sim = world(tmp_path)
    with h5py.File(sim) as file:
        names = sorted(file["grasps"])
    damage(sim, spike, names[: len(names) // 2])
    pair = read_pair(real, sim)
    assert len(pair.sim) == len(names)
    assert {one.handled for one in pair.faults} == {KEPT}
    report = diagnose(real, sim).report
    assert any("violate physics" in reason for reason in report["verdict"]["reasons"])


def test_a_simulator_without_faults_has_no_problems(world, tmp_path):
    assert read_pair(*world(tmp_path)).faults == ()
