"""Poses of the boards over time, from a CSV file of joint angles or of poses of links or boards."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from taxel.grasp.timeline import Phase
from taxel.hand import Hand
from taxel.hand.errors import HandGeometryError, format_value
from taxel.hand.kinematics import Kinematics
from taxel.hand.robot import Robot, load_robot
from taxel.hand.transforms import interpolate
from taxel.sim.importers.csv_table import Column, CsvTable, Progress, ignore_progress, pose_columns, read_csv
from taxel.sim.importers.errors import FileLocation, suggest_names
from taxel.types import FloatArray

__all__ = ["WRIST_LINK", "GraspTrack", "HandMotion", "parse_phase", "read_joints", "read_poses"]

WRIST_LINK = "palm"

OUTSIDE_S = 0.05
"""The hand is assumed to be at rest for this time before the first and after the last pose: one frame at 20 Hz."""

_GRASP = Column("grasp", "text", ("grasp_id", "id"), required=True)
_TIME = Column("time", aliases=("timestamp", "time_s", "stamp", "t"))
_PHASE = Column("phase", "text")
_PHASES = {phase.name.lower(): int(phase) for phase in Phase}


@dataclass(frozen=True, eq=False)
class GraspTrack:
    """Poses of the hand at k times of one grasp.

    time_s: f64[k], increasing. sensor_pose: f64[k, s, 4, 4], brackets in the world. phase: u8[k]; None if the file has
    none. joints: f64[k, j], radians; None for a file of poses. object_pose: f64[k, 4, 4], world; None if the file has
    none.
    """

    source: FileLocation
    time_s: FloatArray
    sensor_pose: FloatArray
    phase: NDArray[np.uint8] | None
    joints: FloatArray | None
    object_pose: FloatArray | None

    def resample(self, time_s: FloatArray, grasp: str) -> GraspTrack:
        """Interpolate the motion of the hand linearly at the times f64[T], seconds; a track with one time is constant.

        The result has no phases. grasp: name of the grasp, for errors. Raises ImportDataError for times more than
        `OUTSIDE_S` outside the track.
        """
        recorded_s = self.time_s
        if len(recorded_s) == 1:
            first = np.zeros(len(time_s), np.intp)
            return self._interpolate(time_s, first, first, np.zeros(len(time_s)))
        if time_s[0] < recorded_s[0] - OUTSIDE_S or time_s[-1] > recorded_s[-1] + OUTSIDE_S:
            found = f"{recorded_s[0]:.6g} to {recorded_s[-1]:.6g} s"
            expected = f"times from {time_s[0]:.6g} to {time_s[-1]:.6g} s for grasp {format_value(grasp)}"
            self.source.fail(expected, found, "record the hand as long as the contacts, on the same clock")
        after = np.clip(np.searchsorted(recorded_s, time_s), 1, len(recorded_s) - 1)
        step = recorded_s[after] - recorded_s[after - 1]
        fraction = np.clip((time_s - recorded_s[after - 1]) / step, 0.0, 1.0)
        return self._interpolate(time_s, after - 1, after, fraction)

    def _interpolate(
        self, time_s: FloatArray, before: NDArray[np.intp], after: NDArray[np.intp], fraction: FloatArray
    ) -> GraspTrack:
        """Interpolate the motion of the hand between its recorded poses `before` and `after`, indices i64[T].

        time_s: f64[T], times of the result, seconds. fraction: f64[T], 0 for the pose `before`, 1 for the pose `after`.
        """
        is_recorded = fraction == 1.0  # a recorded pose is used without interpolation, which would round it
        before, fraction = np.where(is_recorded, after, before), np.where(is_recorded, 0.0, fraction)
        joints = None
        if self.joints is not None:
            joints = self.joints[before] + fraction[:, None] * (self.joints[after] - self.joints[before])
        sensors = _interpolate_poses(self.sensor_pose, before, after, fraction)
        objects = None if self.object_pose is None else _interpolate_poses(self.object_pose, before, after, fraction)
        return GraspTrack(self.source, time_s, sensors, None, joints, objects)


def _interpolate_poses(
    poses: FloatArray, before: NDArray[np.intp], after: NDArray[np.intp], fraction: FloatArray
) -> FloatArray:
    """Interpolate between `poses[before]` (fraction 0) and `poses[after]` (fraction 1): poses f64[T, ..., 4, 4]."""
    result = poses[before]
    is_between = fraction > 0
    if is_between.any():
        broadcast = fraction[is_between].reshape(-1, *([1] * (poses.ndim - 3)))
        result[is_between] = interpolate(poses[before[is_between]], poses[after[is_between]], broadcast)
    return result


@dataclass(frozen=True, eq=False)
class HandMotion:
    """Poses of the hand during all grasps of a file; tracks: by name of the grasp."""

    source: FileLocation
    tracks: Mapping[str, GraspTrack]

    def track_of(self, grasp: str) -> GraspTrack:
        """Return the motion of the hand during a grasp. Raises ImportDataError if the file has no rows of the grasp."""
        if grasp not in self.tracks:
            self.source.key("grasp").fail(
                f"rows of grasp {format_value(grasp)}", "none", suggest_names(grasp, self.tracks)
            )
        return self.tracks[grasp]


def read_joints(
    path: str | os.PathLike[str], hand: Hand, wrist: FloatArray | None = None, progress: Progress = ignore_progress
) -> HandMotion:
    """Read joint angles: ``grasp[,time][,phase],<joint names>``, and optionally wrist_* and object_* poses.

    With the joints of arm and hand, the world frame is the base of the robot. With the joints of the hand only, the
    pose of the wrist in the world is in the columns wrist_x ... wrist_qz, or in `wrist`, f64[4, 4].

    Raises ImportDataError for the first error in the file, HandGeometryError for a hand without a robot.
    """
    if hand.robot is None:
        raise HandGeometryError(hand.name)
    robot = load_robot(hand.robot)
    names = robot.joint_names
    columns = (
        _GRASP,
        _TIME,
        _PHASE,
        *(Column(name) for name in names),
        *pose_columns("wrist"),
        *pose_columns("object"),
    )
    table = read_csv(path, columns, progress)
    hand_robot = robot.get_subtree(WRIST_LINK) if WRIST_LINK in robot.link_names else robot
    arm_joints = [name for name in names if name not in hand_robot.joint_names]
    wrist_poses = table.poses("wrist")
    if wrist_poses is None and wrist is not None:
        wrist_poses = np.broadcast_to(wrist, (len(table.line), 4, 4))
    has_arm = any(table.has(name) for name in arm_joints)
    used_robot: Robot = robot if has_arm else hand_robot
    if has_arm and wrist_poses is not None:
        remedy = "leave out one of the two"
        table.source.at(1).fail("joints of the arm or a pose of the wrist", "both", remedy)
    missing = [name for name in used_robot.joint_names if not table.has(name)]
    if missing:
        table.source.at(1).fail(f"a column {missing[0]}", "none", f"add the angles, radians, of {', '.join(missing)}")
    if arm_joints and not has_arm and wrist_poses is None:
        hand_joint_count = len(hand_robot.joint_names)
        expected = f"{len(names)} joints, or {hand_joint_count} joints and the pose of the wrist"
        remedy = "add the joints of the arm or wrist_x ... wrist_qz, or give the pose of the wrist (--wrist-pose)"
        table.source.at(1).fail(expected, f"{hand_joint_count} joints only", remedy)
    angles = np.array([table.numbers[name] for name in used_robot.joint_names]).reshape(-1, len(table.line)).T
    sensors = Kinematics(used_robot, hand).compute_sensor_poses(angles)
    if wrist_poses is not None:
        sensors = wrist_poses[:, None] @ sensors
    return HandMotion(table.source, _make_tracks(table, sensors, angles))


def read_poses(path: str | os.PathLike[str], hand: Hand, progress: Progress = ignore_progress) -> HandMotion:
    """Read poses: ``grasp[,time][,phase],link,x,y,z,qw,qx,qy,qz``, one row for each link and time.

    With a column board instead of link, the poses are those of the brackets of the boards. Optional: object_* poses.

    Raises ImportDataError for the first error in the file, HandGeometryError for a hand without links.
    """
    columns = (
        _GRASP,
        _TIME,
        _PHASE,
        Column("link", "text", ("body",)),
        Column("board", "text", ("sensor",)),
        *pose_columns("", required=True),
        *pose_columns("object"),
    )
    table = read_csv(path, columns, progress)
    if table.has("link") == table.has("board"):
        found = "both" if table.has("link") else "neither"
        table.source.at(1).fail("a column link or a column board", found, "name the link or the board of each pose")
    poses = table.poses("")
    assert poses is not None  # its columns are required
    if table.has("board"):
        names, key = [board.name for board in hand.boards], "board"
        bracket_poses = np.tile(np.eye(4), (len(names), 1, 1))
    else:
        if any(board.link_name is None or board.pose is None for board in hand.boards):
            raise HandGeometryError(hand.name)
        names, key = [str(board.link_name) for board in hand.boards], "link"
        bracket_poses = np.stack([board.pose for board in hand.boards if board.pose is not None])
    rows_by_time = _group_by_time(table, key, names)
    rows = np.array([[row_of_name[name] for name in names] for row_of_name in rows_by_time], np.intp)
    first = rows.min(axis=1)
    return HandMotion(table.source, _make_tracks(table, poses[rows] @ bracket_poses, None, first))


def _group_by_time(table: CsvTable, key: str, required_names: Sequence[str]) -> list[dict[str, int]]:
    """Return for each time of each grasp the row of every name in the column `key`.

    required_names: names that each time must have. Raises ImportDataError for a missing or repeated name.
    """
    names = table.texts[key]
    times = table.numbers.get("time", np.zeros(len(table.line)))
    rows_by_time: dict[tuple[str, float], dict[str, int]] = {}
    for row, (grasp, time) in enumerate(zip(table.texts["grasp"], times.tolist(), strict=True)):
        rows = rows_by_time.setdefault((grasp, time), {})
        if names[row] in rows:
            found = f"{format_value(names[row])} twice at {time:.9g} s"
            table.at(row, key).fail(f"each {key} once at a time", found, "remove one, or add a column time")
        rows[names[row]] = row
    for (grasp, time), rows in rows_by_time.items():
        for name in required_names:
            if name not in rows:
                found = f"none at {time:.9g} s of grasp {format_value(grasp)}"
                table.source.key(key).fail(f"a row of {name}", found, suggest_names(name, rows))
    return list(rows_by_time.values())


def _make_tracks(
    table: CsvTable, sensors: FloatArray, joints: FloatArray | None, first_rows: NDArray[np.intp] | None = None
) -> dict[str, GraspTrack]:
    """Divide the poses of the hand at k times into one track for each grasp, by name of the grasp.

    sensors: f64[k, s, 4, 4], brackets. joints: f64[k, j], radians, or None. first_rows: i64[k], row of the table that
    contains grasp, time, phase and object pose of each time; None: the table has one row for each time. Raises
    ImportDataError for times that do not increase within a grasp.
    """
    row_of_time = np.arange(len(table.line)) if first_rows is None else first_rows
    times_by_grasp: dict[str, list[int]] = {}
    for index, row in enumerate(row_of_time.tolist()):
        times_by_grasp.setdefault(table.texts["grasp"][row], []).append(index)
    objects = table.poses("object")
    tracks = {}
    for name, indices in times_by_grasp.items():
        selection = np.array(indices, np.intp)
        rows = row_of_time[selection]
        if len(rows) > 1 and not table.has("time"):
            location = table.at(rows[1], "grasp")
            location.fail("one row for a grasp", f"a second row of grasp {format_value(name)}", "add a column time")
        times = table.numbers["time"][rows] if table.has("time") else np.zeros(len(rows))
        decreasing = np.flatnonzero(np.diff(times) <= 0)
        if len(decreasing):
            index = int(decreasing[0])
            found = f"{times[index + 1]:.9g} after {times[index]:.9g}"
            remedy = "sort the rows by time, with each time once"
            table.at(rows[index + 1], "time").fail("increasing times within a grasp", found, remedy)
        phase = None
        if table.has("phase"):
            texts = table.texts["phase"]
            phase = np.array([parse_phase(texts[row], table.at(row, "phase")) for row in rows.tolist()], np.uint8)
        tracks[name] = GraspTrack(
            table.source,
            times,
            sensors[selection],
            phase,
            None if joints is None else joints[selection],
            None if objects is None else objects[rows],
        )
    return tracks


def parse_phase(value: str, location: FileLocation) -> int:
    """Convert the string of a phase (its name, or a number from 0 to 4) to the number of the phase.

    Raises ImportDataError for any other string.
    """
    text = value.strip().lower()
    if text not in {*_PHASES, *map(str, _PHASES.values())}:
        location.fail(f"0 to 4 or {', '.join(_PHASES)}", format_value(value), suggest_names(text, _PHASES))
    return _PHASES[text] if text in _PHASES else int(text)
