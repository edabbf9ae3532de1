"""`taxel gap export`: the exported module reproduces the diagnosed effects, and the snippets contain their numbers."""

from __future__ import annotations

import ast
import importlib.util
import json
import shlex
import sys
from dataclasses import dataclass, replace
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import pytest

from host.tests.command_line import run_refused_command, run_taxel
from taxel.gap.apply.frames import FrameStates
from taxel.gap.apply.grasp_effects import add_effects_to_grasp
from taxel.gap.apply.random_samples import RandomStreams
from taxel.gap.apply.rewriting import DatasetEditor, copy_file
from taxel.gap.comparison.density import BlockDensity
from taxel.gap.comparison.settings import DEFAULT_SETTINGS
from taxel.gap.data.pair import read_pair
from taxel.gap.diagnosis import diagnose
from taxel.gap.effects.catalogue import OWN_EFFECTS
from taxel.gap.effects.dropout import Defects, Dropout, Short
from taxel.gap.effects.geometry import ContactGeometry
from taxel.gap.errors import GapInputError
from taxel.gap.export.export import FORMATS, export_report
from taxel.gap.export.genesis_options import OPTIONS
from taxel.gap.export.skin_steps import STEPS, Frame
from taxel.gap.features.features import FeatureLayout
from taxel.gap.fitting.composite import FittedEffect
from taxel.gap.fitting.state import build_state
from taxel.gap.page.action import recommend_action
from taxel.gap.report.checked_report import CheckedReport
from taxel.gap.report.model import NOISE_COMPONENTS, describe_model
from taxel.gap.report.reading import read_report
from taxel.recording.grasp_dataset import GraspDataset
from taxel.recording.grasp_format import Phase

