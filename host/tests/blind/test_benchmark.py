"""The benchmark of diagnoses: measures from constructed answers, faults of simulator files, and a run."""

import json
import shutil
from pathlib import Path

import h5py
import numpy as np
import pytest

from host.tests.command_line import run_refused_command
from taxel.blind import sampling
from taxel.blind.benchmark import run
from taxel.blind.benchmark.entries import check_answer, load_entry
from taxel.blind.benchmark.faults import FAULTS, damage
from taxel.blind.benchmark.scoring import ScoredAnswer, score_answers
from taxel.blind.benchmark.worlds import FAMILIES, GRASPS, INDENTATIONS, INJECTED, TOO_WEAK, sample_benchmark
from taxel.errors import TaxelError
from taxel.plugins import PluginError
from taxel.recording.grasp_dataset import GraspDataset


def shrink_worlds(patch):
    """Patch the sampling so that every world has 16 indentations, to save time."""
    for name, value in (("APPROACHES", (8, 8)), ("SESSIONS", (2, 2)), ("REPEATS", (1, 1)), ("INDENTATIONS", (16, 16))):
        patch.setattr(sampling, name, value)


def answer(truth, kind, ratio=3.0, **probabilities):
    """Make the answer of a diagnosis for a world with these true causes. ratio: gap divided by the floor."""
    return ScoredAnswer(frozenset(truth), kind, "indentations", probabilities, ratio, seconds=1.0)


def test_single_causes_are_scored_by_first_name_and_exact_set_in_clear_worlds():
    """Three worlds are clear: their gap is at least two floors.

    In two of the three clear worlds, the most probable effect is the true cause. In one of them, the effects with a
    probability of at least 0.5 are exactly the true cause. In each of the four worlds, one effect has a probability of
    at least 0.8; two of these four effects are wrong.
    """
    answers = [
        answer(["noise"], "single", noise=0.9, unknown=0.1),
        answer(["noise"], "single", noise=0.9, unknown=0.6),
        answer(["noise"], "single", stiffness=0.9, noise=0.6),
        answer(["noise"], "single", ratio=1.5, stiffness=0.9, noise=0.6),
    ]
    score = score_answers(answers)
    assert score["single: named first"] == pytest.approx(2 / 3)
    assert score["single: exact set"] == pytest.approx(1 / 3)
    assert score["gap of 1 to 2 floors: named first or second"] == 1.0
    assert score["wrong at 0.8"] == pytest.approx(2 / 4)


def test_several_causes_are_scored_by_micro_f1():
    score = score_answers([answer(["noise", "latency"], "several", noise=0.9, latency=0.4)])
    assert score["several: micro-F1"] == pytest.approx(2 / 3)  # one of two causes is named


def test_causes_outside_the_catalogue_are_scored_by_unknown_causes_and_wrongly_named_effects():
    score = score_answers(
        [
            answer(["unknown"], "outside", unknown=0.9),
            answer(["unknown"], "outside", unknown=0.7, noise=0.9),
        ]
    )
    assert (score["outside: unknown listed"], score["outside: unknown alone"]) == (1.0, 0.5)
    assert score["outside: effect at 0.8"] == 0.5


def test_worlds_without_a_cause_are_scored_by_causes_with_a_probability_of_a_half():
    score = score_answers(
        [answer([], "none", no_gap=0.9, noise=0.2), answer([], "none", no_gap=0.1, noise=0.6)],
    )
    assert score["none: any cause at 0.5"] == 0.5


def test_measure_without_worlds_is_none():
    assert score_answers([answer([], "none", no_gap=0.9)])["single: named first"] is None


def test_answer_with_a_gap_and_without_a_probable_cause_names_an_unknown_cause():
    assert answer(["unknown"], "outside", noise=0.3, no_gap=0.1).listed == {"unknown"}
    assert answer([], "none", noise=0.3, no_gap=0.6).listed == frozenset()


def test_calibration_error_is_the_difference_between_stated_probability_and_true_share():
    answers = [answer(["noise"] if index < 3 else [], "single", noise=0.75) for index in range(4)]
    assert score_answers(answers)["calibration error"] == pytest.approx(0.0)
    answers = [answer([], "none", noise=0.75) for _ in range(4)]
    assert score_answers(answers)["calibration error"] == pytest.approx(0.75)


def select_world(kind, causes):
    """Return a world with injected causes of this kind and number of causes."""
    worlds = sample_benchmark(100, 3, [INJECTED])
    return next(world for world in worlds if world.kind == kind and len(world.truth) == causes)


def test_injected_cause_below_half_a_floor_is_no_cause_of_its_world():
    world = select_world("several", 3)
    assert world.without_weak_causes([0.6, 0.5, 3.0]) is world
    weak = world.without_weak_causes([0.4, 0.5, 3.0])
    assert (weak.truth, weak.kind, weak.forms) == (world.truth[1:], "several", world.forms)
    weak = world.without_weak_causes([0.4, 0.2, 3.0])
    assert (weak.truth, weak.kind) == (world.truth[2:], "single")
    for kind in ("single", "outside"):
        weak = select_world(kind, 1).without_weak_causes([0.3])
        assert (weak.truth, weak.kind) == ((), TOO_WEAK)


def test_world_without_injected_causes_keeps_its_truth():
    world = sample_benchmark(1, 5, [INDENTATIONS])[0]
    assert world.without_weak_causes(()) is world


@pytest.fixture(scope="module")
def simulated(tmp_path_factory):
    """Make a small world; return the path of its simulated dataset."""
    with pytest.MonkeyPatch.context() as patch:
        shrink_worlds(patch)
        folder = tmp_path_factory.mktemp("benchmark")
        world = sample_benchmark(1, 5, [INDENTATIONS])[0]
        world.make(folder / "real.h5", folder / "sim.h5", folder)
    return folder / "sim.h5"


