"""A report's effects added to the simulator's dataset: what comes, what stays, and how far the gap shrinks."""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from pathlib import Path

import h5py
import numpy as np
import pytest

from taxel.gap.apply.added import with_effects
from taxel.gap.apply.apply import apply_report
from taxel.gap.apply.draws import Chance, noise
from taxel.gap.apply.frames import FrameStates, moving
from taxel.gap.data.pair import read_pair
from taxel.gap.diagnosis import diagnose
from taxel.gap.effects.catalogue import OWN_EFFECTS
from taxel.gap.effects.dropout import Dropout, Dropped
from taxel.gap.features.features import Layout
from taxel.gap.features.metric import measure
from taxel.gap.fitting.composite import FittedEffect
from taxel.gap.fitting.state import state_of
from taxel.gap.report.model import NOISE_PARTS, model_of
from taxel.gap.report.reading import read_report
from taxel.recording.grasp_dataset import GraspDataset

ROWS, COLUMNS, N, BOARDS = 6, 5, 60, 2
FORMS = [(name, form) for name, forms in OWN_EFFECTS.items() for form in forms]
IDS = [f"{name} {form.variant or form.scope} {form.scope}" for name, form in FORMS]
EXACT = Chance(0, 0, 0, 1)


@dataclass
class Made:
    """A simulation, and reports that are made for it without a diagnosis."""

    folder: Path
    sim: str
    pair: object
    state: object

    def link(self, form, values=None) -> FittedEffect:
        return FittedEffect(form, form.typical(self.state) if values is None else values)

    def report(self, *links, status="explained", **changes):
        """Path of a report whose verdict names these effects. changes: of the first one's model."""
        taxels = self.pair.taxels
        models = [model_of(self.state, link) for link in links]
        if models:
            models[0].update(changes)
        content = {
            "format": "taxel-gap-report",
            "version": 1,
            "inputs": {"sim": {"path": self.sim, "sha256": self.pair.digests[1]}},
            "verdict": {"status": status, "effects": [link.effect.name for link in links]},
            "effects": [{"name": link.effect.name, "model": one} for link, one in zip(links, models, strict=True)],
            "taxels": {name: getattr(taxels, name).tolist() for name in ("sensor", "tx", "rx")},
        }
        path = self.folder / "report.json"
        path.write_text(json.dumps(content))
        return path


@pytest.fixture(scope="module")
def simulated(world, tmp_path_factory) -> Made:
    sim = world(tmp_path_factory.mktemp("apply"), conditions=3, sessions=1, repeats=1)[1]
    pair = read_pair(sim, sim)
    layout = Layout.of(pair.clock)
    state = state_of(pair, layout, np.zeros((len(pair.conditions), layout.count, pair.n)))
    return Made(Path(), sim, pair, state)


@pytest.fixture
def made(simulated, tmp_path) -> Made:
    return replace(simulated, folder=tmp_path)


def arrays(path) -> dict[str, np.ndarray]:
    """Everything in a file."""
    found = {}

    def keep(name, node):
        found.update({f"{name}.{key}": value for key, value in node.attrs.items()})
        if isinstance(node, h5py.Dataset):
            found[name] = node[()]

    with h5py.File(path) as file:
        file.visititems(keep)
        found.update(file.attrs)
    return found


def crosstalk(force, signal_counts):
    grid = signal_counts.reshape(-1, BOARDS, ROWS, COLUMNS)
    others = (grid.sum(axis=2, keepdims=True) - grid) / (ROWS - 1)
    return signal_counts + 0.4 * others.reshape(signal_counts.shape)


