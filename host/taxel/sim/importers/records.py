"""From forces on taxels to the grasps of a new dataset, whole or not at all."""

import os
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from taxel.grasp.timeline import Phase
from taxel.hand import Hand
from taxel.hand.errors import HandGeometryError, format_path, format_value
from taxel.recording.errors import DatasetError
from taxel.recording.grasp_checks import Location
from taxel.recording.grasp_format import BASELINE_FRAMES
from taxel.recording.grasp_record import GraspRecord
from taxel.recording.grasp_sensor_model import SensorModel
from taxel.recording.grasp_storage import check_target, part_path, put_in_place, writing_errors
from taxel.recording.grasp_tables import ObjectMesh, SensorTable, TaxelTable
from taxel.recording.grasp_writer import DatasetHeader, GraspDatasetWriter
from taxel.sim.importers.errors import Source
from taxel.sim.importers.options import ImportOptions, ImportReport
from taxel.sim.separation import MISS_M
from taxel.types import FloatArray

__all__ = ["RATE_HZ", "FeltGrasp", "check_new", "frame_rate", "new_dataset", "record_of"]

RATE_HZ = 20.0
"""Where the files do not say how fast frames follow each other: that of the simulator's own grasps."""

_STREAM = 4


@dataclass(frozen=True, eq=False)
class FeltGrasp:
    """One grasp with what its taxels feel, T frames.

    time_s: f64[T]. phase: u8[T]. sensor_pose: f64[T, s, 4, 4], world. object_pose: f64[4, 4], nominal, world.
    contact_force: f64[T, n], newtons. separation: f64[T, n], metres. joints: f64[T, j], radians, or None.
    """

    id: str
    object: str
    approach: str
    iteration: int
    session: int
    time_s: FloatArray
    phase: NDArray[np.uint8]
    sensor_pose: FloatArray
    object_pose: FloatArray
    contact_force: FloatArray
    separation: FloatArray
    joints: FloatArray | None = None


def check_new(path: str | os.PathLike[str], overwrite: bool) -> None:
    """Refuse a file that exists, before any long reading; raises DatasetError."""
    check_target(Path(path), overwrite, Location(str(path)))


def frame_rate(times: Iterable[FloatArray]) -> float:
    """Frames a second, from the median step of all grasps' times; `RATE_HZ` where none has two frames."""
    steps = np.concatenate([np.zeros(0), *(np.diff(own) for own in times)])
    steps = steps[steps > 0]
    return float(1.0 / np.median(steps)) if len(steps) else RATE_HZ


@contextmanager
def new_dataset(
    path: str | os.PathLike[str],
    options: ImportOptions,
    meshes: Mapping[str, ObjectMesh],
    rate_hz: float,
    what: str,
    stiffness_n_per_m: float | None = None,
    layer: str | None = None,
) -> Iterator[GraspDatasetWriter]:
    """A writer beside `path`, which is put there once all grasps are written. what: for the dataset's generator.

    Raises DatasetError as the writer does, under the name of `path`.
    """
    target, place = Path(path), Location(str(path))
    check_target(target, options.overwrite, place)
    whole = target.with_name(f".{target.name}.import")
    sensor = options.sensor
    model = SensorModel(**sensor.attributes(), contact_stiffness_n_per_m=stiffness_n_per_m, layer=layer)
    try:
        with GraspDatasetWriter.create(
            whole,
            DatasetHeader(
                source="sim",
                hand=options.hand.name,
                taxels=_taxel_table(options.hand),
                sensors=_sensor_table(options.hand, rate_hz),
                objects=meshes,
                generator=f"taxel {version('taxel')}; {what}, seed {options.seed}",
                sensor_model=model,
            ),
            overwrite=True,
        ) as out:
            yield out
        with writing_errors(place):
            put_in_place(whole, target, options.overwrite, place)
    except DatasetError as error:
        if error.file != format_path(whole):
            raise
        raise DatasetError(format_path(path), *error.args[1:]) from None
    finally:
        whole.unlink(missing_ok=True)
        part_path(whole).unlink(missing_ok=True)


def record_of(felt: FeltGrasp, options: ImportOptions, source: Source, report: ImportReport) -> GraspRecord:
    """The record of a grasp: with its baseline, and with counts. Its noise depends on the seed and the id alone.

    Raises ImportDataError for too few baseline frames that were not asked to be added.
    """
    added = _missing_baseline(felt, options.baseline_frames, source)
    times, step = felt.time_s, 1.0 / frame_rate([felt.time_s])
    before = times[0] - step * np.arange(added, 0, -1)
    force = np.concatenate([np.zeros((added, felt.contact_force.shape[1])), felt.contact_force])
    separation = np.concatenate([np.full((added, felt.separation.shape[1]), MISS_M), felt.separation])
    rng = np.random.default_rng([options.seed, _STREAM, *felt.id.encode()])
    hold = np.flatnonzero(felt.phase == Phase.HOLD)
    middle = int(hold[len(hold) // 2]) if len(hold) else len(times) - 1
    frames = len(times) + added
    report.grasps += 1
    report.frames += frames
    report.added_frames += added
    return GraspRecord(
        object=felt.object,
        approach=felt.approach,
        iteration=felt.iteration,
        session=felt.session,
        timestamp=np.concatenate([before, times]),
        phase=np.concatenate([np.full(added, Phase.BASELINE, np.uint8), felt.phase]),
        raw_counts=options.sensor.raw_counts(options.hand, force, rng),
        valid=np.ones((frames, len(options.hand.boards)), bool),
        sensor_pose=felt.sensor_pose[middle],
        object_pose=felt.object_pose,
        # Where joint angles tell how the hand moved, poses over time would say it again.
        sensor_pose_t=None if felt.joints is not None else _from_first(felt.sensor_pose, added),
        joint_position=None if felt.joints is None else _from_first(felt.joints, added),
        contact_force=force,
        separation=separation,
    )


def _from_first(values: FloatArray, added: int) -> FloatArray:
    """The values with the first one repeated before them."""
    return np.concatenate([np.repeat(values[:1], added, axis=0), values])


def _missing_baseline(felt: FeltGrasp, wanted: int | None, source: Source) -> int:
    there = int((felt.phase == Phase.BASELINE).sum())
    if wanted is None:
        if there < BASELINE_FRAMES:
            expected = f"{BASELINE_FRAMES} frames of phase 0 (baseline) in grasp {format_value(felt.id)}"
            remedy = "without a baseline nobody can tell what is active; record it, or add --baseline-frames 100"
            source.fail(expected, str(there), remedy)
        return 0
    return max(wanted - there, 0)


def _taxel_table(hand: Hand) -> TaxelTable:
    if hand.position is None or hand.normal is None:
        raise HandGeometryError(hand.name)
    size = np.full(hand.n_taxels, hand.size_m)
    return TaxelTable(hand.sensor, hand.tx, hand.rx, hand.position, hand.normal, size)


def _sensor_table(hand: Hand, rate_hz: float) -> SensorTable:
    boards = hand.boards
    return SensorTable(
        np.array([board.address for board in boards], np.uint8),
        tuple(board.name for board in boards),
        tuple(board.kind.name for board in boards),
        np.full(len(boards), rate_hz),
    )
