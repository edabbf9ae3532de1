"""`apply_report` adds the effects of a report to a simulated dataset: changed counts, kept fields, shrink."""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from pathlib import Path

import h5py
import numpy as np
import pytest

from taxel.gap.apply.apply import apply_report
from taxel.gap.apply.frames import FrameStates, find_effect_frames
from taxel.gap.apply.grasp_effects import add_effects_to_grasp
from taxel.gap.apply.random_samples import RandomStreams, sample_noise
from taxel.gap.data.pair import read_pair
from taxel.gap.diagnosis import diagnose
from taxel.gap.effects.catalogue import OWN_EFFECTS
from taxel.gap.effects.dropout import Defects, Dropout
from taxel.gap.features.features import FeatureLayout
from taxel.gap.features.metric import measure_gap
from taxel.gap.fitting.composite import FittedEffect
from taxel.gap.fitting.state import build_state
from taxel.gap.report.model import NOISE_COMPONENTS, describe_model
from taxel.gap.report.reading import read_report
from taxel.recording.grasp_dataset import GraspDataset

ROWS, COLUMNS, N, BOARDS = 6, 5, 60, 2
BASELINE_FRAMES = 110
"""Number of baseline frames of each grasp of the worlds in conftest.py."""

FORMS = [(name, form) for name, forms in OWN_EFFECTS.items() for form in forms]
IDS = [f"{name} {form.variant or form.scope} {form.scope}" for name, form in FORMS]
SINGLE_GRASP = RandomStreams(seed=0, condition=0, repeat=0, repeats=1)
"""Random numbers of a grasp without other repeats."""


@dataclass
class Simulation:
    """A simulated dataset with its state, and a writer of reports about it without a diagnosis."""

    folder: Path
    sim: str
    pair: object
    state: object

    def make_effect(self, form, values=None) -> FittedEffect:
        """Return a form of an effect with these parameter values; None: typical values."""
        return FittedEffect(form, form.make_typical_values(self.state) if values is None else values)

    def write_report(self, *effects, status="explained", **changes):
        """Write a report whose verdict names these effects, and return its path. changes: fields of the model of the
        first effect.
        """
        taxels = self.pair.taxels
        models = [describe_model(self.state, effect) for effect in effects]
        if models:
            models[0].update(changes)
        content = {
            "format": "taxel-gap-report",
            "version": 1,
            "inputs": {"sim": {"path": self.sim, "sha256": self.pair.digests[1]}},
            "verdict": {"status": status, "effects": [effect.effect.name for effect in effects]},
            "effects": [
                {"name": effect.effect.name, "model": one} for effect, one in zip(effects, models, strict=True)
            ],
            "taxels": {name: getattr(taxels, name).tolist() for name in ("sensor", "tx", "rx")},
        }
        path = self.folder / "report.json"
        path.write_text(json.dumps(content))
        return path


@pytest.fixture(scope="module")
def shared_simulation(write_world, tmp_path_factory) -> Simulation:
    """A simulated dataset of three grasps, shared by all tests, which must not change it."""
    sim = write_world(tmp_path_factory.mktemp("apply"), conditions=3, sessions=1, repeats=1)[1]
    pair = read_pair(sim, sim)
    layout = FeatureLayout.from_time_grid(pair.time_grid)
    state = build_state(pair, layout, np.zeros((len(pair.conditions), layout.count, pair.n)))
    return Simulation(Path(), sim, pair, state)


@pytest.fixture
def simulation(shared_simulation, tmp_path) -> Simulation:
    return replace(shared_simulation, folder=tmp_path)


def read_contents(path) -> dict[str, np.ndarray]:
    """Return all datasets and attributes of an HDF5 file by name."""
    found = {}

    def keep(name, node):
        found.update({f"{name}.{key}": value for key, value in node.attrs.items()})
        if isinstance(node, h5py.Dataset):
            found[name] = node[()]

    with h5py.File(path) as file:
        file.visititems(keep)
        found.update(file.attrs)
    return found


