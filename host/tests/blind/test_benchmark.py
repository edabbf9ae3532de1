"""The benchmark of diagnoses: measures from constructed answers, faults of simulator files, and a run."""

import json
import shutil
from pathlib import Path

import h5py
import numpy as np
import pytest

from taxel.blind import sampling
from taxel.blind.benchmark import run
from taxel.blind.benchmark.entries import check_answer, load_entry
from taxel.blind.benchmark.faults import FAULTS, damage
from taxel.blind.benchmark.scoring import ScoredAnswer, score_answers
from taxel.blind.benchmark.worlds import FAMILIES, GRASPS, INDENTATIONS, sample_benchmark
from taxel.errors import TaxelError
from taxel.plugins import PluginError
from taxel.recording.grasp_dataset import GraspDataset


def shrink_worlds(patch):
    """Let worlds have as few indentations as possible."""
    for name, value in (("APPROACHES", (8, 8)), ("SESSIONS", (2, 2)), ("REPEATS", (1, 1)), ("INDENTATIONS", (16, 16))):
        patch.setattr(sampling, name, value)


def answer(truth, kind, ratio=3.0, **probabilities):
    return ScoredAnswer(frozenset(truth), kind, "indentations", probabilities, ratio, 1.0)


def test_named_first_and_exact_set_are_strict():
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


def test_several_outside_and_none_are_scored_by_their_own_measures():
    score = score_answers(
        [
            answer(["noise", "latency"], "several", noise=0.9, latency=0.4),
            answer(["unknown"], "outside", unknown=0.9),
            answer(["unknown"], "outside", unknown=0.7, noise=0.9),
            answer([], "none", no_gap=0.9, noise=0.2),
            answer([], "none", no_gap=0.1, noise=0.6),
        ]
    )
    assert score["several: micro-F1"] == pytest.approx(2 / 3)
    assert (score["outside: unknown listed"], score["outside: unknown alone"]) == (1.0, 0.5)
    assert score["outside: effect at 0.8"] == 0.5
    assert score["none: any cause at 0.5"] == 0.5
    assert score["single: named first"] is None


def test_no_probable_cause_with_a_gap_counts_as_unknown():
    assert answer(["unknown"], "outside", noise=0.3, no_gap=0.1).listed == {"unknown"}
    assert answer([], "none", noise=0.3, no_gap=0.6).listed == frozenset()


def test_calibration_error_is_the_distance_of_stated_and_true_shares():
    answers = [answer(["noise"] if index < 3 else [], "single", noise=0.75) for index in range(4)]
    assert score_answers(answers)["calibration error"] == pytest.approx(0.0)
    answers = [answer([], "none", noise=0.75) for _ in range(4)]
    assert score_answers(answers)["calibration error"] == pytest.approx(0.75)


@pytest.fixture(scope="module")
def simulated(tmp_path_factory):
    """A simulated dataset of a small world."""
    with pytest.MonkeyPatch.context() as patch:
        shrink_worlds(patch)
        folder = tmp_path_factory.mktemp("benchmark")
        world = sample_benchmark(1, 5, [INDENTATIONS])[0]
        world.make(folder / "real.h5", folder / "sim.h5", folder)
    return folder / "sim.h5"


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_changes_one_grasp_and_the_file_stays_readable(fault, tmp_path, simulated):
    path = Path(shutil.copy(simulated, tmp_path / "sim.h5"))
    with h5py.File(path) as file:
        before = {name: group["raw_counts"][...] for name, group in file["grasps"].items()}
    grasp = damage(path, fault, seed=4)
    with GraspDataset(path) as data:
        changed = [name for name in data.ids if not np.array_equal(data[name].raw_counts, before[name])]
    assert changed == [grasp]


def test_equal_seeds_give_equal_worlds_and_some_simulators_are_faulty():
    first, second = (sample_benchmark(40, seed=3) for _ in range(2))
    assert [world.to_json() for world in first] == [world.to_json() for world in second]
    indentations = [world for world in first if world.family == INDENTATIONS]
    assert sum(bool(world.fault) for world in first) == round(0.15 * len(indentations))
    assert {world.family for world in first} == set(FAMILIES)
    assert [world.number for world in first] == list(range(40))
    assert sum(world.family == GRASPS for world in first) == 6


class InOneProcess:
    """Replaces the pool of processes, which would not see changed settings."""

    def __init__(self, *_, **__) -> None: ...

    def __enter__(self):
        return self

    def __exit__(self, *_) -> None: ...

    map = staticmethod(map)


def test_run_scores_every_entry_and_continues_an_interrupted_run(tmp_path, monkeypatch):
    shrink_worlds(monkeypatch)
    calls = []

    def guess(real, sim, seed):
        calls.append(real)
        return {"noise": 0.9}

    monkeypatch.setattr(run, "ProcessPoolExecutor", InOneProcess)
    monkeypatch.setattr(run, "load_entry", lambda name: guess)
    score = run.run_benchmark(tmp_path / "out", 1, 5, ["guess"], [INDENTATIONS])
    assert len(calls) == 1
    assert run.run_benchmark(tmp_path / "out", 1, 5, ["guess"], [INDENTATIONS]) == score
    assert len(calls) == 1
    assert score["guess"]["all"]["worlds"] == 1
    assert json.loads((tmp_path / "out" / "score.json").read_text())["score"] == score
    with pytest.raises(TaxelError, match="another seed"):
        run.run_benchmark(tmp_path / "out", 1, 6, ["guess"], [INDENTATIONS])


def test_unknown_entries_and_wrong_answers_give_one_line():
    with pytest.raises(PluginError, match="--entry: expected one of diagnosis, check list"):
        load_entry("oracle")
    with pytest.raises(PluginError, match="expected names of effects"):
        check_answer({"gremlins": 1.0}, "mine")
    with pytest.raises(PluginError, match="expected a probability"):
        check_answer({"noise": 1.5}, "mine")


def test_least_squares_names_a_clear_cause(simulated):
    """The simulated dataset against itself with a smaller signal: a gain, and nothing else."""
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