def board_late(force, signal_counts):
    late = signal_counts.copy()
    late[4:, : N // 2] = signal_counts[:-4, : N // 2]
    return late


def noisy(raw, valid, rng):
    return np.rint(raw + rng.normal(0.0, 60.0, raw.shape)), valid


WORLDS = {
    "electrode_crosstalk": {"effect": crosstalk},
    "latency": {"effect": board_late},
    "noise": {"after": noisy},
}
OTHERS = set(OWN_EFFECTS) - set(WORLDS)


@pytest.mark.parametrize(
    "name", [name if name == "latency" else pytest.param(name, marks=pytest.mark.slow) for name in WORLDS]
)
def test_applied_effects_shrink_the_gap_as_predicted_and_are_not_found_again(world, tmp_path, name):
    real, sim = world(tmp_path, conditions=5, sessions=4, **WORLDS[name])
    found = diagnose(real, sim, without=OTHERS)
    report, out = tmp_path / "report.json", tmp_path / "sim2.h5"
    report.write_text(json.dumps(found.report, allow_nan=False))
    assert apply_report(report, sim, out).effects == (name,)
    again = diagnose(real, out, without=OTHERS).report
    before, after = found.report["gap"]["value"], again["gap"]["value"]
    promised = measure(found.real, found.explanation.features, found.layout).gap.value
    assert after == pytest.approx(promised, abs=0.05 * before)
    assert 1.0 - after / before > found.report["after"]["predicted_shrink"] - 0.05
    assert name not in again["verdict"]["effects"]


@pytest.mark.parametrize(("name", "form"), FORMS, ids=IDS)
def test_an_effect_read_from_a_report_changes_counts_only_from_closing_on(made, name, form):
    values = form.typical(made.state)
    if name == "baseline_drift":
        values *= 30.0  # less than half a count is rounded away
    (one,) = read_report(made.report(FittedEffect(form, values))).effects
    assert (type(one.effect), one.effect.variant, one.effect.scope) == (type(form), form.variant, form.scope)
    if name != "noise":
        np.testing.assert_array_equal(one.values, values)
    changed = False
    with GraspDataset(made.sim) as data:
        states = FrameStates(data)
        for grasp in data:
            raw, valid = with_effects(states.of(grasp), grasp, [one], EXACT)
            assert valid is grasp.valid
            changed |= (raw != grasp.raw_counts).any()
            if name != "noise":
                np.testing.assert_array_equal(raw[:110], grasp.raw_counts[:110])
    assert changed


@pytest.mark.parametrize(("name", "form"), FORMS, ids=IDS)
def test_neutral_parameter_values_return_the_input_bit_identically(made, name, form):
    (one,) = read_report(made.report(FittedEffect(form, form.neutral(made.state)))).effects
    with GraspDataset(made.sim) as data:
        states = FrameStates(data)
        for grasp in data:
            raw, valid = with_effects(states.of(grasp), grasp, [one], EXACT)
            assert raw is grasp.raw_counts
            assert valid is grasp.valid


def test_frames_are_evaluated_at_their_measured_times(made):
    with GraspDataset(made.sim) as data:
        grasp = data["0000"]
        state = FrameStates(data).of(grasp)
        time = grasp.timestamp[moving(grasp)]
    np.testing.assert_allclose(np.diff(state.since), np.diff(time))
    assert state.since[0] == pytest.approx(0.025)  # the middle of a frame at 20 Hz
    assert state.base.force.shape == (1, len(time), N)


def test_only_counts_change_and_the_file_names_the_added_effects(made):
    sim, out = made.folder / "sim.h5", made.folder / "sim2.h5"
    sim.write_bytes(Path(made.sim).read_bytes())
    with h5py.File(sim, "r+") as file:
        file.attrs["mine"] = "kept"
        file["grasps/0001/raw_counts"].attrs["unit"] = "counts"
    report = made.report(made.link(OWN_EFFECTS["saturation"][0], np.full((1, 1), 300.0)))
    done = apply_report(report, sim, out)
    assert done.notes == ("the report was made from another simulated dataset",)
    before, after = arrays(sim), arrays(out)
    note = json.loads(after.pop("gap_applied"))
    assert before.keys() == after.keys()
    different = {name for name in before if not np.array_equal(before[name], after[name])}
    assert different
    assert all(name.endswith("raw_counts") for name in different)
    assert note["report"]["sha256"] == read_report(report).sha256
    assert note["effects"] == [{"name": "saturation", "form": "clip", "scope": "hand", "parameters": {"counts": 300.0}}]
    apply_report(report, out, made.folder / "sim3.h5")
    assert {"gap_applied", "gap_applied_2"} <= arrays(made.folder / "sim3.h5").keys()


def test_shared_or_narrow_count_datasets_are_replaced(made):
    sim, out = made.folder / "sim.h5", made.folder / "sim2.h5"
    sim.write_bytes(Path(made.sim).read_bytes())
    with h5py.File(sim, "r+") as file:
        grasps = file["grasps"]
        narrow = grasps["0000/raw_counts"][()].astype(np.int16)
        del grasps["0000/raw_counts"], grasps["0003/raw_counts"]
        grasps["0000/raw_counts"] = narrow
        grasps["0003/raw_counts"] = grasps["0002/raw_counts"]
    apply_report(made.report(made.link(OWN_EFFECTS["proximity"][0])), sim, out)
    with GraspDataset(out) as after, GraspDataset(sim) as before:
        after.check()
        for grasp in before:
            own = after[grasp.id].raw_counts
            np.testing.assert_array_equal(own[:110], grasp.raw_counts[:110])
            assert (own != grasp.raw_counts).any()


def test_the_seed_determines_the_noise(made):
    report = made.report(made.link(OWN_EFFECTS["noise"][0]), parameters=noise_of(20.0, 0.0, 0.0, 0.0))
    found = []
    for number, seed in enumerate((0, 0, 1)):
        out = made.folder / f"{number}.h5"
        apply_report(report, made.sim, out, seed=seed)
        found.append(arrays(out)["grasps/0000/raw_counts"].astype(float))
    np.testing.assert_array_equal(found[0], found[1])
    assert (found[0] != found[2]).any()
    added = found[0] - arrays(made.sim)["grasps/0000/raw_counts"]
    assert added.std() == pytest.approx(20.0, rel=0.03)


def noise_of(*counts):
    return {name: {"unit": "counts", "values": [one]} for name, one in zip(NOISE_PARTS, counts, strict=True)}


def test_noise_is_common_to_the_lines_named_in_the_report(made):
    parts = np.repeat([[3.0], [4.0], [0.0], [5.0]], N, axis=1)
    drawn = noise(parts, made.pair.groups, 20_000, EXACT)
    covariance = np.cov(drawn[:, [0, 1, COLUMNS, N - 1]].T)  # on one TX line, on one RX line, on the other board
    expected = [[50.0, 41.0, 25.0, 0.0], [41.0, 50.0, 25.0, 0.0], [25.0, 25.0, 50.0, 0.0], [0.0, 0.0, 0.0, 50.0]]
    np.testing.assert_allclose(covariance, expected, atol=2.0)


@pytest.mark.parametrize("repeats", [1, 2, 3, 5])
def test_samples_are_balanced_among_repeats_and_reproducible(repeats):
    chances = [Chance(7, 0, repeat, repeats) for repeat in range(repeats)]
    drawn = np.array([one.balanced(lambda rng: rng.normal(size=4000), 1) for one in chances])
    np.testing.assert_allclose(drawn.std(axis=1), 1.0, rtol=0.05)
    if repeats > 1:
        np.testing.assert_allclose(drawn.sum(axis=0), 0.0, atol=1e-9)


def test_lost_frames_repeat_the_last_count_and_stuck_taxels_are_constant(made):
    stuck = np.arange(N) == 7
    dropped = Dropped(stuck, (), np.array([0.25, 1.0]), stuck, stuck)
    effect = Dropout(dropped)
    out = made.folder / "sim2.h5"
    apply_report(made.report(FittedEffect(effect, effect.found_values(made.state))), made.sim, out)
    with GraspDataset(out) as data, GraspDataset(made.sim) as before:
        data.check()
        data.require_baseline(10)
        for grasp in data:
            assert (1.0 - grasp.valid[:, 0].mean()) == pytest.approx(0.25, abs=0.01)
            assert not grasp.valid[:, 1].any()
            assert not grasp.raw_counts[:, N // 2 :].any()
            lost = np.flatnonzero(~grasp.valid[1:, 0]) + 1
            own = slice(0, N // 2)
            np.testing.assert_array_equal(grasp.raw_counts[lost, own], grasp.raw_counts[lost - 1, own])
            assert len(np.unique(grasp.raw_counts[grasp.valid[:, 0], 7])) == 1
            arrived, alive = grasp.valid[:, 0], np.flatnonzero(~stuck[own])
            there = np.ix_(arrived, alive)
            np.testing.assert_array_equal(grasp.raw_counts[there], before[grasp.id].raw_counts[there])


@pytest.mark.parametrize(("status", "words"), [("no_gap", "no gap"), ("unknown", "unknown")])
def test_without_an_identified_cause_the_dataset_is_copied_with_a_note(made, status, words):
    out = made.folder / "sim2.h5"
    done = apply_report(made.report(status=status), made.sim, out)
    assert done.effects == ()
    assert words in done.notes[0]
    assert out.read_bytes() == Path(made.sim).read_bytes()


def test_an_object_without_reported_parameters_is_unchanged_and_named(made):
    form = next(form for form in OWN_EFFECTS["pose_error"] if form.scope == "object")
    values = np.zeros((len(form.parameters()), 1))
    values[0] = 2.0
    parameters = {
        one.name: {"unit": one.unit, "values": row.tolist()} for one, row in zip(form.parameters(), values, strict=True)
    }
    report = made.report(made.link(form), blocks=["cube"], parameters=parameters)
    done = apply_report(report, made.sim, made.folder / "sim2.h5")
    assert any("block" in note for note in done.notes)
    with GraspDataset(made.sim) as before, GraspDataset(made.folder / "sim2.h5") as after:
        changed = {grasp.object: not np.array_equal(grasp.raw_counts, after[grasp.id].raw_counts) for grasp in before}
    assert changed == {"cube": True, "block": False}
