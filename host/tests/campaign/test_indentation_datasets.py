"""Datasets of indentation campaigns: an emulated and a simulated dataset of one plan, and their reproducibility."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from taxel.campaign import processes
from taxel.campaign.indentation import (
    IndentationDesign,
    SimIndentationSettings,
    indentation_settings,
    run_emulated_indentations,
    run_simulated_indentations,
    sample_indentation_plan,
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
    return sample_indentation_plan(hand, 2, IndentationDesign(sessions=2, repeats=1))


@pytest.fixture(scope="module")
def settings(hand):
    return indentation_settings(hand, seed=2)


@pytest.fixture(scope="module")
def pair(plan, settings, tmp_path_factory):
    """Make the emulated and the simulated dataset without worker processes; return the paths of real.h5 and sim.h5."""
    folder = tmp_path_factory.mktemp("pair")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(processes, "ProcessPoolExecutor", None)
        patch.setenv("SOURCE_DATE_EPOCH", "0")
        run_emulated_indentations(folder / "real.h5", plan, settings)
        run_simulated_indentations(folder / "sim.h5", plan, SimIndentationSettings(seed=2, repeats=2))
    return folder / "real.h5", folder / "sim.h5"


def test_both_datasets_contain_all_approaches_and_phases_at_20_to_40_frames_per_second(pair, plan):
    count = 2 * len(plan.approaches)  # one repeat in each of two sessions, or two simulated repeats
    for path, source in zip(pair, ("real", "sim"), strict=True):
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


def test_the_real_dataset_follows_the_plan_in_order(pair, plan):
    with GraspDataset(pair[0]) as data:
        assert data.ids == tuple(indentation.id for indentation in plan.indentations)
        for grasp, indentation in zip(data, plan.indentations, strict=True):
            assert (grasp.session, grasp.iteration) == (indentation.session, indentation.iteration)
            assert (grasp.sensor_pose == plan.bracket_poses).all()
            assert (grasp.object_pose == indentation.approach.held_pose).all()
        first_session = [grasp for grasp in data if grasp.session == 0]
        assert all(earlier.timestamp[-1] < later.timestamp[0] for earlier, later in pairwise(first_session))


def test_the_generator_attributes_of_both_files_state_the_plan_and_no_effect(pair, plan):
    for path in pair:
        with GraspDataset(path) as data:
            assert data.generator.endswith(plan.describe())
            assert "effect" not in data.generator


def test_counts_decrease_in_hold_and_return_to_the_baseline(pair):
    with GraspDataset(pair[0]) as data:
        for grasp in data:
            baseline, hold, recovery = (
                grasp.raw_counts[grasp.phase == phase].mean(axis=0)
                for phase in (Phase.BASELINE, Phase.HOLD, Phase.RECOVERY)
            )
            assert 4 <= (baseline - hold > 150).sum() <= 60  # of 190 taxels
            assert baseline == pytest.approx(recovery, abs=6.0)


def test_the_simulated_taxel_forces_add_up_to_about_the_force_of_the_mount(pair, plan):
    """The forces are constant in the hold. Their sum differs from the force of the mount for two reasons: surfaces are
    inclined, and a part of the force acts on the bare margins of the boards.
    """
    force_n = {approach.name: approach.force_n for approach in plan.approaches}
    with GraspDataset(pair[1]) as data:
        for grasp in data:
            hold = grasp.contact_force[grasp.phase == Phase.HOLD].sum(axis=1)
            assert np.ptp(hold) < 1e-9
            assert 0.3 * force_n[grasp.approach] < hold[0] < 1.4 * force_n[grasp.approach]
            assert not grasp.contact_force[grasp.phase == Phase.BASELINE].any()


def test_most_of_the_simulated_force_acts_on_taxels_that_the_object_touches(pair):
    """Separation is measured at a taxel's centre and force over its whole square: they disagree only at edges."""
    with GraspDataset(pair[1]) as data:
        for grasp in data:
            is_touched = grasp.separation < 2e-4
            assert grasp.contact_force[is_touched].sum() > 0.8 * grasp.contact_force.sum()


