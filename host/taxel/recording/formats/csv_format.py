"""A recording as a folder of CSV files.

`NAME.csv` contains the frames of one board, one in a row: address, time and raw counts, as the messages of the thesis
(section 3.2, Figure 3.10). `active.csv` contains the coordinates of the active taxels, as the output of the thesis's
simulator (section 4.2, Figure 4.6). `joints.csv` contains the measured joint angles of each poll cycle.
"""

import heapq
import os
from collections.abc import Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any, TextIO

import numpy as np

from taxel.hand import Hand
from taxel.hand.joint_history import JointFileWriter, JointHistory
from taxel.input_files import TextError, read_regular_file
from taxel.input_files.csv_rows import parse_float, parse_integer, read_csv_rows
from taxel.link import CaptureError
from taxel.output import LiveOutput
from taxel.recording.formats.frame_table import (
    HEADER_MAX,
    check_frame,
    convert_output_errors,
    fail,
    format_header,
    open_target,
    parse_header,
)
from taxel.ros.contacts import POINT
from taxel.ros.topics import SkinTopics
from taxel.stream import TaxelFrame
from taxel.stream.encoder import FramesLink

HEADER_FILE = "recording.json"
ACTIVE_FILE = "active.csv"
JOINTS_FILE = "joints.csv"
COLUMNS = ("frame", "address", "time_s", "sequence", "cycle", "board_time_us", "hub_time_us")
ACTIVE_COLUMNS = ("grasp", "object", "approach", "time", "x", "y", "z", "active")
"""Columns of `active.csv`, which `taxel import active` reads."""


class CsvSink:
    """Writer of a recording as a folder of CSV files, one for each board.

    The folder gets its final name when it is complete.
    """

    def __init__(
        self,
        path: Path,
        hand: Hand,
        header: Mapping[str, Any],
        topics: SkinTopics | None = None,
        grasp: tuple[str, str] = ("unknown", "recording"),
        joints: JointHistory | None = None,
        overwrite: bool = False,
    ) -> None:
        """Create the folder under a temporary name, and write the recording's header to it.

        path: final name of the folder. topics: computes the positions of the active taxels for `active.csv`; None: no
        such file. grasp: (object, approach), which `active.csv` repeats in each row. joints: measured joint angles,
        written to `joints.csv` for each poll cycle. overwrite: replace an existing recording. Raises CaptureError.
        """
        self._path = path
        self._names = {board.address: board.name for board in hand.boards}
        self._files: dict[int, TextIO] = {}
        self._frames = 0
        self._topics = topics
        self._grasp = ",".join(grasp)
        self._joints = joints
        self._joint_writer: JointFileWriter | None = None
        self._active: TextIO | None = None
        if path.exists() and not (path / HEADER_FILE).is_file():
            raise CaptureError(os.fspath(path), "is no folder of a recording, so it is not overwritten")
        with open_target(path, overwrite, is_folder=True) as pending:
            self._pending = pending
            (pending.part / HEADER_FILE).write_text(format_header(header))
            if joints is not None:
                output = LiveOutput.without_name(pending.part / JOINTS_FILE)
                self._joint_writer = JointFileWriter(output, joints.names)
            if topics is not None and topics.tree.has_geometry:
                self._active = self._create_file(ACTIVE_FILE, ACTIVE_COLUMNS)

    def _create_file(self, name: str, columns: tuple[str, ...]) -> TextIO:
        """Open a new CSV file in the unfinished folder and write the line of column names."""
        file = (self._pending.part / name).open("w", newline="")
        file.write(",".join(columns) + "\n")
        return file

    def take(self, frame: TaxelFrame) -> None:
        """Append a taxel frame to the CSV files. Raises CaptureError if the system refuses."""
        with convert_output_errors(self._path):
            self._write_frame(frame)

    def _write_frame(self, frame: TaxelFrame) -> None:
        """Append a taxel frame as a row to the CSV file of its board, and the active taxels to `active.csv`."""
        file = self._files.get(frame.address)
        if file is None:
            taxels = tuple(f"taxel_{index}" for index in range(len(frame.raw_counts)))
            name = f"{self._names[frame.address]}.csv"
            file = self._files[frame.address] = self._create_file(name, COLUMNS + taxels)
        numbers = (frame.sequence, frame.cycle, frame.board_time_us, frame.hub_time_us, *frame.raw_counts.tolist())
        file.write(f"{self._frames},{frame.address},{frame.time_s!r}," + ",".join(map(str, numbers)) + "\n")
        self._frames += 1
        self._write_joints(frame)
        if self._active is not None and self._topics is not None:
            for message in self._topics.take(frame):
                if message.topic == "/taxel/contact_cloud":
                    self._write_active(self._active, frame.time_s, message.message["data"])

    def _write_joints(self, frame: TaxelFrame) -> None:
        """Write the joint angles at the time of the first frame of each poll cycle to `joints.csv`."""
        if self._joints is None or self._joint_writer is None:
            return
        self._joint_writer.write_frame(self._joints, frame.cycle, frame.time_s)

    def _write_active(self, file: TextIO, time_s: float, data: bytes) -> None:
        """Append the points of a contact cloud to `active.csv`; data: points of dtype `POINT` as bytes."""
        for point in np.frombuffer(data, POINT):
            file.write(f"1,{self._grasp},{time_s!r},{point['x']},{point['y']},{point['z']},1\n")

    def close(self, is_complete: bool) -> None:
        """Close all files and give the folder its final name, or delete the folder if it is not complete."""
        try:
            if is_complete:
                with convert_output_errors(self._path):
                    for file in self._list_files():
                        file.close()
                    if self._joint_writer is not None and self._joints is not None:
                        self._joint_writer.finish(self._joints)
                    self._pending.commit()
        finally:
            for file in self._list_files():
                with suppress(OSError):  # the first failure is raised above
                    file.close()
            if self._joint_writer is not None:
                self._joint_writer.discard()
            self._pending.discard()

    def _list_files(self) -> list[TextIO]:
        """Return the open files of frames and active taxels."""
        return [*self._files.values(), *([] if self._active is None else [self._active])]


