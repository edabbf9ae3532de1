"""Where the boards were over time: from joint angles, or from the poses of links or boards."""

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
from taxel.sim.importers.csv_table import Column, CsvTable, Progress, pose_columns, read_csv, silent
from taxel.sim.importers.errors import Source, near_names
from taxel.types import FloatArray

__all__ = ["WRIST_LINK", "GraspTrack", "HandMotion", "phase_number", "read_joints", "read_poses"]

WRIST_LINK = "palm"

OUTSIDE_S = 0.05
"""How far before the first or after the last known pose the hand is taken to stand still; one frame at 20 Hz."""

_GRASP = Column("grasp", "text", ("grasp_id", "id"), required=True)
_TIME = Column("time", aliases=("timestamp", "time_s", "stamp", "t"))
_PHASE = Column("phase", "text")
_PHASES = {phase.name.lower(): int(phase) for phase in Phase}


@dataclass(frozen=True, eq=False)
class GraspTrack:
    """The hand during one grasp, k moments.

    time_s: f64[k], rising. sensor_pose: f64[k, s, 4, 4], brackets in the world. phase: u8[k], or None if not given.
    joints: f64[k, j], radians, or None. object_pose: f64[k, 4, 4], world, or None.
    """

    source: Source
    time_s: FloatArray
    sensor_pose: FloatArray
    phase: NDArray[np.uint8] | None
    joints: FloatArray | None
    object_pose: FloatArray | None

    def at(self, time_s: FloatArray, grasp: str) -> GraspTrack:
        """The hand at times f64[T]: linear between the moments; a hand of one moment stands still."""
        known = self.time_s
        if len(known) == 1:
            pick = np.zeros(len(time_s), np.intp)
            return self._taken(time_s, pick, pick, np.zeros(len(time_s)))
        if time_s[0] < known[0] - OUTSIDE_S or time_s[-1] > known[-1] + OUTSIDE_S:
            found = f"{known[0]:.6g} to {known[-1]:.6g} s"
            wanted = f"times from {time_s[0]:.6g} to {time_s[-1]:.6g} s for grasp {format_value(grasp)}"
            self.source.fail(wanted, found, "record the hand as long as the contacts, on the same clock")
        after = np.clip(np.searchsorted(known, time_s), 1, len(known) - 1)
        share = np.clip((time_s - known[after - 1]) / (known[after] - known[after - 1]), 0.0, 1.0)
        return self._taken(time_s, after - 1, after, share)

    def _taken(
        self, time_s: FloatArray, before: NDArray[np.intp], after: NDArray[np.intp], share: FloatArray
    ) -> GraspTrack:
        exact = share == 1.0  # a recorded moment is taken as it stands, without rounding
        before, share = np.where(exact, after, before), np.where(exact, 0.0, share)
        joints = None
        if self.joints is not None:
            joints = self.joints[before] + share[:, None] * (self.joints[after] - self.joints[before])
        sensors = _between(self.sensor_pose, before, after, share)
        objects = None if self.object_pose is None else _between(self.object_pose, before, after, share)
        return GraspTrack(self.source, time_s, sensors, None, joints, objects)


def _between(poses: FloatArray, before: NDArray[np.intp], after: NDArray[np.intp], share: FloatArray) -> FloatArray:
    result = poses[before]
    moving = share > 0
    if moving.any():
        fraction = share[moving].reshape(-1, *([1] * (poses.ndim - 3)))
        result[moving] = interpolate(poses[before[moving]], poses[after[moving]], fraction)
    return result


@dataclass(frozen=True, eq=False)
class HandMotion:
    """The hand during all grasps of a file."""

    source: Source
    tracks: Mapping[str, GraspTrack]

    def of(self, grasp: str) -> GraspTrack:
        """The hand during a grasp; ImportDataError if the file lacks it."""
        if grasp not in self.tracks:
            self.source.key("grasp").fail(
                f"rows of grasp {format_value(grasp)}", "none", near_names(grasp, self.tracks)
            )
        return self.tracks[grasp]


