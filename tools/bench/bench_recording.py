"""Baseline and activation of a whole recording, and reading of a checked grasp dataset, compared with the simple
methods.
"""

import tempfile
from pathlib import Path

import h5py
from figures import Figure, compare
from recordings import record

from taxel.campaign.simulated import SimSettings, run_simulated
from taxel.grasp.plan import make_thesis_plan
from taxel.recording import GraspDataset, read_activity
from taxel.signal import Activation, Baseline
from taxel.skin import open_skin

VIRTUAL_S = 60.0
GRASPS = 12
READING_RATIO = 1.0 / 3.0
"""Smallest speed of reading and checking a dataset, relative to h5py alone."""


def _activate_frame_by_frame(capture: Path) -> None:
    """Compute the activation of every frame of a capture with one call per frame."""
    baselines: dict[int, Baseline] = {}
    activations: dict[int, Activation] = {}
    with open_skin(f"file:{capture}") as skin:
        for frame in skin:
            activation = activations.get(frame.address)
            if activation is not None:
                activation(frame.raw_counts)
                continue
            baseline = baselines.setdefault(frame.address, Baseline(len(frame.raw_counts)))
            if baseline.update(frame.raw_counts):
                activations[frame.address] = Activation(baseline.result().mean)


def _read_activity_arrays(capture: Path) -> None:
    """Read the raw counts of a capture file as arrays."""
    for _ in read_activity(capture):
        pass


def _read_with_h5py(path: Path) -> None:
    """Read all arrays of an HDF5 file with h5py alone."""

    def read_array(_: str, item: h5py.Group | h5py.Dataset) -> None:
        """Read an array. The result must be None: `visititems` ends with the first other result."""
        if isinstance(item, h5py.Dataset):
            item[()]

    with h5py.File(path, "r") as file:
        file.visititems(read_array)


def _read_checked(path: Path) -> None:
    """Read a grasp dataset and check its consistency."""
    with GraspDataset(path) as dataset:
        dataset.check()


def measure() -> list[Figure]:
    """Run the benchmark of recordings.

    Reading as arrays is compared with single frames, and checked reading of a dataset with h5py alone.
    """
    with tempfile.TemporaryDirectory() as name:
        capture, _ = record(Path(name), VIRTUAL_S)
        activity = compare(lambda: _read_activity_arrays(capture), lambda: _activate_frame_by_frame(capture), repeats=3)
        dataset = Path(name) / "sim.h5"
        run_simulated(dataset, make_thesis_plan(1)[:GRASPS], SimSettings(), jobs=1)
        reading = compare(lambda: _read_checked(dataset), lambda: _read_with_h5py(dataset), repeats=7)
        size = dataset.stat().st_size / 1e6
    return [
        Figure(
            "baseline and activation over a recording",
            activity.ratio,
            None,
            "frame by frame",
            f"{VIRTUAL_S / activity.measured_s:,.0f} times real time, against {VIRTUAL_S / activity.reference_s:,.0f}",
        ),
        Figure(
            "grasp dataset read and checked",
            reading.ratio,
            READING_RATIO,
            "h5py, unchecked",
            f"{size / reading.measured_s:,.0f} against {size / reading.reference_s:,.0f} MB/s",
        ),
    ]