ROWS, COLUMNS, N = 6, 5, 60
BOARD = slice(0, N // 2)
FRAME_S = 0.05
MODEL = {"full": 2000.0, "half": 1.5}
"""Counts and newtons of the sensor model of the worlds in conftest.py."""


def scale_boards(force, signal):
    return signal * np.where(np.arange(N) < N // 2, 1.4, 0.8)


def add_crosstalk(force, signal):
    """Add 40 % of the mean signal of the other taxels on the same RX line."""
    grid = signal.reshape(-1, 2, ROWS, COLUMNS)
    others = (grid.sum(axis=2, keepdims=True) - grid) / (ROWS - 1)
    return signal + 0.4 * others.reshape(signal.shape)


def clip_signal(force, signal):
    return np.minimum(signal, 700.0)


def add_hysteresis(force, signal):
    """Delay 30 % of the closed gap of a plate capacitor with a time constant of 1.2 s."""
    x, half_counts = FRAME_S / 1.2, 0.25 * MODEL["full"]
    closed = signal / (half_counts + signal)
    late, before, result = np.zeros(N), np.zeros(N), closed.copy()
    for frame, now in enumerate(closed):
        late = now + (now - before) * np.expm1(-x) / x + (late - before) * np.exp(-x)
        result[frame], before = 0.7 * now + 0.3 * late, now
    return half_counts * result / (1.0 - result)


def delay_first_board(force, signal):
    """Delay the signal of the first board by 4 frames."""
    late = signal.copy()
    late[4:, BOARD] = signal[:-4, BOARD]
    return late


def add_drift(force, signal):
    """Increase the signal of all taxels by 12 counts per second from the first frame on."""
    return signal + 12.0 * FRAME_S * np.arange(len(signal))[:, None]


def kill_line(raw, valid, rng):
    """Give the taxels of the line TX 2 of the first board the signal 0, with noise."""
    raw = raw.copy()
    raw[:, 10:15] = 30_000.0 + rng.normal(0.0, 4.0, (len(raw), 5))
    return raw, valid


def add_noise(raw, valid, rng):
    return raw + rng.normal(0.0, 30.0, raw.shape), valid


WORLDS = {
    "gain_mismatch": {"effect": scale_boards},
    "electrode_crosstalk": {"effect": add_crosstalk},
    "saturation": {"effect": clip_signal},
    "hysteresis": {"effect": add_hysteresis},
    "latency": {"effect": delay_first_board},
    "baseline_drift": {"effect": add_drift},
    "dropout": {"raw_effect": kill_line},
    "noise": {"raw_effect": add_noise},
}
PARTLY = ("hysteresis",)
"""Worlds with a remaining gap, because the alignment in time absorbs a part of the hysteresis."""


@dataclass(frozen=True)
class Case:
    """A world with one effect: paths of both datasets and of the report, and the report."""

    real: str
    sim: str
    path: Path
    report: dict


def list_other_effects(name: str) -> set[str]:
    """Return the effects that the diagnosis of a world excludes, which makes the diagnosis faster."""
    return set(OWN_EFFECTS) - {name}


@pytest.fixture(scope="module")
def get_case(write_world, tmp_path_factory):
    """Function `get_case(name)` that diagnoses the world of an effect once, without all other effects."""
    cases: dict[str, Case] = {}

    def get(name: str) -> Case:
        if name not in cases:
            folder = tmp_path_factory.mktemp(name)
            real, sim = write_world(folder, conditions=5, sessions=4, **WORLDS[name])
            report = diagnose(real, sim, without=list_other_effects(name)).report
            path = folder / "report.json"
            path.write_text(json.dumps(report, allow_nan=False))
            cases[name] = Case(real, sim, path, report)
        return cases[name]

    return get


def load_module(path: Path) -> ModuleType:
    """Import an exported Python file and return its module."""
    spec = importlib.util.spec_from_file_location(f"exported_{path.stem}", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def apply_module(effects, grasp, seed: int, force: bool = True) -> np.ndarray:
    """Return the counts f64[T, n] (T frames, n taxels) of a grasp after the exported module has added its effects.

    force: whether the module gets the contact forces of the grasp.
    """
    start_s = float(grasp.timestamp[grasp.phase != Phase.BASELINE][0])
    newtons = grasp.contact_force if force else None
    return effects.apply_recording(grasp.timestamp, grasp.raw_counts, newtons, grasp.separation, seed, start_s)


def rewrite_dataset(module: ModuleType, sim: str, out: Path) -> None:
    """Write the simulated dataset with the counts of the exported module."""
    copy_file(sim, out)
    effects = module.SkinEffects()
    with GraspDataset(sim) as data, DatasetEditor(out) as copy:
        for seed, name in enumerate(data.ids):
            copy.replace_array(name, "raw_counts", apply_module(effects, data[name], seed).astype(np.uint16))
            copy.replace_array(name, "valid", effects.valid_frames)


def test_the_three_lines_of_the_page_change_the_counts_of_a_simulator(get_case, tmp_path, monkeypatch):
    """The diagnosed saturation limits the signal to 700 counts."""
    case = get_case("saturation")
    action = recommend_action(CheckedReport(case.report), str(case.path))
    monkeypatch.chdir(tmp_path)
    assert run_taxel(*shlex.split(action.command)[1:]) == 0
    monkeypatch.syspath_prepend(tmp_path)
    with GraspDataset(case.sim) as data:
        grasp = max(data, key=lambda one: int(one.raw_counts[0].max()) - int(one.raw_counts.min()))
        frames = list(zip(grasp.timestamp, grasp.raw_counts, grasp.contact_force, strict=True))
    *import_lines, frame_line = action.lines
    names: dict[str, Any] = {}
    exec("\n".join(import_lines), names)
    signals = []
    for time_s, counts, force in frames:
        names |= {"time_s": time_s, "counts": counts, "force": force}
        exec(frame_line, names)
        signals.append(30_000.0 - names["counts"])
    unchanged = max(30_000.0 - float(counts.min()) for _, counts, _ in frames)
    assert 650.0 < np.max(signals) < 750.0 < unchanged


@pytest.mark.parametrize("name", sorted(set(WORLDS) - set(PARTLY)))
def test_counts_of_the_exported_module_have_no_gap_above_the_floor(get_case, tmp_path, name):
    case = get_case(name)
    assert case.report["verdict"]["effects"] == [name]
    out, module = tmp_path / "sim2.h5", tmp_path / "skin.py"
    assert export_report(case.path, "python", module).effects == (name,)
    rewrite_dataset(load_module(module), case.sim, out)
    again = diagnose(case.real, out, without=list_other_effects(name))
    gap = again.report["gap"]
    # The module adds random drift and noise, so the simulated mean varies, too; `varied2` is the squared gap that this
    # variation alone causes. A gap of at most 1.2 times the root of floor^2 + varied2 counts as a gap at the floor.
    varied2 = BlockDensity(again.fit_data, DEFAULT_SETTINGS).compute_simulated_floor2()
    is_at_floor = gap["value"] ** 2 <= 1.2**2 * (gap["floor"] ** 2 + varied2)
    assert again.report["verdict"]["status"] == "no_gap" or is_at_floor


@pytest.mark.parametrize("name", PARTLY)
def test_counts_of_the_exported_module_have_only_the_unexplained_gap(get_case, tmp_path, name):
    """The gap with the counts of the module is at most 10 % larger than the held-out gap with the reported effects."""
    case = get_case(name)
    assert case.report["verdict"]["effects"][0] == name
    out, module = tmp_path / "sim2.h5", tmp_path / "skin.py"
    assert export_report(case.path, "python", module).effects == (name,)
    rewrite_dataset(load_module(module), case.sim, out)
    again = diagnose(case.real, out, without=set(OWN_EFFECTS) - {name}).report
    assert again["gap"]["value"] <= 1.1 * case.report["after"]["value"]


def test_an_unknown_cause_of_the_verdict_is_not_exported_but_noted(get_case, tmp_path):
    report = json.loads(get_case("saturation").path.read_text())
    report["verdict"] |= {"status": "partly_explained", "effects": ["saturation", "unknown"]}
    path = tmp_path / "report.json"
    path.write_text(json.dumps(report))
    done = export_report(path, "python", tmp_path / "skin.py", sim=get_case("saturation").sim)
    assert done.effects == ("saturation",)
    assert "unknown cause" in done.notes[0]


@dataclass(frozen=True)
class Simulation:
    """A simulated dataset with its state, and a writer of reports about it without a diagnosis."""

    sim: str
    pair: object
    state: object

    def write_report(self, folder: Path, form, values, status: str = "explained", **changes) -> Path:
        """Write a report whose verdict names one effect, and return its path. changes: fields of the model of this
        effect.
        """
        effect = FittedEffect(form, values)
        content = {
            "format": "taxel-gap-report",
            "version": 1,
            "inputs": {"sim": {"path": self.sim, "sha256": self.pair.digests[1]}},
            "verdict": {"status": status, "effects": [form.name]},
            "effects": [{"name": form.name, "model": {**describe_model(self.state, effect), **changes}}],
            "taxels": {name: getattr(self.pair.taxels, name).tolist() for name in ("sensor", "tx", "rx")},
        }
        path = folder / "report.json"
        path.write_text(json.dumps(content))
        return path


@pytest.fixture(scope="module")
def simulation(write_world, tmp_path_factory) -> Simulation:
    """A simulated dataset of three grasps, shared by all tests, which must not change it."""
    sim = write_world(tmp_path_factory.mktemp("export"), conditions=3, sessions=1, repeats=1)[1]
    pair = read_pair(sim, sim)
    layout = FeatureLayout.from_time_grid(pair.time_grid)
    return Simulation(sim, pair, build_state(pair, layout, np.zeros((len(pair.conditions), layout.count, pair.n))))


FORMS = [form for forms in OWN_EFFECTS.values() for form in forms if form.name not in ("noise", "pose_error")]
FORMS = [form for form in FORMS if form.variant != "sinking"]
IDS = [f"{form.name} {form.variant or form.scope} {form.scope}" for form in FORMS]
TOLERANCE_COUNTS = {"pillars": 10.0, "depth": 10.0}
"""Largest permitted difference of a form that the simulator's grasps influence, counts; 2 for all other forms."""


@pytest.mark.parametrize("form", FORMS, ids=IDS)
def test_exported_module_agrees_with_gap_apply(simulation, tmp_path, monkeypatch, form):
    """The module and `taxel gap apply` add the same effect to the same grasps; the largest change exceeds 10 counts."""
    # The exported file has no meshes: the comparison uses an even load on each taxel.
    monkeypatch.setattr(ContactGeometry, "piece_shares", property(lambda self: {}))
    values = form.make_typical_values(simulation.state)
    if form.name == "baseline_drift":
        values = np.array([[40.0, 30.0], [0.0, 0.0]])[:, : values.shape[1]]
    path = simulation.write_report(tmp_path, form, values)
    export_report(path, "python", tmp_path / "skin.py")
    effects = load_module(tmp_path / "skin.py").SkinEffects()
    reported, change = read_report(path).effects, 0.0
    with GraspDataset(simulation.sim) as data:
        states = FrameStates(data)
        for grasp in data:
            expected = add_effects_to_grasp(states.build_state(grasp), grasp, reported, RandomStreams(0, 0, 0, 1))[
                0
            ].astype(float)
            change = max(change, np.abs(expected - grasp.raw_counts).max())
            found = apply_module(effects, grasp, 0)
            assert np.abs(found - expected).max() <= TOLERANCE_COUNTS.get(form.variant, 2.0)
    assert change > 10.0


def find_form(name: str, variant: str, scope: str = "hand"):
    return next(one for one in OWN_EFFECTS[name] if (one.variant, one.scope) == (variant, scope))


@pytest.mark.parametrize(
    ("kind", "expected"),
    [("clip", [-300.0, -100.0, 300.0]), ("soft", [-200.0, -75.0, 200.0]), ("smooth", [-200.0, -75.0, 200.0])],
)
def test_an_exported_saturation_limits_the_size_of_negative_signals_too(kind, expected):
    """The components of a magnetic sensor have both signs. The gradual limit is x c / (|x| + c), c = 300 counts; it is
    the smooth limit with the sharpness 1.
    """
    frame = Frame(step_s=FRAME_S, since_s=0.0, age_s=0.0, model=None)
    frame.signal = np.array([-600.0, -100.0, 600.0])
    STEPS[kind](frame, {"counts": np.full(3, 300.0), "sharpness": np.ones(3)}, {})
    assert frame.signal == pytest.approx(expected)


CREEP = ("hysteresis", "drop", np.array([[0.4], [0.8]]))
CLIP = ("saturation", "clip", np.array([[450.0]]))
LINES = ("electrode_crosstalk", "lines", np.array([[0.2], [0.1]]))
STIFF = ("stiffness", "", np.array([[0.7]]))


@pytest.mark.parametrize(
    ("name", "variant", "values"),
    [CREEP, CLIP, LINES, STIFF],
    ids=["hysteresis", "saturation", "crosstalk", "stiffness"],
)
def test_module_without_forces_agrees_within_the_noise_of_the_simulator(simulation, tmp_path, name, variant, values):
    path = simulation.write_report(tmp_path, find_form(name, variant), values)
    export_report(path, "python", tmp_path / "skin.py")
    effects = load_module(tmp_path / "skin.py").SkinEffects()
    with GraspDataset(simulation.sim) as data:
        grasp = data["0000"]
        difference = apply_module(effects, grasp, 0, force=False) - apply_module(effects, grasp, 0)
    assert np.abs(difference).max() <= 25.0  # the noise of the worlds has a standard deviation of 4 counts
    assert difference.std() < 4.0


@pytest.mark.parametrize("form", FORMS, ids=IDS)
def test_frames_processed_one_by_one_agree_with_the_whole_recording(simulation, tmp_path, form):
    export_report(
        simulation.write_report(tmp_path, form, form.make_typical_values(simulation.state)),
        "python",
        tmp_path / "skin.py",
    )
    effects = load_module(tmp_path / "skin.py").SkinEffects()
    with GraspDataset(simulation.sim) as data:
        grasp = data["0001"]
        expected = apply_module(effects, grasp, 3)
        effects.reset(3, float(grasp.timestamp[grasp.phase != Phase.BASELINE][0]))
        for k, time_s in enumerate(grasp.timestamp.tolist()):
            found = effects.apply(time_s, grasp.raw_counts[k], grasp.contact_force[k], grasp.separation[k])
            np.testing.assert_array_equal(found, expected[k])


def test_delay_before_the_simulator_is_exact_in_recordings_and_zero_in_streams(simulation, tmp_path):
    """The first board precedes the simulator by 0.1 s. A recording contains the future frames that this delay needs; a
    stream does not, so its counts remain unchanged.
    """
    path = simulation.write_report(tmp_path, find_form("latency", "delay", "board"), np.array([[-0.1, 0.2]]))
    done = export_report(path, "python", tmp_path / "skin.py")
    assert "precedes" in done.approximated["latency"]
    effects = load_module(tmp_path / "skin.py").SkinEffects()
    with GraspDataset(simulation.sim) as data:
        grasp = data["0000"]
        expected = add_effects_to_grasp(
            FrameStates(data).build_state(grasp), grasp, read_report(path).effects, RandomStreams(0, 0, 0, 1)
        )[0]
        np.testing.assert_allclose(apply_module(effects, grasp, 0), expected, atol=1.0)
        start_s = float(grasp.timestamp[110])  # first frame after the baseline
        effects.reset(0, start_s)
        stream = [
            effects.apply(*one) for one in zip(grasp.timestamp, grasp.raw_counts, grasp.contact_force, strict=True)
        ]
    np.testing.assert_array_equal(np.array(stream)[:, BOARD], grasp.raw_counts[:, BOARD])


def make_noise_parameters(*counts: float) -> dict:
    return {name: {"unit": "counts", "values": [one]} for name, one in zip(NOISE_COMPONENTS, counts, strict=True)}


def test_noise_has_the_reported_covariance_and_follows_the_seed(simulation, tmp_path):
    form = find_form("noise", "")
    path = simulation.write_report(
        tmp_path,
        form,
        form.make_start_values(simulation.state),
        parameters=make_noise_parameters(30.0, 40.0, 0.0, 50.0),
    )
    export_report(path, "python", tmp_path / "skin.py")
    effects = load_module(tmp_path / "skin.py").SkinEffects()
    time_s, baseline = np.arange(8000) * FRAME_S, np.full((8000, N), 30_000.0)
    found = effects.apply_recording(time_s, baseline, seed=1)
    np.testing.assert_array_equal(found, effects.apply_recording(time_s, baseline, seed=1))
    assert (found != effects.apply_recording(time_s, baseline, seed=2)).any()
    covariance = np.cov(found[:, [0, 1, COLUMNS, N - 1]].T) / 100.0  # one TX line, one RX line, the other board
    # In 100 counts squared, a variance is 9 (white noise) + 16 (TX line) + 25 (board). Taxels on one TX line share
    # 16 + 25, other taxels of one board share 25.
    expected = [[50.0, 41.0, 25.0, 0.0], [41.0, 50.0, 25.0, 0.0], [25.0, 25.0, 50.0, 0.0], [0.0, 0.0, 0.0, 50.0]]
    np.testing.assert_allclose(covariance, expected, atol=3.0)


def test_dropout_loses_frames_and_keeps_dead_constant_and_connected_taxels(simulation, tmp_path):
    stuck, dead = np.arange(N) == 7, np.isin(np.arange(N), (7, 35))  # taxel 7 is stuck at a constant count
    missing = np.array([0.25, 0.0])  # share of the frames of each board
    short = Short(address=0x20, axis="rx", index=0, share=0.5)
    defects = Defects(single_taxels=dead, lines=(), missing=missing, dead=dead, stuck=stuck, shorts=(short,))
    effect = Dropout(defects)
    path = simulation.write_report(tmp_path, effect, effect.make_detected_values(simulation.state))
    export_report(path, "python", tmp_path / "skin.py")
    effects = load_module(tmp_path / "skin.py").SkinEffects()
    reported = read_report(path).effects
    with GraspDataset(simulation.sim) as data:
        grasp = data["0001"]
        found = apply_module(effects, grasp, 0)
        expected = add_effects_to_grasp(
            FrameStates(data).build_state(grasp), grasp, reported, RandomStreams(0, 0, 0, 1)
        )[0]
    assert effects.boards == (0x20, 0x21)
    assert 1.0 - effects.valid_frames[:, 0].mean() == pytest.approx(0.25, abs=0.1)
    assert effects.valid_frames[:, 1].all()
    arrived = effects.valid_frames[:, 0]
    assert len(np.unique(found[arrived, 7])) == 1
    # A lost frame repeats the counts of the frame before.
    lost = np.flatnonzero(~arrived[1:]) + 1
    np.testing.assert_array_equal(found[lost, BOARD], found[lost - 1, BOARD])
    np.testing.assert_allclose(found[:, N // 2 :], expected[:, N // 2 :], atol=1.0)


def test_the_exported_module_imports_only_numpy_and_the_standard_library(get_case, tmp_path):
    export_report(get_case("saturation").path, "python", tmp_path / "skin.py")
    tree = ast.parse((tmp_path / "skin.py").read_text())
    names = {one.module for one in ast.walk(tree) if isinstance(one, ast.ImportFrom)}
    names |= {alias.name for one in ast.walk(tree) if isinstance(one, ast.Import) for alias in one.names}
    assert names <= {"__future__", "json", "typing", "numpy", "numpy.typing"}


def test_the_exported_module_converts_forces_into_counts(get_case, tmp_path):
    export_report(get_case("saturation").path, "python", tmp_path / "skin.py")
    effects = load_module(tmp_path / "skin.py").SkinEffects()
    np.testing.assert_allclose(effects.compute_counts(np.full(N, 1.5)), 29_000.0)


def test_the_exported_module_rejects_a_wrong_shape_and_a_missing_separation(simulation, tmp_path):
    form = find_form("proximity", "linear")
    export_report(
        simulation.write_report(tmp_path, form, form.make_start_values(simulation.state)),
        "python",
        tmp_path / "skin.py",
    )
    effects = load_module(tmp_path / "skin.py").SkinEffects()
    with pytest.raises(ValueError, match="values: expected 60 numbers"):
        effects.apply(0.0, np.zeros(3))
    with pytest.raises(ValueError, match="separation: expected the distances"):
        effects.apply(0.0, np.full(N, 30_000.0))


@pytest.mark.parametrize("to", FORMATS)
@pytest.mark.parametrize(
    ("name", "variant", "scope"), [("pose_error", "objects", "object"), ("stiffness", "sinking", "hand")]
)
def test_effects_that_change_the_contact_are_listed_as_not_expressed(simulation, tmp_path, to, name, variant, scope):
    form = find_form(name, variant, scope)
    out = tmp_path / "skin.xml"
    done = export_report(simulation.write_report(tmp_path, form, form.make_typical_values(simulation.state)), to, out)
    assert done.effects == ()
    assert "contact itself" in done.not_expressed[name]
    assert f"not expressed: {name}" in out.read_text()


def compile_mjcf(text: str):
    """Return a MuJoCo model with a site for each taxel and the sensors of the exported file."""
    mujoco = pytest.importorskip("mujoco")
    sites = "".join(
        f'<site name="taxel_{board}_{tx}_{rx}"/>' for board in (32, 33) for tx in range(ROWS) for rx in range(COLUMNS)
    )
    body = f'<worldbody><body><geom size="0.1"/>{sites}</body></worldbody>'
    return mujoco.MjModel.from_xml_string(text.replace("<sensor>", f"{body}<sensor>"))


def test_mjcf_compiles_with_the_delay_of_each_board(simulation, tmp_path):
    path = simulation.write_report(tmp_path, find_form("latency", "delay", "board"), np.array([[0.1, 0.0]]))
    done = export_report(path, "mujoco", tmp_path / "skin.xml", step_s=0.01)
    assert done.files == (tmp_path / "skin.xml", tmp_path / "skin.py")
    model = compile_mjcf((tmp_path / "skin.xml").read_text())
    np.testing.assert_allclose(model.sensor_delay, np.repeat([0.1, 0.0], N // 2))
    # 0.1 s in steps of 0.01 s are the ends of ten intervals, 11 samples.
    np.testing.assert_array_equal(model.sensor_history[:, 0], np.repeat([11, 0], N // 2))
    effects = load_module(tmp_path / "skin.py").SkinEffects()
    assert effects.parameters["delay_s"] == []  # the module must not repeat the delay of the MuJoCo sensors


def test_mjcf_has_the_noise_and_the_cutoff_as_forces(simulation, tmp_path):
    form = find_form("noise", "")
    path = simulation.write_report(
        tmp_path, form, form.make_start_values(simulation.state), parameters=make_noise_parameters(30.0, 40.0, 0.0, 0.0)
    )
    export_report(path, "mujoco", tmp_path / "noise.xml")
    text = (tmp_path / "noise.xml").read_text()
    slope = MODEL["full"] / MODEL["half"]  # counts per newton at small forces
    # Two components of the noise, 30 and 40 counts, add up to 50 counts.
    np.testing.assert_allclose(compile_mjcf(text).sensor_noise, 50.0 / slope, rtol=1e-5)
    assert "has not added it since version 3.1.4" in text
    assert load_module(tmp_path / "noise.py").SkinEffects().parameters["noise"]
    name, variant, values = CLIP
    path = simulation.write_report(tmp_path, find_form(name, variant), values)
    export_report(path, "mujoco", tmp_path / "clip.xml")
    cutoff = compile_mjcf((tmp_path / "clip.xml").read_text()).sensor_cutoff
    # CLIP limits the signal to 450 counts: the cutoff is the force that causes this signal.
    np.testing.assert_allclose(MODEL["full"] * cutoff / (cutoff + MODEL["half"]), 450.0, rtol=1e-6)
    assert load_module(tmp_path / "clip.py").SkinEffects().parameters["steps"] == []


def test_mujoco_reads_a_delayed_sensor_late_by_the_delay(simulation, tmp_path):
    mujoco = pytest.importorskip("mujoco")
    path = simulation.write_report(tmp_path, find_form("latency", "delay", "board"), np.array([[0.1, 0.0]]))
    export_report(path, "mujoco", tmp_path / "skin.xml", step_s=0.01)
    text = (tmp_path / "skin.xml").read_text()
    sites = "".join(
        f'<site name="taxel_{board}_{tx}_{rx}" size="0.2"/>'
        for board in (32, 33)
        for tx in range(ROWS)
        for rx in range(COLUMNS)
    )
    ball = f'<body><freejoint/><geom size="0.1"/>{sites}</body><geom type="plane" size="1 1 0.1" pos="0 0 -0.2"/>'
    world = f'<option timestep="0.01"/><worldbody>{ball}</worldbody><sensor>'
    model = mujoco.MjModel.from_xml_string(text.replace("<sensor>", world))
    data = mujoco.MjData(model)
    values = []
    for _ in range(60):
        mujoco.mj_step(model, data)
        values.append(data.sensordata[[0, N - 1]].copy())
    delayed, exact = np.array(values).T
    assert exact.max() > 0.0
    np.testing.assert_allclose(delayed[10:], exact[:-10], atol=1e-6)  # 0.1 s are 10 steps of 0.01 s


class RecordedArguments:
    """Configuration that keeps its arguments, in place of a class of Isaac Lab."""

    def __init__(self, **arguments):
        self.__dict__.update(arguments)


@pytest.fixture
def isaac_names(monkeypatch):
    """Modules torch and isaaclab that only keep the arguments of the configurations."""
    torch = SimpleNamespace(tensor=lambda values, **_: np.array(values), float32=None)
    modifiers = SimpleNamespace(
        ModifierCfg=RecordedArguments, DigitalFilterCfg=RecordedArguments, scale="scale", clip="clip"
    )
    noise = SimpleNamespace(GaussianNoiseCfg=RecordedArguments, NoiseModelWithAdditiveBiasCfg=RecordedArguments)
    utils = SimpleNamespace(modifiers=modifiers, noise=noise)
    modules = {"torch": torch, "isaaclab": SimpleNamespace(utils=utils), "isaaclab.utils": utils}
    for name, module in {**modules, "isaaclab.utils.noise": noise}.items():
        monkeypatch.setitem(sys.modules, name, module)


def test_isaac_filter_reproduces_the_hysteresis(simulation, tmp_path, isaac_names):
    """The signal of one contact passes the exported filter A, B and the Python module, which rounds to whole counts."""
    name, variant, values = CREEP
    path = simulation.write_report(tmp_path, find_form(name, variant), values)
    export_report(path, "isaac", tmp_path / "isaac.py", step_s=FRAME_S)
    export_report(path, "python", tmp_path / "skin.py")
    (found,) = load_module(tmp_path / "isaac.py").MODIFIERS[32]
    signal = np.concatenate([np.zeros(5), np.linspace(0.0, 900.0, 20), np.full(30, 900.0), np.zeros(20)])
    result, past = np.zeros(len(signal)), np.concatenate([[0.0], signal[:-1]])
    for k in range(1, len(signal)):
        result[k] = found.B[0] * signal[k] + found.B[1] * past[k] - found.A[0] * result[k - 1]
    effects = load_module(tmp_path / "skin.py").SkinEffects()
    counts = effects.apply_recording(np.arange(len(signal)) * FRAME_S, 30_000.0 - np.repeat(signal[:, None], N, axis=1))
    np.testing.assert_allclose(30_000.0 - counts[:, 0], result, atol=0.51)


def test_isaac_configuration_has_the_diagnosed_numbers(simulation, tmp_path, isaac_names):
    gains = find_form("gain_mismatch", "boards", "board")
    path = simulation.write_report(tmp_path, gains, np.log([[1.25, 0.8]]))
    export_report(path, "isaac", tmp_path / "gain.py")
    module = load_module(tmp_path / "gain.py")
    assert {board: one[0].params["multiplier"][0] for board, one in module.MODIFIERS.items()} == {32: 1.25, 33: 0.8}
    assert module.NOISE == {}
    drift = find_form("baseline_drift", "")
    path = simulation.write_report(tmp_path, drift, np.array([[40.0], [6.0]]))
    assert "slope" in export_report(path, "isaac", tmp_path / "drift.py").approximated["baseline_drift"]
    bias = load_module(tmp_path / "drift.py").NOISE[33].bias_noise_cfg
    assert (bias.mean, bias.std, bias.operation) == (20.0, 6.0, "abs")  # a drift from 0 to 40 counts has the mean 20
    path = simulation.write_report(tmp_path, find_form("latency", "delay", "board"), np.array([[0.05, 0.0]]))
    export_report(path, "isaac", tmp_path / "delay.py", step_s=0.02)
    # A delay of 0.05 s is 2.5 steps of 0.02 s: the mean of the values two and three steps before.
    np.testing.assert_allclose(load_module(tmp_path / "delay.py").MODIFIERS[32][0].B, [0.0, 0.0, 0.5, 0.5])
    path = simulation.write_report(tmp_path, find_form("stiffness", ""), np.array([[0.7]]))
    assert "acts on forces" in export_report(path, "isaac", tmp_path / "force.py").not_expressed["stiffness"]


@pytest.mark.parametrize(
    ("name", "variant", "values"),
    [("saturation", "smooth", [600.0, 3.0]), ("nonlinearity", "polynomial", [0.3, 0.2])],
)
def test_isaac_modifiers_with_a_shape_compute_the_signal_of_the_effect(
    simulation, tmp_path, isaac_names, name, variant, values
):
    """The functions of the exported file act on arrays with the method `clamp` of a tensor."""

    class Tensor(np.ndarray):
        def abs(self):
            return np.abs(self)

        def clamp(self, max):
            return np.minimum(self, max)

    form, column = find_form(name, variant), np.array(values)[:, None]
    export_report(simulation.write_report(tmp_path, form, column), "isaac", tmp_path / "isaac.py", step_s=FRAME_S)
    (found,) = load_module(tmp_path / "isaac.py").MODIFIERS[32]
    signal = np.linspace(-1500.0, 1500.0, N // 2)
    changed = found.func(signal.view(Tensor), **found.params)
    state = simulation.state
    signals = np.zeros_like(state.signal_counts)
    signals[0, 0, BOARD] = signal
    whole = replace(state, mean=state.average_bins(signals))  # a saturation acts on the mean of all contacts
    expected = form.apply(whole, state.base.with_signal_counts(signals), column).signal_counts[0, 0, BOARD]
    np.testing.assert_allclose(changed, expected, atol=1.0)


def read_genesis(simulation, folder: Path, form, values, **changes) -> tuple[dict, object]:
    """Return the Genesis options of the first board and the result of the export."""
    done = export_report(
        simulation.write_report(folder, form, values, **changes), "genesis", folder / "genesis.py", overwrite=True
    )
    options = load_module(folder / "genesis.py").KINEMATIC_TAXEL[32]
    assert set(options) <= set(OPTIONS)
    return options, done


def test_genesis_options_have_the_diagnosed_numbers(simulation, tmp_path):
    form = find_form("gain_mismatch", "boards", "board")
    options, _ = read_genesis(simulation, tmp_path, form, np.log([[1.25, 0.8]]))
    assert options["probe_gain"] == [1.25] * (N // 2)
    options, done = read_genesis(simulation, tmp_path, find_form("latency", "delay", "board"), np.array([[0.1, 0.0]]))
    assert (options["delay"], options["jitter"]) == (0.1, 0.0)
    form = find_form("noise", "")
    noise_counts = make_noise_parameters(30.0, 40.0, 0.0, 0.0)
    options, done = read_genesis(
        simulation, tmp_path, form, form.make_start_values(simulation.state), parameters=noise_counts
    )
    # Two components of the noise, 30 and 40 counts, add up to 50 counts, expressed as a force.
    assert options["noise"] == pytest.approx(50.0 * MODEL["half"] / MODEL["full"])
    assert "correlation" in done.approximated["noise"]
    options, _ = read_genesis(simulation, tmp_path, find_form("baseline_drift", ""), np.array([[40.0], [0.0]]))
    # A drift from 0 to 40 counts has the mean 20 counts, expressed as a force.
    assert options["bias"] == pytest.approx(20.0 * MODEL["half"] / MODEL["full"])
    dead = np.isin(np.arange(N), (3,))
    missing = np.array([0.0, 0.3])  # share of the frames of each board
    effect = Dropout(Defects(single_taxels=dead, lines=(), missing=missing, dead=dead, stuck=dead & False))
    options, done = read_genesis(simulation, tmp_path, effect, effect.make_detected_values(simulation.state))
    assert [k for k, gain in enumerate(options["probe_gain"]) if gain < 1e-6] == [3]
    assert "lost frames" in done.not_expressed["dropout: lost frames"]
    name, variant, values = CREEP
    _, done = read_genesis(simulation, tmp_path, find_form(name, variant), values)
    assert "hysteresis_strength = -0.4 with hysteresis_tau = 0.8" in done.not_expressed[name]


def test_genesis_omits_all_steps_of_an_effect_that_it_cannot_express(simulation, tmp_path):
    """The form `curved` of a stiffness has two steps; Genesis supports only the scale of the force."""
    options, done = read_genesis(simulation, tmp_path, find_form("stiffness", "curved"), np.array([[0.7], [1.2]]))
    assert "law of the force" in done.not_expressed["stiffness"]
    assert "probe_gain" not in options
    options, _ = read_genesis(simulation, tmp_path, find_form("stiffness", ""), np.array([[0.7]]))
    assert options["probe_gain"] == pytest.approx([1.0 / 0.7] * (N // 2))


def test_genesis_kernel_reproduces_the_crosstalk_of_lines(simulation, tmp_path):
    options, _ = read_genesis(simulation, tmp_path, find_form("electrode_crosstalk", "lines"), np.array([[0.3], [0.2]]))
    force = np.random.default_rng(5).uniform(0.0, 0.01, (ROWS, COLUMNS))
    # The kernel reaches from each taxel over the whole board, so the forces beyond the board are padded with zeros.
    wide = np.pad(force, ((ROWS - 1,) * 2, (COLUMNS - 1,) * 2))
    kernel = np.array(options["crosstalk_kernel"])
    windows = np.lib.stride_tricks.sliding_window_view(wide, kernel.shape)
    found = (windows * kernel).sum(axis=(2, 3))
    rx_line, tx_line = (force.sum(axis=axis, keepdims=True) - force for axis in (0, 1))
    # A taxel gains 0.3 times the mean of the other taxels on its TX line, and 0.2 times that mean of its RX line.
    expected = force + 0.3 * tx_line / (COLUMNS - 1) + 0.2 * rx_line / (ROWS - 1)
    np.testing.assert_allclose(found, expected, rtol=1e-6)


@pytest.mark.parametrize(("status", "words"), [("no_gap", "there is no gap"), ("unknown", "the cause of the gap")])
def test_without_an_identified_cause_no_file_is_written(simulation, tmp_path, status, words):
    name, variant, values = CLIP
    done = export_report(
        simulation.write_report(tmp_path, find_form(name, variant), values, status=status),
        "python",
        tmp_path / "skin.py",
    )
    assert done.files == ()
    assert words in done.notes[0]
    assert not (tmp_path / "skin.py").exists()


def test_without_the_simulated_dataset_effects_on_signals_remain(get_case, tmp_path):
    content = json.loads(get_case("saturation").path.read_text())
    content["inputs"]["sim"]["path"] = str(tmp_path / "moved.h5")
    report = tmp_path / "report.json"
    report.write_text(json.dumps(content))
    done = export_report(report, "python", tmp_path / "skin.py")
    assert done.effects == ("saturation",)
    assert "give --sim" in done.notes[0]
    effects = load_module(tmp_path / "skin.py").SkinEffects()
    np.testing.assert_array_equal(effects.apply(0.0, np.full(N, 30_000.0)), 30_000.0)
    assert effects.apply(0.1, np.full(N, 28_000.0)).min() > 29_000.0  # a signal of 2000 counts is limited to about 700
    done = export_report(report, "python", tmp_path / "skin2.py", sim=get_case("saturation").sim)
    assert done.notes == ()


def test_without_the_simulated_dataset_effects_on_forces_are_not_expressed(simulation, tmp_path):
    path = simulation.write_report(tmp_path, find_form("stiffness", ""), np.array([[0.7]]))
    content = json.loads(path.read_text())
    content["inputs"]["sim"]["sha256"] = "0" * 64
    path.write_text(json.dumps(content))
    done = export_report(path, "python", tmp_path / "skin.py")
    assert "has changed since the diagnosis; give --sim" in done.not_expressed["stiffness"]


def test_wrong_inputs_are_refused_with_one_line(get_case, tmp_path):
    report, out = get_case("saturation").path, tmp_path / "skin.py"
    with pytest.raises(GapInputError, match="--to: expected one of mujoco, genesis, isaac, python, found"):
        export_report(report, "gazebo", out)
    with pytest.raises(GapInputError, match=r"expected a report\.json"):
        export_report(tmp_path / "none.json", "python", out)
    with pytest.raises(GapInputError, match=r"expected a file with the extension \.xml"):
        export_report(report, "mujoco", out)
    export_report(report, "python", tmp_path / "new" / "skin.py")  # a missing folder is created
    assert (tmp_path / "new" / "skin.py").exists()
    with pytest.raises(GapInputError, match="expected a file other than the inputs"):
        export_report(report, "python", report, overwrite=True)
    with pytest.raises(GapInputError, match='/source: expected "sim"'):
        export_report(report, "python", out, sim=get_case("saturation").real)
    out.write_text("mine")
    with pytest.raises(GapInputError, match="an existing one; choose another --out, or give --overwrite"):
        export_report(report, "python", out)
    assert out.read_text() == "mine"
    export_report(report, "python", out, overwrite=True)
    assert "class SkinEffects" in out.read_text()


def test_the_export_command_prints_files_and_effects_and_refuses_existing_files_and_unknown_formats(
    get_case, capsys, tmp_path
):
    report, out = get_case("saturation").path, tmp_path / "skin.py"
    assert run_taxel("gap", "export", report, "--to", "python", "--out", out) == 0
    assert capsys.readouterr().out == f"{out}: with saturation\n"
    assert "give --overwrite" in run_refused_command(capsys, "gap", "export", report, "--to", "python", "--out", out)
    assert run_taxel("gap", "export", report, "--to", "isaac", "--out", out, "--overwrite", "--json") == 0
    printed = json.loads(capsys.readouterr().out)
    assert printed["files"] == [str(out)]
    assert printed["effects"] == ["saturation"]
    assert "one of mujoco" in run_refused_command(capsys, "gap", "export", report, "--to", "no", "--out", out)
