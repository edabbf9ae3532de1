"""What the imports of CSV files share: the hand and the object at every frame of every grasp, and the way to a file."""

import os
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import NoReturn

import numpy as np
from numpy.typing import NDArray

from taxel.grasp.objects import GraspObject
from taxel.hand.errors import format_value
from taxel.recording.grasp_tables import ObjectMesh
from taxel.sim.importers.csv_table import CsvTable
from taxel.sim.importers.errors import Source, near_names
from taxel.sim.importers.grasp_rows import Frames, GraspRows, dataset_ids, frames_of, grasps_of
from taxel.sim.importers.hand_motion import GraspTrack, HandMotion, read_joints, read_poses
from taxel.sim.importers.options import ImportOptions, ImportReport
from taxel.sim.importers.records import FeltGrasp, check_new, frame_rate, new_dataset, record_of
from taxel.sim.separation import separations
from taxel.types import FloatArray

__all__ = ["PlacedGrasp", "frame_rows", "meshes_of", "read_hand", "write_grasps"]


@dataclass(frozen=True, eq=False)
class PlacedGrasp:
    """One grasp of a table with its frames, the hand at these (T moments) and the object.

    object_pose: f64[T, 4, 4], where it is. nominal: f64[4, 4], where it is believed to stand.
    """

    rows: GraspRows
    frames: Frames
    hand: GraspTrack
    item: GraspObject
    object_pose: FloatArray
    nominal: FloatArray


Feel = Callable[[PlacedGrasp, ImportReport], FloatArray]
"""Contact forces f64[T, n] of a grasp, newtons; counts contact points in the report."""


def read_hand(
    joints: str | os.PathLike[str] | None, poses: str | os.PathLike[str] | None, options: ImportOptions
) -> HandMotion:
    """The hand's motion from the one file that is given. Raises ValueError for both or neither."""
    if joints is not None and poses is None:
        return read_joints(joints, options.hand, options.wrist, options.progress)
    if poses is not None and joints is None:
        return read_poses(poses, options.hand, options.progress)
    raise ValueError("expected a file of joint angles or a file of poses, found both or neither")


def write_grasps(
    table: CsvTable,
    motion: HandMotion,
    out: str | os.PathLike[str],
    feel: Feel,
    what: str,
    options: ImportOptions,
) -> ImportReport:
    """Write every grasp of `table` to the dataset `out`, with the forces of `feel`."""
    check_new(out, options.overwrite)
    grasps = grasps_of(table)
    placed = [_placed(table, rows, motion, options) for rows in grasps]
    ids = dataset_ids([grasp.id for grasp in grasps])
    used = {one.item.name: one.item for one in placed}
    rate = frame_rate([one.frames.time_s for one in placed])
    report = ImportReport()
    with new_dataset(out, options, meshes_of(used.values()), rate, what) as writer:
        for done, (name, one) in enumerate(zip(ids, placed, strict=True)):
            options.progress("grasps", done, len(placed))
            writer.add(record_of(_felt(name, one, feel, options, report), options, table.source, report), name)
        options.progress("grasps", len(placed), len(placed))
    return report


def meshes_of(objects: Iterable[GraspObject]) -> dict[str, ObjectMesh]:
    """Objects as a dataset has them."""
    result = {}
    for item in objects:
        vertices, faces = item.shape.mesh()
        result[item.name] = ObjectMesh(vertices, faces.astype(np.int32))
    return result


def _felt(name: str, one: PlacedGrasp, feel: Feel, options: ImportOptions, report: ImportReport) -> FeltGrasp:
    rows, sensors = one.rows, one.hand.sensor_pose
    return FeltGrasp(
        name,
        rows.object,
        rows.approach,
        rows.iteration,
        rows.session,
        one.frames.time_s,
        one.frames.phase,
        sensors,
        one.nominal,
        feel(one, report),
        separations(options.hand, one.item.shape, sensors, one.object_pose),
        one.hand.joints,
    )


def _placed(table: CsvTable, rows: GraspRows, motion: HandMotion, options: ImportOptions) -> PlacedGrasp:
    if rows.object not in options.objects:
        near = near_names(rows.object, options.objects)
        table.at(rows.rows[0], "object").fail("an object whose shape is known", format_value(rows.object), near)
    track = motion.of(rows.id)
    frames = frames_of(table, rows, track)
    hand = track.at(frames.time_s, rows.id)
    nominal = options.object_poses.get(rows.object)
    moved = hand.object_pose
    if moved is None:
        if nominal is None:
            _no_object_pose(motion.source, rows.object)
        moved = np.broadcast_to(nominal, (len(frames.time_s), 4, 4))
    nominal = moved[0] if nominal is None else nominal
    return PlacedGrasp(rows, frames, hand, options.objects[rows.object], moved, nominal)


def _no_object_pose(source: Source, name: str) -> NoReturn:
    remedy = "add object_x, object_y, object_z, object_qw, object_qx, object_qy, object_qz, or give a calibration file"
    source.fail(
        f"where {format_value(name)} stands", "no columns object_x ... object_qz and no calibrated pose", remedy
    )


def frame_rows(one: PlacedGrasp, own: NDArray[np.bool_]) -> list[tuple[int, NDArray[np.intp]]]:
    """For every frame with rows that are `own`, bool[r] of the table: its index and these rows, in rising order."""
    rows, frame = one.rows.rows, one.frames.frame
    kept = own[rows]
    order = np.argsort(frame[kept], kind="stable")
    rows, frame = rows[kept][order], frame[kept][order]
    cuts = np.flatnonzero(np.diff(frame)) + 1
    parts = zip(np.split(frame, cuts), np.split(rows, cuts), strict=True)
    return [(int(frames[0]), own_rows) for frames, own_rows in parts if len(frames)]
