"""A recording as the only grasp of a grasp dataset: one row for each poll cycle, written and read in blocks."""

import os
from collections.abc import Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from taxel.grasp.objects import make_thesis_objects
from taxel.grasp.timeline import Phase
from taxel.hand import Hand
from taxel.hand.errors import format_path, format_value
from taxel.hand.joint_history import JointHistory
from taxel.hand.kinematics import build_kinematics
from taxel.output import LiveOutput, PendingOutput
from taxel.recording.errors import DatasetError
from taxel.recording.formats.frame_table import fail
from taxel.recording.formats.grasp_options import UNKNOWN_OBJECT, GraspOptions
from taxel.recording.grasp_checks import Location
from taxel.recording.grasp_dataset import GraspDataset
from taxel.recording.grasp_format import REAL
from taxel.recording.grasp_hdf5 import open_hdf5
from taxel.recording.grasp_storage import (
    convert_writing_errors,
    create_group,
    link_grasp,
    write_array,
    write_attributes,
)
from taxel.recording.grasp_tables import ObjectMesh, SensorTable, TaxelTable
from taxel.recording.grasp_writer import DatasetHeader, GraspDatasetWriter
from taxel.recording.hdf5_output import extend_hdf5
from taxel.stream import TaxelFrame
from taxel.stream.cycles import CycleSorter
from taxel.stream.encoder import FramesLink
from taxel.types import ByteArray, FloatArray, IndexArray

BLOCK_ROWS = 256
"""Rows in memory at one time, and rows of a chunk in the file."""

_WRAP_US = 1 << 32
_TYPES = {
    "timestamp": "f8", "phase": "u1", "raw_counts": "u2", "valid": "?", "sensor_time": "f8", "joint_position": "f8",
    "sensor_pose_t": "f8",
}  # fmt: skip