def open_csv(path: Path) -> FramesLink:
    """Open a recording in a folder of CSV files as a link.

    Raises RecordingFormatError for an error in the header. The link raises it for the first malformed row, when this
    row is read.
    """
    header_file = path / HEADER_FILE
    try:
        header = parse_header(read_regular_file(header_file, HEADER_MAX), header_file)
    except OSError:
        fail(path, HEADER_FILE, "the header that taxel convert writes", "none", "give a folder from taxel convert")
    files = sorted(file for file in path.glob("*.csv") if file.name not in (ACTIVE_FILE, JOINTS_FILE))
    rows = heapq.merge(*(_read_rows(file) for file in files), key=lambda row: row[0])
    link = FramesLink(os.fspath(path), (frame for _, frame in rows))
    link.header = header
    return link


def _read_rows(path: Path) -> Iterator[tuple[int, TaxelFrame]]:
    """Yield (frame number, taxel frame) for each row of a CSV file of one board.

    Raises RecordingFormatError for the first malformed row.
    """
    try:
        lines = read_csv_rows(path)
        heading = tuple(next(lines, (1, []))[1])
        if heading[: len(COLUMNS)] != COLUMNS:
            fail(path, "line 1", ",".join(COLUMNS), ",".join(heading)[:80], "restore the original columns")
        for number, line in lines:
            if len(line) != len(heading):
                fail(path, f"line {number}", f"{len(heading)} columns", len(line), "check that the file is complete")
            yield _parse_row(line, path, number)
    except OSError as error:
        fail(path, "file", "a readable CSV file", error.strerror, "restore the folder of taxel convert")
    except TextError as error:
        fail(path, error.position, error.expected, error.found, "correct the line")


def _parse_row(line: list[str], path: Path, number: int) -> tuple[int, TaxelFrame]:
    """Return (frame number, taxel frame) of a row of a CSV file.

    line: entries of the row. number: line number for error messages. Raises RecordingFormatError.
    """
    try:
        values: dict[str, float] = {
            name: parse_integer(text) for name, text in zip(COLUMNS, line, strict=False) if name != "time_s"
        }
        values["time_s"] = parse_float(line[2])
        counts = list(map(parse_integer, line[len(COLUMNS) :]))
    except ValueError as error:
        fail(path, f"line {number}", "numbers", str(error)[:60], "correct the line")
    return int(values["frame"]), check_frame(values, counts, path, f"line {number}")
