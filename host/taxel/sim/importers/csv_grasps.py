"""Common part of the imports of CSV files: poses of hand and object in every frame, and the written dataset."""

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
from taxel.sim.importers.errors import FileLocation, suggest_names
from taxel.sim.importers.grasp_rows import Frames, GraspRows, group_frames, group_grasps, make_dataset_ids
from taxel.sim.importers.hand_motion import GraspTrack, HandMotion, read_joints, read_poses
from taxel.sim.importers.options import ImportOptions, ImportReport
from taxel.sim.importers.records import (
    ImportedGrasp,
    compute_frame_rate,
    make_record,
    open_new_dataset,
    refuse_existing_file,
)
from taxel.sim.separation import compute_separations
from taxel.types import FloatArray

__all__ = ["ComputeForces", "PosedGrasp", "group_rows_by_frame", "make_meshes", "read_hand", "write_grasps"]


@dataclass(frozen=True, eq=False)
class PosedGrasp:
    """One grasp of a table with the poses of hand and object in its T frames.

    hand_track: the hand at the times of the frames. object_pose: f64[T, 4, 4], pose of the object in the world.
    nominal_pose: f64[4, 4], assumed pose of the object: as calibrated, or as in the first frame.
    """

    rows: GraspRows
    frames: Frames
    hand_track: GraspTrack
    grasp_object: GraspObject
    object_pose: FloatArray
    nominal_pose: FloatArray


ComputeForces = Callable[[PosedGrasp, ImportReport], FloatArray]
"""Computes the contact forces f64[T, n] of a grasp, newtons, and adds the number of contact points to the report."""


def read_hand(
    joints: str | os.PathLike[str] | None, poses: str | os.PathLike[str] | None, options: ImportOptions
) -> HandMotion:
    """Read the motion of the hand from a file of joint angles or of poses.

    Raises ValueError if both files are given, or neither.
    """
    if joints is not None and poses is None:
        return read_joints(joints, options.hand, options.wrist_pose, options.progress)
    if poses is not None and joints is None:
        return read_poses(poses, options.hand, options.progress)
    raise ValueError("expected a file of joint angles or a file of poses, found both or neither")


def write_grasps(
    table: CsvTable,
    motion: HandMotion,
    out: str | os.PathLike[str],
    compute_forces: ComputeForces,
    description: str,
    options: ImportOptions,
) -> ImportReport:
    """Write all grasps of a table to the dataset `out`, completely or not at all.

    compute_forces: called once for each grasp. description: text in the attribute "generator" of the dataset.
    """
    refuse_existing_file(out, options.overwrite)
    grasps = group_grasps(table)
    posed_grasps = [_pose_grasp(table, rows, motion, options) for rows in grasps]
    ids = make_dataset_ids([grasp.id for grasp in grasps])
    objects = {grasp.grasp_object.name: grasp.grasp_object for grasp in posed_grasps}
    rate = compute_frame_rate([grasp.frames.time_s for grasp in posed_grasps])
    report = ImportReport()
    with open_new_dataset(out, options, make_meshes(objects.values()), rate, description) as writer:
        for done, (name, grasp) in enumerate(zip(ids, posed_grasps, strict=True)):
            options.progress("grasps", done, len(posed_grasps))
            imported = _import_grasp(name, grasp, compute_forces(grasp, report), options)
            writer.add(make_record(imported, options, table.source, report), name)
        options.progress("grasps", len(posed_grasps), len(posed_grasps))
    return report


def make_meshes(objects: Iterable[GraspObject]) -> dict[str, ObjectMesh]:
    """Build the meshes of objects by name, as a dataset stores them."""
    meshes = {}
    for grasp_object in objects:
        vertices, faces = grasp_object.shape.mesh()
        meshes[grasp_object.name] = ObjectMesh(vertices, faces.astype(np.int32))
    return meshes


def _import_grasp(name: str, grasp: PosedGrasp, forces: FloatArray, options: ImportOptions) -> ImportedGrasp:
    """Combine a posed grasp of T frames with the forces on n taxels into a grasp of the dataset.

    name: id in the dataset. forces: f64[T, n], newtons.
    """
    rows, sensors = grasp.rows, grasp.hand_track.sensor_pose
    return ImportedGrasp(
        name,
        rows.object,
        rows.approach,
        rows.iteration,
        rows.session,
        grasp.frames.time_s,
        grasp.frames.phase,
        sensors,
        grasp.nominal_pose,
        forces,
        compute_separations(options.hand, grasp.grasp_object.shape, sensors, grasp.object_pose),
        grasp.hand_track.joints,
    )


def _pose_grasp(table: CsvTable, rows: GraspRows, motion: HandMotion, options: ImportOptions) -> PosedGrasp:
    """Return the frames of a grasp with the poses of hand and object.

    rows: rows of the grasp in the table. motion: poses of the hand over time. Raises ImportDataError for an unknown
    object or pose.
    """
    if rows.object not in options.objects:
        suggestion = suggest_names(rows.object, options.objects)
        table.at(rows.rows[0], "object").fail("an object whose shape is known", format_value(rows.object), suggestion)
    track = motion.track_of(rows.id)
    frames = group_frames(table, rows, track)
    hand_track = track.resample(frames.time_s, rows.id)
    calibrated_pose = options.object_poses.get(rows.object)
    object_pose = hand_track.object_pose
    if object_pose is None:
        if calibrated_pose is None:
            _fail_without_object_pose(motion.source, rows.object)
        object_pose = np.broadcast_to(calibrated_pose, (len(frames.time_s), 4, 4))
    nominal_pose = object_pose[0] if calibrated_pose is None else calibrated_pose
    return PosedGrasp(rows, frames, hand_track, options.objects[rows.object], object_pose, nominal_pose)


def _fail_without_object_pose(source: FileLocation, name: str) -> NoReturn:
    """Raise ImportDataError for the object `name`, whose pose is neither in the table nor calibrated."""
    found = "no columns object_x ... object_qz and no calibrated pose"
    remedy = "add object_x, object_y, object_z, object_qw, object_qx, object_qy, object_qz, or give a calibration file"
    source.fail(f"the pose of {format_value(name)}", found, remedy)


def group_rows_by_frame(grasp: PosedGrasp, selection: NDArray[np.bool_]) -> list[tuple[int, NDArray[np.intp]]]:
    """List the selected rows of the table by frame of a grasp: (index of the frame, row numbers i64).

    selection: bool[r], the selected rows of the table. Frames without selected rows are left out.
    """
    rows, frame = grasp.rows.rows, grasp.frames.frame
    is_selected = selection[rows]
    order = np.argsort(frame[is_selected], kind="stable")
    rows, frame = rows[is_selected][order], frame[is_selected][order]
    boundaries = np.flatnonzero(np.diff(frame)) + 1
    groups = zip(np.split(frame, boundaries), np.split(rows, boundaries), strict=True)
    return [(int(frames[0]), frame_rows) for frames, frame_rows in groups if len(frames)]
