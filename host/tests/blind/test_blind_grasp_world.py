"""The world of the demonstration: one hidden cause, and a few grasps on both sides."""

from collections import Counter
from types import SimpleNamespace

import numpy as np
import pytest

from host.tests.command_line import run_taxel
from taxel.blind import grasp_world
from taxel.blind.catalogue_causes import CATALOGUE_CAUSES
from taxel.blind.grasp_world import GraspWorldSampler, find_boards, make_small_plans
from taxel.blind.hidden import Cause, HiddenCauses
from taxel.blind.loaded_locations import SimulatedLoads
from taxel.blind.seal import commitment
from taxel.campaign.setup import Setup
from taxel.hand import load_hand


def make_loads(*addresses: int) -> SimulatedLoads:
    """Make the loads of a campaign that loads all taxels of the boards with these addresses; of all boards without
    one.
    """
    table = Setup().taxel_table()
    is_loaded = np.isin(table.sensor, addresses) if addresses else np.ones(len(table.sensor), bool)
    return SimulatedLoads(table, np.where(is_loaded, 1000.0, 0.0))


def sample(seed: int | None = None, loads: SimulatedLoads | None = None) -> grasp_world.GraspWorld:
    """Sample a world of the demonstration. loads: None: all boards are loaded."""
    return GraspWorldSampler(seed).sample(make_loads() if loads is None else loads)


def list_conditions(plan):
    """Return the set of pairs of object and approach in a plan."""
    return {(planned.object, planned.approach) for planned in plan}


@pytest.mark.parametrize("seed", range(5))
def test_both_sides_have_the_same_two_approaches_of_every_object(seed):
    real, sim = make_small_plans(seed)
    assert list_conditions(real) == list_conditions(sim)
    assert Counter(object_name for object_name, _ in list_conditions(real)) == dict.fromkeys(
        ("cylinder", "rectangular_prism", "triangular_prism"), grasp_world.APPROACHES_PER_OBJECT
    )


@pytest.mark.parametrize("seed", range(5))
def test_each_approach_is_emulated_once_per_session_and_simulated_eight_times(seed):
    real, sim = make_small_plans(seed)
    assert Counter((grasp.object, grasp.approach, grasp.session) for grasp in real).most_common(1)[0][1] == 1
    assert {grasp.session for grasp in real} == set(range(grasp_world.SESSIONS))
    repeats = Counter((grasp.object, grasp.approach) for grasp in sim)
    assert repeats == dict.fromkeys(list_conditions(real), grasp_world.SIM_REPEATS)


@pytest.mark.parametrize("seed", range(5))
def test_identifiers_of_the_grasps_of_a_plan_are_unique_and_ascending(seed):
    for plan in make_small_plans(seed):
        ids = [grasp.id for grasp in plan]
        assert ids == sorted(set(ids))


def test_world_is_determined_by_the_seed():
    assert sample(4) == sample(4)


def test_worlds_without_a_seed_differ():
    worlds = [sample() for _ in range(4)]
    assert len({commitment(world.to_json()) for world in worlds}) == 4


def test_400_worlds_hide_every_form_of_every_effect_none_and_pairs_of_different_effects():
    """400 sampled worlds contain every cause type of the catalogue and every kind of world.

    No world has two causes of the same effect.
    """
    worlds = [sample(seed) for seed in range(400)]
    causes = [cause for world in worlds for cause in world.hidden.causes]
    assert {cause.emulator_effect for cause in causes} == {one.emulator_effect for one in CATALOGUE_CAUSES}
    assert {world.hidden.kind for world in worlds} == set(grasp_world.KIND_SHARES)
    for world in worlds:
        assert len({cause.name for cause in world.hidden.causes}) == len(world.hidden.causes)


def test_cause_of_some_boards_acts_on_at_least_one_board_that_the_grasps_load():
    hand, addresses = load_hand("original"), (0x15, 0x1C)
    worlds = [sample(seed, make_loads(*addresses)) for seed in range(60)]
    causes = [cause for world in worlds for cause in world.hidden.causes]
    local = [boards for cause in causes if (boards := find_boards(cause, hand))]
    assert len(local) > 10
    assert all(boards & set(addresses) for boards in local)


@pytest.mark.parametrize("arguments", [("--seed", "-1"), ("--jobs", "-1")])
def test_invalid_numbers_are_rejected_before_a_file_is_made(arguments, tmp_path, capsys):
    assert run_taxel("demo", "--out", tmp_path / "demo", *arguments) == 2
    assert f"'{arguments[0]}'" in capsys.readouterr().err
    assert not (tmp_path / "demo").exists()


def test_size_of_a_single_cause_is_measured_without_further_grasps(monkeypatch, tmp_path):
    """The size is the change from the dataset without any cause to the real dataset; no emulation can be run."""
    world = grasp_world.GraspWorld(3, HiddenCauses("single", (Cause("noise", "noise", ("noise x=1",)),), ()), "")
    real, without = tmp_path / "real.h5", tmp_path / "without.h5"
    sizes = {(real, without): 2.5}
    cause_sizes = SimpleNamespace(measure=lambda *paths: sizes[paths])
    monkeypatch.delattr(grasp_world, "run_emulated")
    assert grasp_world.measure_sizes(world, real, without, cause_sizes) == (2.5,)


def test_size_of_each_of_several_causes_is_measured_by_repeating_the_first_session_without_it(monkeypatch, tmp_path):
    """Each run has the other cause and the nuisance (a deviation that is no cause), and the seed of the world.

    A run has the 6 grasps of the first session (number 0); the progress counts 12 grasps of two runs.
    """
    causes = tuple(Cause(name, name, (f"{name} x=1",)) for name in ("noise", "latency"))
    world = grasp_world.GraspWorld(3, HiddenCauses("several", causes, ("gain electrode log_std=0.01",)), "")
    runs, shown = [], []

    def emulate(path, plan, settings, jobs, progress, memory):
        runs.append((settings.effects, {planned.session for planned in plan}, settings.seed))
        progress(len(plan), len(plan))

    monkeypatch.setattr(grasp_world, "run_emulated", emulate)
    cause_sizes = SimpleNamespace(measure=lambda real, without: float(len(runs)))
    sizes = grasp_world.measure_sizes(
        world, tmp_path / "real.h5", tmp_path / "without.h5", cause_sizes, lambda *done: shown.append(done)
    )
    assert sizes == (1.0, 2.0)  # the substitute of `measure` returns the number of runs so far
    nuisance = "gain electrode log_std=0.01"
    assert [run[0] for run in runs] == [("latency x=1", nuisance), ("noise x=1", nuisance)]
    assert all(run[1:] == ({0}, 3) for run in runs)
    assert shown == [(6, 12), (12, 12)]
