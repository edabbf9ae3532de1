"""Injection of causes into a real dataset: the counts change, everything else remains."""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import Final

import h5py
import numpy as np

from taxel.blind.injection.forms import InjectedForm
from taxel.blind.injection.skin_counts import GraspSignal, Injection, SkinTable
from taxel.gap.data.pair import read_pair
from taxel.gap.data.prepare import prepare_pair
from taxel.gap.features.metric import compute_gap_of_change, measure_gap
from taxel.recording.grasp_dataset import GraspDataset
from taxel.recording.grasp_format import Phase
from taxel.recording.hdf5_output import change_hdf5
from taxel.types import FloatArray

FIRST_STRENGTH: Final = 0.5
STRENGTHS: Final = (0.01, 4.0)
"""First trial, and limits, of the search for the strength that produces the wanted gap."""

STEPS: Final = 1
"""Trials of the search; the gap is about proportional to the strength."""

COUNT_MAX: Final = 65_535


def inject_causes(
    real: Path, sim: Path, out: Path, forms: Sequence[InjectedForm], floors: Sequence[float], seed: int
) -> list[float]:
    """Write `out`: the real dataset with injected causes. Returns the strength of each.

    real, sim: a pair without causes. floors: gap that each cause alone produces, in floors of the pair. The causes act
    in the given order. Raises GapInputError if the pair cannot be compared.
    """
    skin = read_skin(real, sim)
    parts = [form.sample(skin, np.random.default_rng([seed, number])) for number, form in enumerate(forms)]
    strengths = []
    fit_data = prepare_pair(read_pair(real, sim))
    floor = measure_gap(fit_data.sessions, fit_data.state.mean, fit_data.layout).floor
    for part, wanted in zip(parts, floors, strict=True):
        strength = FIRST_STRENGTH
        for _ in range(STEPS):
            write_injected(real, sim, out, skin, [(part, strength)], seed)
            changed = prepare_pair(read_pair(out, sim))
            change = np.where((fit_data.weight > 0) & (changed.weight > 0), changed.target - fit_data.target, 0.0)
            gap = compute_gap_of_change(change, fit_data.layout)
            strength = float(np.clip(strength * wanted * floor / max(gap, 1e-9), *STRENGTHS))
        strengths.append(strength)
    write_injected(real, sim, out, skin, list(zip(parts, strengths, strict=True)), seed)
    return strengths


def read_skin(real: Path, sim: Path) -> SkinTable:
    """Taxels of a dataset. The full scale is that of the simulator's sensor model, or the largest count."""
    with h5py.File(sim) as file:
        scale = np.max(file["sensor_model"].attrs["full_scale_drop_counts"]) if "sensor_model" in file else COUNT_MAX
    with GraspDataset(real) as data:
        table = data.taxels
        sensor, tx, rx = (np.asarray(one, np.int64) for one in (table.sensor, table.tx, table.rx))
        return SkinTable(np.asarray(table.position, np.float64), sensor, tx, rx, float(scale))


def write_injected(
    real: Path, sim: Path, out: Path, skin: SkinTable, parts: Sequence[tuple[Injection, float]], seed: int
) -> None:
    """Copy a dataset and change its counts by injections with their strengths."""
    shutil.copyfile(real, out)
    gaps = _read_separations(sim)
    with change_hdf5(out) as file:
        for number, name in enumerate(sorted(file["grasps"])):
            group = file["grasps"][name]
            raw, phase = group["raw_counts"][...].astype(np.float64), group["phase"][...]
            rest = raw[phase == Phase.BASELINE].mean(axis=0)
            signal = rest - raw
            rng = np.random.default_rng([seed, 1000 + number])
            gap = gaps.get((str(group.attrs["object"]), str(group.attrs["approach"])))
            own = None if gap is None else _map_frames(*gap, phase)
            changed = signal
            for inject, strength in parts:
                changed = inject(GraspSignal(changed, group["timestamp"][...], phase, rng, own), strength)
            group["raw_counts"][...] = np.rint(raw - (changed - signal)).clip(0, COUNT_MAX)


def _read_separations(sim: Path) -> dict[tuple[str, str], tuple[np.ndarray, FloatArray]]:
    """Phase and separation of the first simulated grasp of every condition."""
    found: dict[tuple[str, str], tuple[np.ndarray, FloatArray]] = {}
    with h5py.File(sim) as file:
        for name in sorted(file["grasps"]):
            group = file["grasps"][name]
            key = (str(group.attrs["object"]), str(group.attrs["approach"]))
            if "separation" in group and key not in found:
                found[key] = (group["phase"][...], group["separation"][...])
    return found


def _map_frames(phase: np.ndarray, separation: FloatArray, target: np.ndarray) -> FloatArray:
    """Separations f64[T, n] at the same part of the same phase as the frames of another recording, phase u8[T]."""
    result = np.full((len(target), separation.shape[1]), 0.05)
    for value in np.unique(target):
        rows, own = np.flatnonzero(target == value), np.flatnonzero(phase == value)
        if len(own):
            place = np.linspace(0, len(own) - 1, len(rows)).round().astype(int)
            result[rows] = separation[own[place]]
    return result
