"""Injection of causes into a real dataset: only the counts are changed."""

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
from taxel.gap.fitting.fit_data import FitData
from taxel.recording.grasp_dataset import GraspDataset
from taxel.recording.grasp_format import Phase
from taxel.recording.hdf5_output import change_hdf5
from taxel.types import FloatArray

FIRST_STRENGTH: Final = 0.5
STRENGTHS: Final = (0.01, 4.0)
"""First strength, and limits of the strength, in the search for the strength that produces the required gap."""

STEPS: Final = 1
"""Number of iterations of the search; the gap is approximately proportional to the strength."""

COUNT_MAX: Final = 65_535


def inject_causes(
    real: Path, sim: Path, out: Path, forms: Sequence[InjectedForm], floors: Sequence[float], seed: int
) -> list[float]:
    """Write the real dataset with injected causes to `out`; return the gap that each cause alone produces, in floors of
    `out` and `sim`.

    real, sim: a pair of datasets without causes. forms: forms of the causes, which are applied in this order. floors:
    gap that each cause alone must produce, in floors of this pair. The result differs from `floors`, because the
    strengths are limited (`STRENGTHS`), and because other causes can increase the floor. seed: seed of all random
    numbers. Raises GapInputError if the pair cannot be compared.
    """
    skin = read_skin(real, sim)
    parts = [form.sample(skin, np.random.default_rng([seed, number])) for number, form in enumerate(forms)]
    base = prepare_pair(read_pair(real, sim))
    floor = _measure_floor(base)

    def inject_alone(part: Injection, strength: float) -> FitData:
        """Write one cause alone to `out`, and return the pair."""
        write_injected(real, sim, out, skin, [(part, strength)], seed)
        return prepare_pair(read_pair(out, sim))

    strengths, gaps = [], []
    for part, wanted in zip(parts, floors, strict=True):
        strength = FIRST_STRENGTH
        for _ in range(STEPS):
            # The gap is approximately proportional to the strength.
            gap = max(_measure_change(base, inject_alone(part, strength)), 1e-9)
            strength = float(np.clip(strength * wanted * floor / gap, *STRENGTHS))
        strengths.append(strength)
        pair = inject_alone(part, strength)
        gaps.append(_measure_change(base, pair))
    if len(parts) > 1:  # a single cause is written already
        write_injected(real, sim, out, skin, list(zip(parts, strengths, strict=True)), seed)
        pair = prepare_pair(read_pair(out, sim))
    floor = _measure_floor(pair)
    return [gap / max(floor, 1e-9) for gap in gaps]


def _measure_floor(pair: FitData) -> float:
    """Measure the floor of a pair of datasets, counts."""
    return measure_gap(pair.sessions, pair.state.mean, pair.layout).floor


def _measure_change(before: FitData, after: FitData) -> float:
    """Measure the gap between the real halves of two pairs of datasets with equal simulations, counts."""
    change = np.where((before.weight > 0) & (after.weight > 0), after.target - before.target, 0.0)
    return compute_gap_of_change(change, before.layout)


def read_skin(real: Path, sim: Path) -> SkinTable:
    """Read the taxels of a real dataset.

    The full scale is that of the simulator's sensor model, or the largest 16-bit count without a sensor model.
    """
    with h5py.File(sim) as file:
        scale = np.max(file["sensor_model"].attrs["full_scale_drop_counts"]) if "sensor_model" in file else COUNT_MAX
    with GraspDataset(real) as data:
        table = data.taxels
        sensor, tx, rx = (np.asarray(one, np.int64) for one in (table.sensor, table.tx, table.rx))
        return SkinTable(np.asarray(table.position, np.float64), sensor, tx, rx, float(scale))


def write_injected(
    real: Path, sim: Path, out: Path, skin: SkinTable, parts: Sequence[tuple[Injection, float]], seed: int
) -> None:
    """Write a copy of the real dataset to `out`, with its counts changed by the injections.

    parts: injections with their strengths, applied in this order. sim: provides the separations. seed: seed of the
    random numbers of each grasp.
    """
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
            separation = None if gap is None else _map_frames(*gap, phase)
            changed = signal
            for inject, strength in parts:
                changed = inject(GraspSignal(changed, group["timestamp"][...], phase, rng, separation), strength)
            group["raw_counts"][...] = np.rint(raw - (changed - signal)).clip(0, COUNT_MAX)


def _read_separations(sim: Path) -> dict[tuple[str, str], tuple[np.ndarray, FloatArray]]:
    """Read phase u8[T] and separation f64[T, n] of the first simulated grasp of each condition that states
    separations.
    """
    found: dict[tuple[str, str], tuple[np.ndarray, FloatArray]] = {}
    with h5py.File(sim) as file:
        for name in sorted(file["grasps"]):
            group = file["grasps"][name]
            key = (str(group.attrs["object"]), str(group.attrs["approach"]))
            if "separation" in group and key not in found:
                found[key] = (group["phase"][...], group["separation"][...])
    return found


def _map_frames(phase: np.ndarray, separation: FloatArray, target: np.ndarray) -> FloatArray:
    """Map the separations of a simulated grasp to the frames of another recording; return f64[len(target), n], metres.

    phase, separation: u8[T] and f64[T, n] of the simulated grasp. target: phase of each frame of the other recording. A
    frame gets the separation at the same relative time within the same phase; 50 mm in a phase that was not simulated.
    """
    result = np.full((len(target), separation.shape[1]), 0.05)
    for value in np.unique(target):
        target_frames, frames = np.flatnonzero(target == value), np.flatnonzero(phase == value)
        if len(frames):
            place = np.linspace(0, len(frames) - 1, len(target_frames)).round().astype(int)
            result[target_frames] = separation[frames[place]]
    return result
