"""Writing of imported grasps into a new dataset: baseline frames, counts, and the tables of the hand."""

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
from taxel.hand.errors import HandGeometryError, format_value
from taxel.recording.grasp_checks import Location
from taxel.recording.grasp_format import BASELINE_FRAMES
from taxel.recording.grasp_record import GraspRecord
from taxel.recording.grasp_storage import check_target, open_whole_dataset
from taxel.recording.grasp_tables import ObjectMesh, SensorTable, TaxelTable
from taxel.recording.grasp_writer import DatasetHeader, GraspDatasetWriter
from taxel.sim.importers.errors import FileLocation
from taxel.sim.importers.options import ImportOptions, ImportReport
from taxel.sim.separation import MISS_M
from taxel.types import FloatArray

__all__ = ["RATE_HZ", "ImportedGrasp", "compute_frame_rate", "make_record", "open_new_dataset", "refuse_existing_file"]

RATE_HZ = 20.0
"""Frame rate of a file without times: the frame rate of this project's simulator."""

_STREAM = 4  # separates the noise of imports from other random numbers of the same seed


@dataclass(frozen=True, eq=False)
class ImportedGrasp:
    """One grasp of T frames with the forces on its taxels.

    time_s: f64[T]. phase: u8[T]. sensor_pose: f64[T, s, 4, 4], world. object_pose: f64[4, 4], nominal, world.
    contact_force: f64[T, n], newtons. separation: f64[T, n], metres. joints: f64[T, j], radians; None if unknown.
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


def refuse_existing_file(path: str | os.PathLike[str], overwrite: bool) -> None:
    """Raise DatasetError if the file exists and must not be replaced, before the inputs are read."""
    check_target(Path(path), overwrite, Location(str(path)))


def compute_frame_rate(times: Iterable[FloatArray]) -> float:
    """Compute the frame rate in hertz from the median time step of all grasps; `RATE_HZ` if no grasp has two frames."""
    steps = np.concatenate([np.zeros(0), *(np.diff(grasp_times) for grasp_times in times)])
    steps = steps[steps > 0]
    return float(1.0 / np.median(steps)) if len(steps) else RATE_HZ


@contextmanager
def open_new_dataset(
    path: str | os.PathLike[str],
    options: ImportOptions,
    meshes: Mapping[str, ObjectMesh],
    rate_hz: float,
    description: str,
    stiffness_n_per_m: float | None = None,
    layer: str | None = None,
    source: str = "sim",
) -> Iterator[GraspDatasetWriter]:
    """Open a writer of a temporary dataset file, which replaces `path` when the context ends without an error.

    meshes: meshes of the objects by name. rate_hz: frame rate. description: text in the attribute "generator" of the
    dataset. stiffness_n_per_m: of the soft layer over one taxel, and layer: "coupled" or "uncoupled" springs; None: not
    stated. source: "sim", or "real" for a dataset without a sensor model.

    Raises DatasetError as the writer does, with the name of `path`.
    """
    model = options.sensor.make_dataset_model(options.hand, stiffness_n_per_m, layer)
    with (
        open_whole_dataset(path, options.overwrite) as part,
        GraspDatasetWriter.create_part(
            part,
            DatasetHeader(
                source=source,
                hand=options.hand.name,
                taxels=_taxel_table(options.hand),
                sensors=_sensor_table(options.hand, rate_hz),
                objects=meshes,
                generator=f"taxel {version('taxel')}; {description}, seed {options.seed}",
                sensor_model=model if source == "sim" else None,
            ),
        ) as out,
    ):
        yield out


def make_record(
    grasp: ImportedGrasp, options: ImportOptions, source: FileLocation, report: ImportReport
) -> GraspRecord:
    """Make the dataset record of a grasp, with baseline frames and raw counts.

    The noise of the counts depends only on the seed and the id. `sensor_pose` of the record is the pose in the middle
    of the hold phase. The frames are counted in the report. Raises ImportDataError for too few baseline frames if the
    options do not add frames.
    """
    added = _count_missing_baseline(grasp, options.baseline_frames, source)
    times, step = grasp.time_s, 1.0 / compute_frame_rate([grasp.time_s])
    before = times[0] - step * np.arange(added, 0, -1)
    # In the added frames nothing touches the hand: the forces are 0, and the object is out of reach of every taxel.
    force = np.concatenate([np.zeros((added, grasp.contact_force.shape[1])), grasp.contact_force])
    separation = np.concatenate([np.full((added, grasp.separation.shape[1]), MISS_M), grasp.separation])
    rng = np.random.default_rng([options.seed, _STREAM, *grasp.id.encode()])
    hold = np.flatnonzero(grasp.phase == Phase.HOLD)
    middle = int(hold[len(hold) // 2]) if len(hold) else len(times) - 1
    frames = len(times) + added
    report.grasps += 1
    report.frames += frames
    report.added_frames += added
    return GraspRecord(
        object=grasp.object,
        approach=grasp.approach,
        iteration=grasp.iteration,
        session=grasp.session,
        timestamp=np.concatenate([before, times]),
        phase=np.concatenate([np.full(added, Phase.BASELINE, np.uint8), grasp.phase]),
        raw_counts=options.sensor.raw_counts(options.hand, force, rng),
        valid=np.ones((frames, len(options.hand.boards)), bool),
        sensor_pose=grasp.sensor_pose[middle],
        object_pose=grasp.object_pose,
        # With joint angles, poses over time would be redundant.
        sensor_pose_t=None if grasp.joints is not None else _repeat_first(grasp.sensor_pose, added),
        joint_position=None if grasp.joints is None else _repeat_first(grasp.joints, added),
        contact_force=force,
        separation=separation,
    )


def _repeat_first(values: FloatArray, added: int) -> FloatArray:
    """Return the values with `added` copies of the first value before them."""
    return np.concatenate([np.repeat(values[:1], added, axis=0), values])


def _count_missing_baseline(grasp: ImportedGrasp, required_frames: int | None, source: FileLocation) -> int:
    """Return the number of baseline frames to add to a grasp.

    required_frames: required number of baseline frames; None: no frames are added, and a grasp with fewer than
    `BASELINE_FRAMES` baseline frames raises ImportDataError.
    """
    baseline_frames = int((grasp.phase == Phase.BASELINE).sum())
    if required_frames is None:
        if baseline_frames < BASELINE_FRAMES:
            expected = f"{BASELINE_FRAMES} frames of phase 0 (baseline) in grasp {format_value(grasp.id)}"
            remedy = "taxels are active relative to a baseline; record a baseline, or add --baseline-frames 100"
            source.fail(expected, str(baseline_frames), remedy)
        return 0
    return max(required_frames - baseline_frames, 0)


def _taxel_table(hand: Hand) -> TaxelTable:
    """Build the taxel table of a dataset. Raises HandGeometryError for a hand without taxel positions."""
    if hand.position is None or hand.normal is None:
        raise HandGeometryError(hand.name)
    size = np.full(hand.n_taxels, hand.size_m)
    return TaxelTable(hand.sensor, hand.tx, hand.rx, hand.position, hand.normal, size)


def _sensor_table(hand: Hand, rate_hz: float) -> SensorTable:
    """Build the sensor table of a dataset, with the same frame rate for all boards."""
    boards = hand.boards
    return SensorTable(
        np.array([board.address for board in boards], np.uint8),
        tuple(board.name for board in boards),
        tuple(board.kind.name for board in boards),
        np.full(len(boards), rate_hz),
    )
