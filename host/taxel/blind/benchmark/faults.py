"""Faults of a simulated dataset, as a defective simulator or exporter writes them.

They are not causes of the gap: a diagnosis must not name an effect because of them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Final

import h5py
import numpy as np

from taxel.recording.grasp_dataset import GraspDataset
from taxel.recording.grasp_format import Phase
from taxel.recording.hdf5_output import change_hdf5

SPIKE_FACTOR: Final = (10.0, 30.0)
"""Range of the factor by which a force spike multiplies all forces of one frame (a former defect of this project's
simulator multiplied the force of the hold by 21)."""

PENETRATION_M: Final = (3e-3, 8e-3)
"""Range of the depth by which a penetration pushes the object further into the skin, metres."""


def add_spike(file: h5py.File, grasp: str, rng: np.random.Generator) -> None:
    """Multiply all forces of one frame with contact by a factor, and recompute the counts of this frame from them."""
    group = file["grasps"][grasp]
    frame = _choose_frame(group, rng)
    force = group["contact_force"][...]
    force[frame] *= rng.uniform(*SPIKE_FACTOR)
    _write_contact(file, group, frame, force)


def add_penetration(file: h5py.File, grasp: str, rng: np.random.Generator) -> None:
    """Push the object deep into the skin in three frames: decrease the separations of loaded taxels, increase the
    forces by stiffness times depth (1000 N/m for a sensor model that states no stiffness).
    """
    group = file["grasps"][grasp]
    frame, depth = _choose_frame(group, rng), rng.uniform(*PENETRATION_M)
    frames = np.arange(frame, min(frame + 3, len(group["phase"])))
    force, separation = group["contact_force"][...], group["separation"][...]
    is_loaded = force[frame] > 0.0
    separation[np.ix_(frames, is_loaded)] -= depth
    stiffness = float(file["sensor_model"].attrs.get("contact_stiffness_n_per_m", 1000.0))
    force[np.ix_(frames, is_loaded)] += stiffness * depth
    group["separation"][...] = separation
    for number in frames:
        _write_contact(file, group, int(number), force)


def freeze_frames(file: h5py.File, grasp: str, rng: np.random.Generator) -> None:
    """Repeat one frame until the end of the grasp, as if the exporter had stopped."""
    group = file["grasps"][grasp]
    frame = _choose_frame(group, rng)
    for name in ("raw_counts", "contact_force", "separation"):
        values = group[name][...]
        values[frame:] = values[frame]
        group[name][...] = values


def remove_object(file: h5py.File, grasp: str, rng: np.random.Generator) -> None:
    """Remove the contact from one grasp, as if the object were missing: only noise and a separation of 50 mm remain."""
    group, model = file["grasps"][grasp], file["sensor_model"].attrs
    group["contact_force"][...] = 0.0
    group["separation"][...] = 0.05
    shape = group["raw_counts"].shape
    noise = rng.normal(0.0, float(model.get("noise_counts", 0.0)), shape)
    group["raw_counts"][...] = np.rint(np.asarray(model["baseline_counts"]) + noise).clip(0, 65_535)


Fault = Callable[[h5py.File, str, np.random.Generator], None]
"""Function that damages one grasp of an open dataset: file, identifier of the grasp, random numbers."""

FAULTS: Final[Mapping[str, Fault]] = MappingProxyType(
    {"force spike": add_spike, "penetration": add_penetration, "frozen": freeze_frames, "object missing": remove_object}
)


def damage(path: Path, fault: str, seed: int) -> str:
    """Apply a fault to one grasp of a simulated dataset, in place; return the identifier of the grasp.

    fault: key of `FAULTS`. seed: seed that selects the grasp and the parameters of the fault.
    """
    rng = np.random.default_rng(seed)
    with GraspDataset(path) as data:
        grasp = str(rng.choice(data.ids))
    with change_hdf5(path) as file:
        FAULTS[fault](file, grasp, rng)
    return grasp


def _choose_frame(group: h5py.Group, rng: np.random.Generator) -> int:
    """Choose a random frame with contact in closing, hold or release; the first frame of hold if there is no
    contact.
    """
    phase, force = group["phase"][...], group["contact_force"][...].sum(axis=1)
    frames = np.flatnonzero(np.isin(phase, [Phase.CLOSING, Phase.HOLD, Phase.RELEASE]) & (force > 0.0))
    return int(rng.choice(frames)) if len(frames) else int(np.flatnonzero(phase == Phase.HOLD)[0])


def _write_contact(file: h5py.File, group: h5py.Group, frame: int, force: np.ndarray) -> None:
    """Write the forces f64[T, n] of a grasp, and recompute the counts of one frame from them with the sensor model.

    The model is baseline - full scale * force / (force + half force) + noise, in counts.
    """
    group["contact_force"][...] = force
    model = file["sensor_model"].attrs
    full, half = model["full_scale_drop_counts"], np.asarray(model["half_force_n"])
    signal = full * force[frame] / (force[frame] + half)
    noise = np.random.default_rng(frame).normal(0.0, float(model.get("noise_counts", 0.0)), signal.shape)
    group["raw_counts"][frame] = np.rint(np.asarray(model["baseline_counts"]) - signal + noise).clip(0, 65_535)