def test_the_simulated_counts_follow_the_stated_sensor_model(pair):
    with GraspDataset(pair[1]) as data:
        for grasp in data:
            signal = data.sensor_model.full_scale_drop_counts * grasp.contact_force
            signal /= grasp.contact_force + data.sensor_model.half_force_n
            assert np.abs(grasp.raw_counts + signal - data.sensor_model.baseline_counts).max() < 30.0


def test_without_effects_the_mean_signals_agree_within_the_variance_of_repeats(pair):
    """A gap is a mean squared difference of mean signals; a floor is the variance of a mean over the repeats."""
    signals_by_dataset: list[dict[str, list[np.ndarray]]] = []
    for path in pair:
        by_approach: dict[str, list[np.ndarray]] = {}
        with GraspDataset(path) as data:
            for grasp in data:
                by_approach.setdefault(grasp.approach, []).append(grasp.mean_hold_signal())
        signals_by_dataset.append(by_approach)
    real, sim = signals_by_dataset
    gaps, floors = [], []
    for name, signals in real.items():
        real_mean, sim_mean = np.mean(signals, axis=0), np.mean(sim[name], axis=0)
        loaded = (real_mean > 10.0) | (sim_mean > 10.0)
        gaps.append(np.mean((real_mean - sim_mean)[loaded] ** 2))
        floors.append(np.mean(np.var(signals, axis=0, ddof=1)[loaded]) / len(signals))
    assert np.mean(gaps) < 3.0 * np.mean(floors)


@pytest.mark.slow
def test_the_seed_determines_the_bytes_of_the_simulated_file(pair, plan, tmp_path, monkeypatch):
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "0")
    run_simulated_indentations(tmp_path / "sim.h5", plan, SimIndentationSettings(seed=2, repeats=2))
    assert (tmp_path / "sim.h5").read_bytes() == pair[1].read_bytes()
    run_simulated_indentations(tmp_path / "other.h5", plan, SimIndentationSettings(seed=3, repeats=2))
    assert (tmp_path / "other.h5").read_bytes() != pair[1].read_bytes()


@pytest.mark.slow
def test_one_and_two_processes_make_emulated_files_with_the_same_bytes(pair, plan, settings, tmp_path, monkeypatch):
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "0")
    run_emulated_indentations(tmp_path / "real.h5", plan, settings, jobs=2)
    assert (tmp_path / "real.h5").read_bytes() == pair[0].read_bytes()


def test_an_interrupted_campaign_resumes_to_the_same_content(pair, plan, settings, tmp_path):
    def interrupt(done: int, total: int) -> None:
        if done == 8:  # after the first of two sessions
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_emulated_indentations(tmp_path / "real.h5", plan, settings, progress=interrupt)
    run_emulated_indentations(tmp_path / "real.h5", plan, settings, resume=True)
    with GraspDataset(tmp_path / "real.h5") as data, GraspDataset(pair[0]) as complete:
        assert data.ids == complete.ids
        for resumed, uninterrupted in zip(data, complete, strict=True):
            assert (resumed.raw_counts == uninterrupted.raw_counts).all()


def test_a_campaign_is_not_resumed_with_another_plan(pair, plan, settings):
    shorter_plan = replace(plan, indentations=plan.indentations[:8])
    with pytest.raises(DatasetError, match="belongs to another campaign"):
        run_emulated_indentations(pair[0], shorter_plan, settings, resume=True)


def test_effects_rejected_by_the_emulator_create_no_file(plan, settings, tmp_path):
    with pytest.raises(ContactLibraryError, match="noise purple"):
        run_emulated_indentations(tmp_path / "real.h5", plan, replace(settings, effects=("noise purple",)))
    assert not (tmp_path / "real.h5").exists()