class Hdf5Sink:
    """Writer of a recording as an HDF5 dataset with one grasp. The file gets its final name when it is complete."""

    def __init__(
        self,
        path: Path,
        hand: Hand,
        generator: str,
        options: GraspOptions,
        joint_position: FloatArray | JointHistory | None,
        overwrite: bool,
    ) -> None:
        """Create an HDF5 dataset of one grasp, to which the recorded frames are then added.

        path: final name of the file; it is written under another name until it is complete. generator: name and version
        of the writing program. joint_position: f64[j], radians; None: all 0; a history gives the angles and the
        poses of the sensors of every row. Raises DatasetError for an unknown object, and HandGeometryError for a
        hand description without geometry.
        """
        self._hand, self._options = hand, options
        self._location = Location(str(path))
        kinematics = build_kinematics(hand)
        self._measured = joint_position if isinstance(joint_position, JointHistory) else None
        self._kinematics = kinematics
        if isinstance(joint_position, JointHistory):
            self._joints = joint_position.interpolate(float("-inf"))  # the first measured angles
        else:
            self._joints = np.zeros(len(kinematics.robot.joint_names)) if joint_position is None else joint_position
        self._pose = kinematics.compute_sensor_poses(self._joints)
        objects = _make_objects(options.object, self._location)
        with convert_writing_errors(self._location):
            self._pending = PendingOutput(path, overwrite=overwrite)
        try:
            _create_dataset(self._pending.part, hand, generator, objects)
            self._output = LiveOutput.without_name(self._pending.part)
            self._file = extend_hdf5(self._output, self._location)
            self._group = create_group(self._file, None)
        except DatasetError as error:
            self._pending.discard()
            raise DatasetError(format_path(path), *error.args[1:]) from None
        except BaseException:
            self._pending.discard()
            raise
        self._columns = {board.address: column for column, board in enumerate(hand.boards)}
        self._sorter = CycleSorter(len(hand.boards))
        self._rows: list[dict[str, Any]] = []
        self._count = 0
        self._frames = np.zeros(len(hand.boards))
        self._span = [0.0, 0.0]
        self._counts = np.zeros(hand.n_taxels, np.uint16)
        self._clock = np.zeros(len(hand.boards))
        self._last_us: dict[int, int] = {}

    def take(self, frame: TaxelFrame) -> None:
        """Add a taxel frame to the row of its poll cycle, and write complete rows to the HDF5 file."""
        self._sorter.add(frame)
        self._write_cycles(is_end=False)

    def _write_cycles(self, is_end: bool) -> None:
        """Add a row for each complete poll cycle; is_end: the recording has ended, so all cycles are complete."""
        while (frames := self._sorter.pop(is_end)) is not None:
            self._add_row(frames)

    def _add_row(self, frames: list[TaxelFrame]) -> None:
        """Add the frames of one poll cycle as a row of the grasp; a board without a frame keeps its last counts."""
        valid = np.zeros(len(self._columns), dtype=bool)
        for frame in frames:
            column = self._columns[frame.address]
            valid[column] = True
            self._counts[self._hand.get_slice(frame.address)] = frame.raw_counts
            self._clock[column] += self._compute_elapsed_us(frame) * 1e-6
        # The times of the rows must not decrease.
        time_s = max(min(frame.time_s for frame in frames), self._span[1] if self._count else 0.0)
        self._span = [time_s if not self._count else self._span[0], time_s]
        phase = Phase.BASELINE if self._count < self._options.baseline_frames else Phase.HOLD
        self._frames += valid
        poses = {}
        if self._measured is not None:
            self._joints = self._measured.interpolate(time_s)
            poses["sensor_pose_t"] = self._kinematics.compute_sensor_poses(self._joints)
            self._pose = poses["sensor_pose_t"]
        self._rows.append(
            poses
            | {
                "timestamp": time_s,
                "phase": int(phase),
                "raw_counts": self._counts.copy(),
                "valid": valid,
                "sensor_time": self._clock.copy(),
                "joint_position": self._joints,
            }
        )
        self._count += 1
        if len(self._rows) >= BLOCK_ROWS:
            self._write_block()

    def _compute_elapsed_us(self, frame: TaxelFrame) -> int:
        """Return the time since the board's last frame on the board's clock, microseconds, and store the frame's time.

        For the first frame of a board the result is the reading of its clock. The clock wraps at 2^32 us; the result
        is negative if the clock went back.
        """
        last = self._last_us.get(frame.address)
        self._last_us[frame.address] = frame.board_time_us
        if last is None:
            return frame.board_time_us
        return (frame.board_time_us - last + _WRAP_US // 2) % _WRAP_US - _WRAP_US // 2

    def _write_block(self) -> None:
        """Append the collected rows to the arrays of the HDF5 file."""
        with convert_writing_errors(self._location):
            for name, dtype in _TYPES.items():
                if name not in self._rows[0]:
                    continue
                block = np.stack([row[name] for row in self._rows]).astype(dtype)
                if name not in self._group:
                    self._group.create_dataset(
                        name,
                        data=block,
                        maxshape=(None, *block.shape[1:]),
                        chunks=(BLOCK_ROWS, *block.shape[1:]),
                        compression="gzip",
                        compression_opts=1,
                        shuffle=True,
                        track_times=False,
                    )
                else:
                    data = self._group[name]
                    data.resize(len(data) + len(block), axis=0)
                    data[-len(block) :] = block
            self._file.check()
        self._rows.clear()

    def close(self, is_complete: bool) -> None:
        """Complete and check the dataset and give the file its final name, or delete it if it is not complete."""
        try:
            if is_complete:
                self._finish()
                with convert_writing_errors(self._location):
                    self._file.close()
                    GraspDataset(self._pending.part).close()
                    self._pending.commit()
        finally:
            with suppress(OSError):  # the first failure of a write is raised above
                self._file.close()
            self._output.file.close()
            self._pending.discard()

    def _finish(self) -> None:
        """Write the last rows and the attributes, and link the grasp to the dataset.

        Raises DatasetError without frames.
        """
        self._write_cycles(is_end=True)
        if not self._count:
            self._location.fail("at least one frame", "none", "give a recording with frames")
        if self._rows:
            self._write_block()
        with convert_writing_errors(self._location):
            write_array(self._group, "sensor_pose", self._pose)
            write_array(self._group, "object_pose", np.eye(4))
            options = self._options
            names = {"object": options.object, "approach": options.approach}
            write_attributes(self._group, {**names, "iteration": 0, "session": options.session})
            span_s = self._span[1] - self._span[0]
            rates = (self._frames - 1) / span_s if span_s > 0 else self._frames
            # The format requires a rate above 0, also for a board without frames.
            self._file["sensors/rate_hz"][...] = np.maximum(rates, 1e-6)
            link_grasp(self._file, self._group, "0001")


def _create_dataset(path: Path, hand: Hand, generator: str, objects: dict[str, ObjectMesh]) -> None:
    """Create the dataset file of a real hand without grasps.

    The sensor rates written here are placeholders, which the measured rates replace when the recording has ended.
    generator: name and version of the writing program. objects: meshes by name.
    """
    taxels = TaxelTable(hand.sensor, hand.tx, hand.rx, hand.position, hand.normal, np.full(hand.n_taxels, hand.size_m))
    sensors = SensorTable(
        np.array([board.address for board in hand.boards], np.uint8),
        tuple(board.name for board in hand.boards),
        tuple(board.kind.name for board in hand.boards),
        np.ones(len(hand.boards)),
    )
    header = DatasetHeader(REAL, hand.name, taxels, sensors, objects, generator)
    GraspDatasetWriter.create_part(path, header).close()


def _make_objects(name: str, location: Location) -> dict[str, ObjectMesh]:
    """Return {name: mesh} of the object `name`; for the name "unknown" the mesh is a microscopic triangle.

    The dataset format requires a mesh. Raises DatasetError for a name that is not one of the three test
    objects of the thesis (the source of the skin's design).
    """
    if name == UNKNOWN_OBJECT:
        vertices = np.array([[0.0, 0.0, 0.0], [1e-6, 0.0, 0.0], [0.0, 1e-6, 0.0]])
        return {UNKNOWN_OBJECT: ObjectMesh(vertices, np.array([[0, 1, 2]], np.int32))}
    known = make_thesis_objects()
    if name not in known:
        location.key("objects").fail(
            f"one of {', '.join([*known, UNKNOWN_OBJECT])}", format_value(name), "correct --object"
        )
    vertices, faces = known[name].shape.mesh()
    return {name: ObjectMesh(vertices, faces.astype(np.int32))}


def open_hdf5_recording(path: Path, grasp: str | None = None) -> FramesLink:
    """Open one grasp of a dataset as a link that plays its frames.

    grasp: id of the grasp; None only for a dataset with one grasp. Raises DatasetError for a damaged dataset or an
    unknown grasp.
    """
    with GraspDataset(path) as data:
        if grasp is None and len(data) != 1:
            fail(path, "/grasps", "one grasp", f"{len(data)}", "select one with --grasp ID")
        selected = data[data.ids[0] if grasp is None else grasp]
        link = FramesLink(
            os.fspath(path), _read_frames(path, selected.id, data.sensors.address, _group_taxels_by_sensor(data))
        )
        link.header = {"hand": data.hand}
        return link


def _group_taxels_by_sensor(data: GraspDataset) -> list[IndexArray]:
    """Return for each sensor of a dataset the indices of its taxels on the taxel axis."""
    return [np.flatnonzero(data.taxels.sensor == address) for address in data.sensors.address]


def _read_frames(path: Path, grasp: str, addresses: ByteArray, taxels: list[IndexArray]) -> Iterator[TaxelFrame]:
    """Yield the taxel frames of a grasp of a dataset, read in blocks of rows.

    The row number is both cycle and scan number, because a dataset contains neither. Without the array sensor_time the
    row's time replaces the board's clock. grasp: id. addresses: u8[s], I2C address of each sensor. taxels: for each
    sensor the indices of its taxels.
    """
    with open_hdf5(path, "r") as file:
        group: Mapping[str, Any] = file["grasps"][grasp]
        for start in range(0, len(group["timestamp"]), BLOCK_ROWS):
            rows = slice(start, start + BLOCK_ROWS)
            times, valid, counts = (group[name][rows] for name in ("timestamp", "valid", "raw_counts"))
            if not np.isfinite(times).all() or (times < 0.0).any():
                fail(path, f"/grasps/{grasp}/timestamp", "seconds, 0 or more", "other values", "correct them")
            has_clock = "sensor_time" in group
            clock = group["sensor_time"][rows] if has_clock else np.repeat(times[:, None], len(addresses), axis=1)
            board_us = np.nan_to_num(np.round(clock * 1e6)).astype(np.int64) % _WRAP_US
            for row, time_s in enumerate(times.tolist()):
                number = (start + row) % 65_536
                hub_us = round(time_s * 1e6) % _WRAP_US
                for column in np.flatnonzero(valid[row]).tolist():
                    yield TaxelFrame(
                        int(addresses[column]), number, number, time_s, int(board_us[row, column]), hub_us,
                        counts[row, taxels[column]].astype(np.uint16),
                    )  # fmt: skip
