"""Baseline and activation over a whole recording, and a grasp dataset read and checked, against the plain ways."""

import tempfile
from pathlib import Path

import h5py
from figures import Figure, compared
from recorded import record

from taxel.campaign.simulated import SimSettings, run_simulated
from taxel.grasp.plan import thesis_plan
from taxel.recording import GraspDataset, activity_of
from taxel.signal import Activation, Baseline
from taxel.skin import open_skin

VIRTUAL_S = 60.0
GRASPS = 2


def _frame_by_frame(capture: Path) -> None:
    baselines: dict[int, Baseline] = {}
    judges: dict[int, Activation] = {}
    with open_skin(f"file:{capture}") as skin:
        for frame in skin:
            judge = judges.get(frame.address)
            if judge is not None:
                judge(frame.raw_counts)
                continue
            baseline = baselines.setdefault(frame.address, Baseline(len(frame.raw_counts)))
            if baseline.update(frame.raw_counts):
                judges[frame.address] = Activation(baseline.result().mean)


def _whole(capture: Path) -> None:
    for _ in activity_of(capture):
        pass


def _plain_read(path: Path) -> None:
    with h5py.File(path, "r") as file:
        file.visititems(lambda _, item: item[()] if isinstance(item, h5py.Dataset) else None)


def _checked_read(path: Path) -> None:
    with GraspDataset(path) as dataset:
        dataset.check()


def measure() -> list[Figure]:
    """Arrays over frames one by one; h5py's bare read over ours, which checks every value."""
    with tempfile.TemporaryDirectory() as name:
        capture, _ = record(Path(name), VIRTUAL_S)
        activity = compared(lambda: _whole(capture), lambda: _frame_by_frame(capture), rounds=3)
        dataset = Path(name) / "sim.h5"
        run_simulated(dataset, thesis_plan(1)[:GRASPS], SimSettings(), jobs=1)
        reading = compared(lambda: _checked_read(dataset), lambda: _plain_read(dataset), rounds=7)
        size = dataset.stat().st_size / 1e6
    return [
        Figure(
            "baseline and activation over a recording",
            activity.ratio,
            None,
            "frame by frame",
            f"{VIRTUAL_S / activity.ours_s:,.0f} times real time, against {VIRTUAL_S / activity.reference_s:,.0f}",
        ),
        Figure(
            "grasp dataset read and checked",
            reading.ratio,
            None,
            "h5py, unchecked",
            f"{size / reading.ours_s:,.0f} against {size / reading.reference_s:,.0f} MB/s",
        ),
    ]