@pytest.mark.parametrize("fault", FAULTS)
def test_fault_changes_the_counts_of_exactly_the_returned_grasp(fault, tmp_path, simulated):
    path = Path(shutil.copy(simulated, tmp_path / "sim.h5"))
    with h5py.File(path) as file:
        before = {name: group["raw_counts"][...] for name, group in file["grasps"].items()}
    grasp = damage(path, fault, seed=4)
    with GraspDataset(path) as data:
        changed = [name for name in data.ids if not np.array_equal(data[name].raw_counts, before[name])]
    assert changed == [grasp]


def test_equal_seeds_give_equal_worlds():
    first, second = (sample_benchmark(40, seed=3) for _ in range(2))
    assert [world.to_json() for world in first] == [world.to_json() for world in second]


def test_fifteen_percent_of_the_worlds_of_indentations_have_a_faulty_simulator_file():
    worlds = sample_benchmark(40, seed=3)
    indentations = [world for world in worlds if world.family == INDENTATIONS]
    assert sum(bool(world.fault) for world in worlds) == round(0.15 * len(indentations))


def test_worlds_are_numbered_and_have_all_families_in_their_proportions():
    worlds = sample_benchmark(40, seed=3)
    assert [world.number for world in worlds] == list(range(40))
    assert {world.family for world in worlds} == set(FAMILIES)
    assert sum(world.family == GRASPS for world in worlds) == 6  # 15 % of 40


class InOneProcess:
    """Replaces the pool of processes, because other processes would not see the patches of a test."""

    def __init__(self, *_, **__) -> None: ...

    def __enter__(self):
        return self

    def __exit__(self, *_) -> None: ...

    map = staticmethod(map)


@pytest.fixture
def guesses(monkeypatch):
    """Replace all diagnoses by one that always names noise; return the list of the datasets that it has diagnosed."""
    shrink_worlds(monkeypatch)
    calls = []

    def guess(real, sim, seed):
        calls.append(real)
        return {"noise": 0.9}

    monkeypatch.setattr(run, "open_diagnosis_pool", InOneProcess)
    monkeypatch.setattr(run, "load_entry", lambda name: guess)
    return calls


def test_run_writes_and_returns_the_score_and_does_not_repeat_stored_diagnoses(guesses, tmp_path):
    score = run.run_benchmark(tmp_path / "out", 1, 5, ["guess"], [INDENTATIONS])
    assert score["guess"]["all"]["worlds"] == 1
    assert json.loads((tmp_path / "out" / "score.json").read_text())["score"] == score
    assert run.run_benchmark(tmp_path / "out", 1, 5, ["guess"], [INDENTATIONS]) == score
    assert len(guesses) == 1


def test_run_in_a_folder_with_answers_of_another_seed_is_refused(guesses, tmp_path):
    run.run_benchmark(tmp_path / "out", 1, 5, ["guess"], [INDENTATIONS])
    with pytest.raises(TaxelError, match="another seed"):
        run.run_benchmark(tmp_path / "out", 1, 6, ["guess"], [INDENTATIONS])


def test_run_in_a_folder_with_answers_of_other_forms_is_refused_in_both_directions(guesses, tmp_path):
    for first, second in ((False, True), (True, False)):
        out = tmp_path / f"first {first}"
        run.run_benchmark(out, 1, 5, ["guess"], [INDENTATIONS], uses_reserved_forms=first)
        assert ("forms" in json.loads((out / "score.json").read_text())) == first
        with pytest.raises(TaxelError, match="forms of worlds"):
            run.run_benchmark(out, 1, 5, ["guess"], [INDENTATIONS], uses_reserved_forms=second)


def test_reserved_forms_without_a_family_of_injected_causes_are_refused(tmp_path, capsys):
    line = run_refused_command(
        capsys, "gap", "benchmark", "--worlds", "1", "--out", tmp_path, "--reserved-forms", "--family", INDENTATIONS
    )
    assert "--reserved-forms" in line
    assert "injected indentations" in line


def test_unknown_diagnosis_is_refused_with_the_known_names():
    with pytest.raises(PluginError, match="--entry: expected one of diagnosis, check list"):
        load_entry("oracle")


def test_answer_with_an_unknown_effect_or_a_probability_above_one_is_refused():
    with pytest.raises(PluginError, match="expected names of effects"):
        check_answer({"gremlins": 1.0}, "mine")
    with pytest.raises(PluginError, match="expected a probability"):
        check_answer({"noise": 1.5}, "mine")
    with pytest.raises(PluginError, match="noise: expected a probability, found 'often'"):
        check_answer({"noise": "often"}, "mine")


def test_least_squares_names_an_effect_of_the_response_for_a_signal_reduced_to_60_percent(simulated):
    """The real dataset is the simulated dataset with a smaller signal."""
    real = simulated.with_name("softer.h5")
    shutil.copy(simulated, real)
    with h5py.File(real, "r+") as file:
        file.attrs["source"] = "real"
        del file["sensor_model"]
        for group in file["grasps"].values():
            raw = group["raw_counts"][...].astype(float)
            group["raw_counts"][...] = np.rint(raw[0] + 0.6 * (raw - raw[0]))
            for name in ("contact_force", "separation", "distance"):
                group.pop(name, None)
    answer = check_answer(load_entry("least squares")(real, simulated, 0), "least squares")
    assert max(answer, key=lambda name: answer[name]) in ("stiffness", "gain_mismatch", "saturation")
    assert answer["no_gap"] < 0.5