def add_crosstalk(force, signal_counts):
    """Add 40 % of the mean signal of the other taxels on the same RX line."""
    grid = signal_counts.reshape(-1, BOARDS, ROWS, COLUMNS)
    others = (grid.sum(axis=2, keepdims=True) - grid) / (ROWS - 1)
    return signal_counts + 0.4 * others.reshape(signal_counts.shape)


def delay_first_board(force, signal_counts):
    """Delay the signal of the first board by 4 frames."""
    late = signal_counts.copy()
    late[4:, : N // 2] = signal_counts[:-4, : N // 2]
    return late


def add_noise(raw, valid, rng):
    return np.rint(raw + rng.normal(0.0, 60.0, raw.shape)), valid


WORLDS = {
    "electrode_crosstalk": {"effect": add_crosstalk},
    "latency": {"effect": delay_first_board},
    "noise": {"raw_effect": add_noise},
}
OTHERS = set(OWN_EFFECTS) - set(WORLDS)


@pytest.mark.parametrize(
    "name", [name if name == "latency" else pytest.param(name, marks=pytest.mark.slow) for name in WORLDS]
)
def test_applied_effects_shrink_the_gap_as_predicted_and_are_not_found_again(write_world, tmp_path, name):
    real, sim = write_world(tmp_path, conditions=5, sessions=4, **WORLDS[name])
    found = diagnose(real, sim, without=OTHERS)
    report, out = tmp_path / "report.json", tmp_path / "sim2.h5"
    report.write_text(json.dumps(found.report, allow_nan=False))
    assert apply_report(report, sim, out).effects == (name,)
    again = diagnose(real, out, without=OTHERS).report
    before, after = found.report["gap"]["value"], again["gap"]["value"]
    predicted = measure_gap(found.real, found.explanation.features, found.layout).gap.value
    assert after == pytest.approx(predicted, abs=0.05 * before)
    assert 1.0 - after / before > found.report["after"]["predicted_shrink"] - 0.05
    assert name not in again["verdict"]["effects"]


@pytest.mark.parametrize(("name", "form"), FORMS, ids=IDS)
def test_an_effect_read_from_a_report_changes_counts_only_from_closing_on(simulation, name, form):
    values = form.make_typical_values(simulation.state)
    if name == "baseline_drift":
        values *= 30.0  # less than half a count is rounded away
    (one,) = read_report(simulation.write_report(FittedEffect(form, values))).effects
    assert (type(one.effect), one.effect.variant, one.effect.scope) == (type(form), form.variant, form.scope)
    if name != "noise":
        np.testing.assert_array_equal(one.values, values)
    changed = False
    with GraspDataset(simulation.sim) as data:
        states = FrameStates(data)
        for grasp in data:
            raw, valid = add_effects_to_grasp(states.build_state(grasp), grasp, [one], SINGLE_GRASP)
            assert valid is grasp.valid
            changed |= (raw != grasp.raw_counts).any()
            if name != "noise":  # noise is added to all frames, also to those of the baseline
                np.testing.assert_array_equal(raw[:BASELINE_FRAMES], grasp.raw_counts[:BASELINE_FRAMES])
    assert changed


@pytest.mark.parametrize(("name", "form"), FORMS, ids=IDS)
def test_neutral_parameter_values_return_the_input_bit_identically(simulation, name, form):
    (one,) = read_report(
        simulation.write_report(FittedEffect(form, form.make_neutral_values(simulation.state)))
    ).effects
    with GraspDataset(simulation.sim) as data:
        states = FrameStates(data)
        for grasp in data:
            raw, valid = add_effects_to_grasp(states.build_state(grasp), grasp, [one], SINGLE_GRASP)
            assert raw is grasp.raw_counts
            assert valid is grasp.valid


def test_frames_are_evaluated_at_their_measured_times(simulation):
    with GraspDataset(simulation.sim) as data:
        grasp = data["0000"]
        state = FrameStates(data).build_state(grasp)
        time = grasp.timestamp[find_effect_frames(grasp)]
    np.testing.assert_allclose(np.diff(state.node_times_s), np.diff(time))
    assert state.node_times_s[0] == pytest.approx(0.025)  # the middle of a frame at 20 Hz
    assert state.base.force.shape == (1, len(time), N)


def test_only_counts_change_and_the_file_names_the_added_effects(simulation):
    sim, out = simulation.folder / "sim.h5", simulation.folder / "sim2.h5"
    sim.write_bytes(Path(simulation.sim).read_bytes())
    with h5py.File(sim, "r+") as file:
        file.attrs["mine"] = "kept"
        file["grasps/0001/raw_counts"].attrs["unit"] = "counts"
    report = simulation.write_report(simulation.make_effect(OWN_EFFECTS["saturation"][0], np.full((1, 1), 300.0)))
    apply_report(report, sim, out)
    before, after = read_contents(sim), read_contents(out)
    note = json.loads(after.pop("gap_applied"))
    assert before.keys() == after.keys()
    different = {name for name in before if not np.array_equal(before[name], after[name])}
    assert different
    assert all(name.endswith("raw_counts") for name in different)
    assert note["report"]["sha256"] == read_report(report).sha256
    assert note["effects"] == [{"name": "saturation", "form": "clip", "scope": "hand", "parameters": {"counts": 300.0}}]


def test_effects_added_to_a_changed_dataset_are_named_in_a_second_attribute_and_a_note(simulation):
    report = simulation.write_report(simulation.make_effect(OWN_EFFECTS["saturation"][0], np.full((1, 1), 300.0)))
    first, second = simulation.folder / "sim2.h5", simulation.folder / "sim3.h5"
    assert apply_report(report, simulation.sim, first).notes == ()
    assert apply_report(report, first, second).notes == ("the report was made from another simulated dataset",)
    assert {"gap_applied", "gap_applied_2"} <= read_contents(second).keys()


def test_count_arrays_that_are_shared_or_too_narrow_are_replaced(simulation):
    sim, out = simulation.folder / "sim.h5", simulation.folder / "sim2.h5"
    sim.write_bytes(Path(simulation.sim).read_bytes())
    with h5py.File(sim, "r+") as file:
        grasps = file["grasps"]
        narrow = grasps["0000/raw_counts"][()].astype(np.int16)
        del grasps["0000/raw_counts"], grasps["0003/raw_counts"]
        grasps["0000/raw_counts"] = narrow
        grasps["0003/raw_counts"] = grasps["0002/raw_counts"]
    apply_report(simulation.write_report(simulation.make_effect(OWN_EFFECTS["proximity"][0])), sim, out)
    with GraspDataset(out) as after, GraspDataset(sim) as before:
        after.check()
        for grasp in before:
            counts = after[grasp.id].raw_counts
            np.testing.assert_array_equal(counts[:BASELINE_FRAMES], grasp.raw_counts[:BASELINE_FRAMES])
            assert (counts != grasp.raw_counts).any()


def test_the_seed_determines_the_noise_and_the_report_its_standard_deviation(simulation):
    report = simulation.write_report(
        simulation.make_effect(OWN_EFFECTS["noise"][0]), parameters=make_noise_parameters(20.0, 0.0, 0.0, 0.0)
    )
    found = []
    for number, seed in enumerate((0, 0, 1)):
        out = simulation.folder / f"{number}.h5"
        apply_report(report, simulation.sim, out, seed=seed)
        found.append(read_contents(out)["grasps/0000/raw_counts"].astype(float))
    np.testing.assert_array_equal(found[0], found[1])
    assert (found[0] != found[2]).any()
    added = found[0] - read_contents(simulation.sim)["grasps/0000/raw_counts"]
    assert added.std() == pytest.approx(20.0, rel=0.03)


def make_noise_parameters(*counts):
    """Return the reported parameters of noise: standard deviations of its four components, in the order of
    `NOISE_COMPONENTS`.
    """
    return {name: {"unit": "counts", "values": [one]} for name, one in zip(NOISE_COMPONENTS, counts, strict=True)}


def test_noise_is_common_to_the_lines_named_in_the_report(simulation):
    components = np.repeat([[3.0], [4.0], [0.0], [5.0]], N, axis=1)  # white, of TX lines, of RX lines, of boards
    samples = sample_noise(components, simulation.pair.groups, 20_000, SINGLE_GRASP)
    covariance = np.cov(samples[:, [0, 1, COLUMNS, N - 1]].T)  # on one TX line, on one RX line, on the other board
    # A variance is 9 + 16 + 25. Taxels on one TX line share 16 + 25, other taxels of one board share 25.
    expected = [[50.0, 41.0, 25.0, 0.0], [41.0, 50.0, 25.0, 0.0], [25.0, 25.0, 50.0, 0.0], [0.0, 0.0, 0.0, 50.0]]
    np.testing.assert_allclose(covariance, expected, atol=2.0)


@pytest.mark.parametrize("repeats", [1, 2, 3, 5])
def test_samples_are_balanced_among_repeats_and_reproducible(repeats):
    """Balanced: the samples of all repeats add up to 0. The samples of each repeat keep the standard deviation 1."""
    streams = [RandomStreams(7, 0, repeat, repeats) for repeat in range(repeats)]
    samples = np.array([one.sample_balanced(lambda rng: rng.normal(size=4000), 1) for one in streams])
    np.testing.assert_allclose(samples.std(axis=1), 1.0, rtol=0.05)
    if repeats > 1:
        np.testing.assert_allclose(samples.sum(axis=0), 0.0, atol=1e-9)


def test_lost_frames_repeat_the_last_counts_stuck_taxels_are_constant_and_other_counts_are_kept(simulation):
    stuck = np.arange(N) == 7
    first_board_lost, second_board_lost = 0.25, 1.0  # share of the frames
    missing = np.array([first_board_lost, second_board_lost])
    defects = Defects(single_taxels=stuck, lines=(), missing=missing, dead=stuck, stuck=stuck)
    effect = Dropout(defects)
    out = simulation.folder / "sim2.h5"
    apply_report(
        simulation.write_report(FittedEffect(effect, effect.make_detected_values(simulation.state))),
        simulation.sim,
        out,
    )
    with GraspDataset(out) as data, GraspDataset(simulation.sim) as before:
        data.check()
        data.require_baseline(10)
        for grasp in data:
            arrived, first_board = grasp.valid[:, 0], slice(0, N // 2)
            assert (1.0 - arrived.mean()) == pytest.approx(first_board_lost, abs=0.01)
            assert not grasp.valid[:, 1].any()
            assert not grasp.raw_counts[:, N // 2 :].any()  # no frame of the second board has ever arrived
            lost = np.flatnonzero(~arrived[1:]) + 1
            np.testing.assert_array_equal(grasp.raw_counts[lost, first_board], grasp.raw_counts[lost - 1, first_board])
            assert len(np.unique(grasp.raw_counts[arrived][:, stuck])) == 1
            unchanged = np.ix_(arrived, np.flatnonzero(~stuck[first_board]))
            np.testing.assert_array_equal(grasp.raw_counts[unchanged], before[grasp.id].raw_counts[unchanged])


@pytest.mark.parametrize(("status", "words"), [("no_gap", "no gap"), ("unknown", "unknown")])
def test_without_an_identified_cause_the_dataset_is_copied_with_a_note(simulation, status, words):
    out = simulation.folder / "sim2.h5"
    done = apply_report(simulation.write_report(status=status), simulation.sim, out)
    assert done.effects == ()
    assert words in done.notes[0]
    assert out.read_bytes() == Path(simulation.sim).read_bytes()


def test_an_object_without_reported_parameters_is_unchanged_and_named(simulation):
    form = next(form for form in OWN_EFFECTS["pose_error"] if form.scope == "object")
    values = np.zeros((len(form.parameters()), 1))
    values[0] = 2.0
    parameters = {
        one.name: {"unit": one.unit, "values": row.tolist()} for one, row in zip(form.parameters(), values, strict=True)
    }
    report = simulation.write_report(simulation.make_effect(form), blocks=["cube"], parameters=parameters)
    done = apply_report(report, simulation.sim, simulation.folder / "sim2.h5")
    assert any("block" in note for note in done.notes)
    with GraspDataset(simulation.sim) as before, GraspDataset(simulation.folder / "sim2.h5") as after:
        changed = {grasp.object: not np.array_equal(grasp.raw_counts, after[grasp.id].raw_counts) for grasp in before}
    assert changed == {"cube": True, "block": False}
