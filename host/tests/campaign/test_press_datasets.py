"""Press campaigns as files: a pair of datasets of one plan, the same bytes again, and where both sides agree."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from taxel.campaign import processes
from taxel.campaign.press import (
    SimPressSettings,
    press_settings,
    random_press_plan,
    run_pressed,
    simulate_pressed,
)
from taxel.emulated.contact import ContactLibraryError
from taxel.grasp.timeline import Phase
from taxel.hand import load_hand
from taxel.recording.errors import DatasetError
from taxel.recording.grasp_dataset import GraspDataset
from taxel.recording.grasp_format import BASELINE_FRAMES


@pytest.fixture(scope="module")
def hand():
    return load_hand("rig4")


@pytest.fixture(scope="module")
def plan(hand):
    return random_press_plan(hand, 2, sessions=2, repeats=1)


@pytest.fixture(scope="module")
def settings(hand):
    return press_settings(hand, seed=2)


@pytest.fixture(scope="module")
def pair(plan, settings, tmp_path_factory):
    """real.h5 and sim.h5, both made in this process."""
    folder = tmp_path_factory.mktemp("pair")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(processes, "ProcessPoolExecutor", None)
        patch.setenv("SOURCE_DATE_EPOCH", "0")
        run_pressed(folder / "real.h5", plan, settings)
        simulate_pressed(folder / "sim.h5", plan, SimPressSettings(seed=2, repeats=2))
    return folder / "real.h5", folder / "sim.h5"


def test_both_are_valid_with_a_baseline_and_every_phase(pair, plan):
    for path, source, count in zip(pair, ("real", "sim"), (16, 16), strict=True):
        with GraspDataset(path, BASELINE_FRAMES) as data:
            data.check()
            assert (data.source, data.hand, len(data)) == (source, "rig4", count)
            assert {(grasp.object, grasp.approach) for grasp in data} == {
                (approach.object, approach.name) for approach in plan.approaches
            }
            for grasp in data:
                assert set(grasp.phase.tolist()) == set(Phase)
                assert grasp.valid.all()
                assert 20.0 < 1.0 / np.median(np.diff(grasp.timestamp)) < 40.0


def test_the_real_side_is_the_plan_in_order(pair, plan):
    with GraspDataset(pair[0]) as data:
        assert data.ids == tuple(press.id for press in plan.presses)
        for grasp, press in zip(data, plan.presses, strict=True):
            assert (grasp.session, grasp.iteration) == (press.session, press.iteration)
            assert (grasp.sensor_pose == plan.bracket_poses).all()
            assert (grasp.object_pose == press.approach.held_pose).all()
        sessions = [grasp for grasp in data if grasp.session == 0]
        assert all(one.timestamp[-1] < other.timestamp[0] for one, other in pairwise(sessions))


def test_both_files_tell_the_same_plan_and_no_effect(pair, plan):
    for path in pair:
        with GraspDataset(path) as data:
            assert data.generator.endswith(plan.describe())
            assert "effect" not in data.generator


def test_counts_rest_in_the_baseline_drop_in_the_hold_and_come_back(pair):
    with GraspDataset(pair[0]) as data:
        for grasp in data:
            rest, hold, after = (
                grasp.raw_counts[grasp.phase == phase].mean(axis=0)
                for phase in (Phase.BASELINE, Phase.HOLD, Phase.RECOVERY)
            )
            assert 4 <= (rest - hold > 150).sum() <= 60
            assert rest == pytest.approx(after, abs=6.0)


def test_the_simulated_force_is_what_the_mount_pushes_with(pair, plan):
    """Seen along the line, and without the bare margin's part."""
    force_n = {approach.name: approach.force_n for approach in plan.approaches}
    with GraspDataset(pair[1]) as data:
        for grasp in data:
            hold = grasp.contact_force[grasp.phase == Phase.HOLD].sum(axis=1)
            assert np.ptp(hold) < 1e-9
            assert 0.3 * force_n[grasp.approach] < hold[0] < 1.4 * force_n[grasp.approach]
            assert not grasp.contact_force[grasp.phase == Phase.BASELINE].any()
            # A separation is measured at the taxel's middle, its force over its square: only edges differ.
            near = grasp.separation < 2e-4
            assert grasp.contact_force[near].sum() > 0.8 * grasp.contact_force.sum()
            drop = data.sensor_model.full_scale_drop_counts * grasp.contact_force
            drop /= grasp.contact_force + data.sensor_model.half_force_n
            assert np.abs(grasp.raw_counts + drop - data.sensor_model.baseline_counts).max() < 30.0


def test_without_effects_the_mean_drops_agree_to_what_repeats_resolve(pair):
    means: list[dict[str, list[np.ndarray]]] = []
    for path in pair:
        own: dict[str, list[np.ndarray]] = {}
        with GraspDataset(path) as data:
            for grasp in data:
                own.setdefault(grasp.approach, []).append(grasp.hold_drop())
        means.append(own)
    real, sim = means
    gaps, floors = [], []
    for name, drops in real.items():
        here, there = np.mean(drops, axis=0), np.mean(sim[name], axis=0)
        felt = (here > 10.0) | (there > 10.0)
        gaps.append(np.mean((here - there)[felt] ** 2))
        floors.append(np.mean(np.var(drops, axis=0, ddof=1)[felt]) / len(drops))
    assert np.mean(gaps) < 3.0 * np.mean(floors)


def test_the_same_seed_gives_the_same_bytes_and_another_does_not(pair, plan, tmp_path, monkeypatch):
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "0")
    simulate_pressed(tmp_path / "sim.h5", plan, SimPressSettings(seed=2, repeats=2))
    assert (tmp_path / "sim.h5").read_bytes() == pair[1].read_bytes()
    simulate_pressed(tmp_path / "other.h5", plan, SimPressSettings(seed=3, repeats=2))
    assert (tmp_path / "other.h5").read_bytes() != pair[1].read_bytes()


def test_two_processes_make_the_same_bytes(pair, plan, settings, tmp_path, monkeypatch):
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "0")
    run_pressed(tmp_path / "real.h5", plan, settings, jobs=2)
    assert (tmp_path / "real.h5").read_bytes() == pair[0].read_bytes()


def test_a_cut_campaign_goes_on_to_the_same_content(pair, plan, settings, tmp_path):
    told = []
    first = replace(plan, presses=plan.presses[:8])
    assert first.describe() != plan.describe()

    def stop(done: int, of: int) -> None:
        told.append(done)
        if done == 8:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_pressed(tmp_path / "real.h5", plan, settings, progress=stop)
    run_pressed(tmp_path / "real.h5", plan, settings, resume=True)
    with GraspDataset(tmp_path / "real.h5") as data, GraspDataset(pair[0]) as whole:
        assert data.ids == whole.ids
        assert all((one.raw_counts == other.raw_counts).all() for one, other in zip(data, whole, strict=True))
    with pytest.raises(DatasetError, match="it is of another campaign"):
        run_pressed(tmp_path / "real.h5", first, settings, resume=True)


def test_effects_that_the_emulator_refuses_leave_no_file(plan, settings, tmp_path):
    with pytest.raises(ContactLibraryError, match="noise purple"):
        run_pressed(tmp_path / "real.h5", plan, replace(settings, effects=("noise purple",)))
    assert not (tmp_path / "real.h5").exists()
