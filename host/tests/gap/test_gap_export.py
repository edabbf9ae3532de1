"""`taxel gap export`: the exported module reproduces the diagnosed effects, and the snippets contain their numbers."""

from __future__ import annotations

import ast
import importlib.util
import json
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from host.tests.command_line import run_refused_command, run_taxel
from taxel.gap.apply.added import with_effects
from taxel.gap.apply.draws import Chance
from taxel.gap.apply.frames import FrameStates
from taxel.gap.apply.rewriting import Rewriting, copied
from taxel.gap.diagnosis import diagnose
from taxel.gap.data.pair import read_pair
from taxel.gap.effects.catalogue import OWN_EFFECTS
from taxel.gap.effects.dropout import Dropout, Dropped, Short
from taxel.gap.errors import GapInputError
from taxel.gap.export.export import FORMATS, export_report
from taxel.gap.export.genesis_options import OPTIONS
from taxel.gap.features.features import Layout
from taxel.gap.fitting.chain import FittedEffect
from taxel.gap.fitting.state import state_of
from taxel.gap.report.model import NOISE_PARTS, model_of
from taxel.gap.report.reading import read_report
from taxel.recording.grasp_dataset import GraspDataset
from taxel.recording.grasp_format import Phase

ROWS, COLUMNS, N = 6, 5, 60
BOARD = slice(0, N // 2)
FRAME_S = 0.05
MODEL = {"full": 2000.0, "half": 1.5}
"""Counts and newtons of the sensor model of the worlds in conftest.py."""


def gain(force, signal):
    return signal * np.where(np.arange(N) < N // 2, 1.4, 0.8)


def crosstalk(force, signal):
    grid = signal.reshape(-1, 2, ROWS, COLUMNS)
    others = (grid.sum(axis=2, keepdims=True) - grid) / (ROWS - 1)
    return signal + 0.4 * others.reshape(signal.shape)


def saturation(force, signal):
    return np.minimum(signal, 700.0)


def hysteresis(force, signal):
    """30 % of the closed gap of a plate capacitor arrives with a time constant of 1.2 s."""
    x, half_counts = FRAME_S / 1.2, 0.25 * MODEL["full"]
    closed = signal / (half_counts + signal)
    late, before, result = np.zeros(N), np.zeros(N), closed.copy()
    for frame, now in enumerate(closed):
        late = now + (now - before) * np.expm1(-x) / x + (late - before) * np.exp(-x)
        result[frame], before = 0.7 * now + 0.3 * late, now
    return half_counts * result / (1.0 - result)


def latency(force, signal):
    late = signal.copy()
    late[4:, BOARD] = signal[:-4, BOARD]
    return late


def drift(force, signal):
    """The signal of all taxels grows by 12 counts per second from the first frame on."""
    return signal + 12.0 * FRAME_S * np.arange(len(signal))[:, None]


def dead_line(raw, valid, rng):
    """TX line 2 of the first board has a constant mean."""
    raw = raw.copy()
    raw[:, 10:15] = 30_000.0 + rng.normal(0.0, 4.0, (len(raw), 5))
    return raw, valid


def noise(raw, valid, rng):
    return raw + rng.normal(0.0, 30.0, raw.shape), valid


WORLDS = {
    "gain_mismatch": {"effect": gain},
    "electrode_crosstalk": {"effect": crosstalk},
    "saturation": {"effect": saturation},
    "hysteresis": {"effect": hysteresis},
    "latency": {"effect": latency},
    "baseline_drift": {"effect": drift},
    "dropout": {"after": dead_line},
    "noise": {"after": noise},
}
PARTLY = ("hysteresis",)
"""Worlds with a remaining gap of unknown cause, because the alignment in time absorbs a part of the hysteresis."""


@dataclass(frozen=True)
class Case:
    """A world with one effect: paths of both datasets and of the report, and the report."""

    real: str
    sim: str
    path: Path
    report: dict


def others(name: str) -> set[str]:
    """Effects that the diagnosis of a world excludes, which makes it faster."""
    return set(OWN_EFFECTS) - {name}


@pytest.fixture(scope="module")
def case(world, tmp_path_factory):
    """The diagnosed world of an effect, `case(name)`; only this effect is in the catalogue of the diagnosis."""
    known: dict[str, Case] = {}

    def once(name: str) -> Case:
        if name not in known:
            folder = tmp_path_factory.mktemp(name)
            real, sim = world(folder, cells=5, sessions=4, **WORLDS[name])
            report = diagnose(real, sim, without=others(name)).report
            path = folder / "report.json"
            path.write_text(json.dumps(report, allow_nan=False))
            known[name] = Case(real, sim, path, report)
        return known[name]

    return once


def load_module(path: Path) -> ModuleType:
    spec = importlib.util.spec_from_file_location(f"exported_{path.stem}", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def with_module(effects, grasp, seed: int, force: bool = True) -> np.ndarray:
    """Counts of a grasp after the exported module."""
    start_s = float(grasp.timestamp[grasp.phase != Phase.BASELINE][0])
    newtons = grasp.contact_force if force else None
    return effects.apply_recording(grasp.timestamp, grasp.raw_counts, newtons, grasp.separation, seed, start_s)


def rewrite(module: ModuleType, sim: str, out: Path) -> None:
    """Write the simulated dataset with the counts of the exported module."""
    copied(sim, out)
    effects = module.SkinEffects()
    with GraspDataset(sim) as data, Rewriting(out) as copy:
        for seed, name in enumerate(data.ids):
            copy.put(name, "raw_counts", with_module(effects, data[name], seed).astype(np.uint16))
            copy.put(name, "valid", effects.valid_frames)


@pytest.mark.parametrize("name", sorted(set(WORLDS) - set(PARTLY)))
def test_exported_module_closes_the_diagnosed_gap(case, tmp_path, name):
    own = case(name)
    assert own.report["verdict"]["effects"] == [name]
    out, module = tmp_path / "sim2.h5", tmp_path / "skin.py"
    assert export_report(own.path, "python", module).effects == (name,)
    rewrite(load_module(module), own.sim, out)
    again = diagnose(own.real, out, without=others(name)).report
    gap = again["gap"]
    assert again["verdict"]["status"] == "no_gap" or gap["value"] <= 1.2 * gap["floor"]


@pytest.mark.parametrize("name", PARTLY)
def test_exported_module_leaves_only_the_unexplained_gap(case, tmp_path, name):
    own = case(name)
    assert own.report["verdict"]["effects"] == [name, "unknown"]
    out, module = tmp_path / "sim2.h5", tmp_path / "skin.py"
    done = export_report(own.path, "python", module)
    assert done.effects == (name,)
    assert "unknown cause" in done.notes[0]
    rewrite(load_module(module), own.sim, out)
    again = diagnose(own.real, out, without=set(OWN_EFFECTS) - {name}).report
    assert again["gap"]["value"] <= 1.1 * own.report["after"]["value"]


@dataclass(frozen=True)
class Simulated:
    """A simulation, its state, and reports about it without a diagnosis."""

    sim: str
    pair: object
    state: object

    def report(self, folder: Path, form, values, status: str = "explained", **changes) -> Path:
        """Path of a report whose verdict names one effect. changes: of the model of this effect."""
        effect = FittedEffect(form, values)
        content = {
            "format": "taxel-gap-report",
            "version": 1,
            "inputs": {"sim": {"path": self.sim, "sha256": self.pair.digests[1]}},
            "verdict": {"status": status, "effects": [form.name]},
            "effects": [{"name": form.name, "model": {**model_of(self.state, effect), **changes}}],
            "taxels": {name: getattr(self.pair.taxels, name).tolist() for name in ("sensor", "tx", "rx")},
        }
        path = folder / "report.json"
        path.write_text(json.dumps(content))
        return path


@pytest.fixture(scope="module")
def simulated(world, tmp_path_factory) -> Simulated:
    sim = world(tmp_path_factory.mktemp("export"), cells=3, sessions=1, repeats=1)[1]
    pair = read_pair(sim, sim)
    layout = Layout.of(pair.clock)
    return Simulated(sim, pair, state_of(pair, layout, np.zeros((len(pair.cells), layout.count, pair.n))))


FORMS = [form for forms in OWN_EFFECTS.values() for form in forms if form.name not in ("noise", "pose_error")]
FORMS = [form for form in FORMS if form.variant != "sinking"]
IDS = [f"{form.name} {form.variant or form.scope} {form.scope}" for form in FORMS]
TOLERANCE_COUNTS = {"kept": 60.0, "added": 60.0, "pillars": 60.0, "depth": 10.0}
"""Largest permitted difference of a form whose export is an approximation, counts; 2 for all other forms."""


@pytest.mark.parametrize("form", FORMS, ids=IDS)
def test_exported_module_agrees_with_gap_apply(simulated, tmp_path, form):
    values = form.typical(simulated.state)
    if form.name == "baseline_drift":
        values = np.array([[40.0, 30.0], [0.0, 0.0]])[:, : values.shape[1]]
    path = simulated.report(tmp_path, form, values)
    export_report(path, "python", tmp_path / "skin.py")
    effects = load_module(tmp_path / "skin.py").SkinEffects()
    reported = read_report(path).effects
    largest, changed = 0.0, 0.0
    with GraspDataset(simulated.sim) as data:
        states = FrameStates(data)
        for grasp in data:
            expected = with_effects(states.of(grasp), grasp, reported, Chance(0, 0, 0, 1))[0].astype(float)
            largest = max(largest, np.abs(with_module(effects, grasp, 0) - expected).max())
            changed = max(changed, np.abs(expected - grasp.raw_counts).max())
    print(form.name, form.variant, form.scope, largest, changed)
    assert changed > 2.0
    assert largest <= TOLERANCE_COUNTS.get(form.variant, 2.0)