def read_joints(
    path: str | os.PathLike[str], hand: Hand, wrist: FloatArray | None = None, progress: Progress = silent
) -> HandMotion:
    """Read joint angles: ``grasp[,time][,phase],<joint names>`` and, optionally, wrist_* and object_* poses.

    With the joints of the whole robot the world is its base. With those below the wrist alone, the wrist's pose in the
    world comes from the columns wrist_x ... wrist_qz, or from `wrist`, f64[4, 4]. Raises ImportDataError.
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
    whole, below = robot, robot.get_subtree(WRIST_LINK) if WRIST_LINK in robot.link_names else robot
    arm = [name for name in names if name not in below.joint_names]
    wrist_poses = table.poses("wrist")
    if wrist_poses is None and wrist is not None:
        wrist_poses = np.broadcast_to(wrist, (len(table.line), 4, 4))
    has_arm = any(table.has(name) for name in arm)
    used: Robot = whole if has_arm else below
    if has_arm and wrist_poses is not None:
        remedy = "leave out one of the two"
        table.source.at(1).fail("joints of the arm or a pose of the wrist", "both", remedy)
    missing = [name for name in used.joint_names if not table.has(name)]
    if missing:
        table.source.at(1).fail(f"a column {missing[0]}", "none", f"add the angles, radians, of {', '.join(missing)}")
    if arm and not has_arm and wrist_poses is None:
        expected = f"{len(names)} joints, or {len(below.joint_names)} and where the wrist is"
        remedy = "add the arm's joints or wrist_x ... wrist_qz, or give the wrist's pose (--wrist)"
        table.source.at(1).fail(expected, f"{len(below.joint_names)} joints alone", remedy)
    angles = np.array([table.numbers[name] for name in used.joint_names]).reshape(-1, len(table.line)).T
    sensors = Kinematics(used, hand).compute_sensor_poses(angles)
    if wrist_poses is not None:
        sensors = wrist_poses[:, None] @ sensors
    return HandMotion(table.source, _tracks(table, sensors, angles))


def read_poses(path: str | os.PathLike[str], hand: Hand, progress: Progress = silent) -> HandMotion:
    """Read poses: ``grasp[,time][,phase],link,x,y,z,qw,qx,qy,qz``, a row for each link and moment.

    Instead of link, the column may be board: the rows are then of the boards' brackets. Optionally object_* poses.
    Raises ImportDataError.
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
        table.source.at(1).fail("a column link or a column board", found, "say of what the poses are")
    poses = table.poses("")
    assert poses is not None  # its columns are required
    if table.has("board"):
        wanted, key = [board.name for board in hand.boards], "board"
        after = np.tile(np.eye(4), (len(wanted), 1, 1))
    else:
        if any(board.link_name is None or board.pose is None for board in hand.boards):
            raise HandGeometryError(hand.name)
        wanted, key = [str(board.link_name) for board in hand.boards], "link"
        after = np.stack([board.pose for board in hand.boards if board.pose is not None])
    moments = _moments(table, table.texts[key], wanted, key)
    rows = np.array([[moment[name] for name in wanted] for moment in moments], np.intp)
    first = rows.min(axis=1)
    return HandMotion(table.source, _tracks(table, poses[rows] @ after, None, first))


def _moments(table: CsvTable, names: Sequence[str], wanted: Sequence[str], key: str) -> list[dict[str, int]]:
    """For each moment of each grasp, the row of every name."""
    times = table.numbers.get("time", np.zeros(len(table.line)))
    moments: dict[tuple[str, float], dict[str, int]] = {}
    for row, (grasp, time) in enumerate(zip(table.texts["grasp"], times.tolist(), strict=True)):
        rows = moments.setdefault((grasp, time), {})
        if names[row] in rows:
            found = f"{format_value(names[row])} twice at {time:.9g} s"
            table.at(row, key).fail(f"each {key} once at a time", found, "remove one, or add a column time")
        rows[names[row]] = row
    for (grasp, time), rows in moments.items():
        for name in wanted:
            if name not in rows:
                found = f"none at {time:.9g} s of grasp {format_value(grasp)}"
                table.source.key(key).fail(f"a row of {name}", found, near_names(name, rows))
    return list(moments.values())


def _tracks(
    table: CsvTable, sensors: FloatArray, joints: FloatArray | None, rows: NDArray[np.intp] | None = None
) -> dict[str, GraspTrack]:
    """Sort moments into grasps. sensors, joints: [k, ...]; rows: [k], the table's row of each moment; None: all."""
    of_moment = np.arange(len(table.line)) if rows is None else rows
    own: dict[str, list[int]] = {}
    for moment, row in enumerate(of_moment.tolist()):
        own.setdefault(table.texts["grasp"][row], []).append(moment)
    objects = table.poses("object")
    result = {}
    for name, moments in own.items():
        pick = np.array(moments, np.intp)
        if len(pick) > 1 and not table.has("time"):
            place = table.at(of_moment[pick[1]], "grasp")
            place.fail("one row for a grasp", f"grasp {format_value(name)} again", "add a column time")
        times = table.numbers["time"][of_moment[pick]] if table.has("time") else np.zeros(len(pick))
        back = np.flatnonzero(np.diff(times) <= 0)
        if len(back):
            place = table.at(of_moment[pick[back[0] + 1]], "time")
            found = f"{times[back[0] + 1]:.9g} after {times[back[0]]:.9g}"
            place.fail("times that rise within a grasp", found, "put the rows in order, each moment once")
        own_rows = of_moment[pick]
        phase = None
        if table.has("phase"):
            texts = table.texts["phase"]
            values = [phase_number(texts[row], table.at(row, "phase")) for row in own_rows.tolist()]
            phase = np.array(values, np.uint8)
        result[name] = GraspTrack(
            table.source,
            times,
            sensors[pick],
            phase,
            None if joints is None else joints[pick],
            None if objects is None else objects[own_rows],
        )
    return result


def phase_number(value: str, place: Source) -> int:
    """A phase from its number, 0 to 4, or its name."""
    text = value.strip().lower()
    if text not in {*_PHASES, *map(str, _PHASES.values())}:
        place.fail(f"0 to 4 or {', '.join(_PHASES)}", format_value(value), near_names(text, _PHASES))
    return _PHASES[text] if text in _PHASES else int(text)
