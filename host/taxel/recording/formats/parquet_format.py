"""A recording as a Parquet file: one row for each frame, with the raw counts as a list. Needs pyarrow."""

import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from taxel.hand import Hand
from taxel.hand.joint_history import JointHistory
from taxel.input_files import check_regular_file
from taxel.input_files.text_error import format_reason
from taxel.optional import optional_import
from taxel.recording.formats.frame_table import (
    check_frame,
    convert_output_errors,
    fail,
    format_header,
    open_target,
    parse_header,
)
from taxel.stream import TaxelFrame
from taxel.stream.encoder import FramesLink

BLOCK_ROWS = 4096
"""Rows in memory at one time, and rows of a row group in the file."""

JOINT_COLUMN = "joint_position"
"""Optional column: joint angles at the time of the frame, radians, in the order of the robot's joints."""

METADATA_KEY = b"taxel"


def _import_pyarrow() -> tuple[Any, Any]:
    """Import and return the modules pyarrow and pyarrow.parquet. Raises MissingPackageError without pyarrow."""
    with optional_import("pyarrow", "a Parquet recording"):
        import pyarrow
        import pyarrow.parquet
    return pyarrow, pyarrow.parquet


def _make_schema(arrow: Any, has_joints: bool = False) -> Any:
    """Return the schema of the Parquet columns; one row is one frame of a board. arrow: the module pyarrow."""
    joints = [(JOINT_COLUMN, arrow.list_(arrow.float64()))] if has_joints else []
    return arrow.schema(
        [
            ("time_s", arrow.float64()),
            ("address", arrow.uint8()),
            ("name", arrow.dictionary(arrow.int32(), arrow.string())),
            ("sequence", arrow.uint16()),
            ("cycle", arrow.uint16()),
            ("board_time_us", arrow.uint32()),
            ("hub_time_us", arrow.uint32()),
            ("raw_counts", arrow.list_(arrow.uint16())),
            *joints,
        ]
    )


class ParquetSink:
    """Writer of a recording as a Parquet file, which gets its final name when it is complete."""

    def __init__(
        self,
        path: Path,
        hand: Hand,
        header: Mapping[str, Any],
        joints: JointHistory | None = None,
        overwrite: bool = False,
    ) -> None:
        """Create a Parquet file for taxel frames under a temporary name.

        header: header of the recording, stored as metadata of the file. joints: measured joint angles, stored for each
        frame in the column `joint_position`. overwrite: replace an existing file. Raises CaptureError.
        """
        self._joints = joints
        self._arrow, parquet = _import_pyarrow()
        self._path = path
        self._schema = _make_schema(self._arrow, joints is not None)
        text = format_header(header).encode()
        with open_target(path, overwrite) as pending:
            self._pending = pending
            # The file is opened here, because pyarrow prints a line if it cannot close a file that it opened itself.
            self._stream: BinaryIO = pending.part.open("wb")
            self._writer = parquet.ParquetWriter(self._stream, self._schema.with_metadata({METADATA_KEY: text}))
        self._names = {board.address: board.name for board in hand.boards}
        self._rows: list[TaxelFrame] = []

    def take(self, frame: TaxelFrame) -> None:
        """Add a taxel frame to the rows of the Parquet file."""
        self._rows.append(frame)
        if len(self._rows) >= BLOCK_ROWS:
            with convert_output_errors(self._path):
                self._write_block()

    def _write_block(self) -> None:
        """Append the collected frames to the Parquet file as one row group."""
        columns: dict[str, Any] = {name: [getattr(frame, name) for frame in self._rows] for name in self._schema.names
                                   if name not in ("name", JOINT_COLUMN)}  # fmt: skip
        if self._joints is not None:
            columns[JOINT_COLUMN] = [self._joints.interpolate(frame.time_s).tolist() for frame in self._rows]
        columns["name"] = [self._names[frame.address] for frame in self._rows]
        arrays = [self._arrow.array(columns[name], self._schema.field(name).type) for name in self._schema.names]
        self._writer.write_table(self._arrow.Table.from_arrays(arrays, schema=self._schema))
        self._rows.clear()

    def close(self, is_complete: bool) -> None:
        """Write the last rows and give the Parquet file its final name, or delete it if it is not complete."""
        try:
            if is_complete:
                with convert_output_errors(self._path):
                    if self._rows:
                        self._write_block()
                    self._writer.close()
                    self._stream.close()
                    self._pending.commit()
        finally:
            with suppress(Exception):  # the first failure is raised above; the library raises it again here
                self._writer.close()
            with suppress(OSError):
                self._stream.close()
            self._pending.discard()


def open_parquet(path: Path) -> FramesLink:
    """Open a recording in a Parquet file as a link. Raises RecordingFormatError for a file that is no recording."""
    arrow, parquet = _import_pyarrow()
    try:
        check_regular_file(path)
    except OSError as error:
        fail(path, "file", "a readable Parquet file", error.strerror, "give one of taxel convert")
    try:
        file = parquet.ParquetFile(path)
        schema = file.schema_arrow
    except Exception as error:  # pyarrow raises several types for a damaged file
        fail(path, "file", "a complete Parquet file", format_reason(error), "give one of taxel convert")
    try:
        metadata = schema.metadata or {}
        if METADATA_KEY not in metadata:
            fail(path, "metadata", "the header that taxel convert writes", "none", "give a file from taxel convert")
        _check_columns(path, arrow, schema)
        link = FramesLink(os.fspath(path), _read_frames(path, file))
        link.header = parse_header(metadata[METADATA_KEY], path)
    except BaseException:
        file.close()
        raise
    return link


def _check_columns(path: Path, arrow: Any, schema: Any) -> None:
    """Raise RecordingFormatError for a missing or repeated column, or a column of another type.

    Integers of any size are permitted, because other programs write larger ones; their values are checked row by row.
    """
    expected = _make_schema(arrow, JOINT_COLUMN in schema.names)
    for column in expected:
        if schema.names.count(column.name) != 1:
            found = f"no {column.name}" if column.name not in schema.names else f"{column.name} twice"
            fail(path, "columns", ", ".join(_make_schema(arrow).names), found, "restore the original columns")
        found_type = schema.field(column.name).type
        if not _is_compatible(arrow, found_type, column.type):
            fail(path, f"column {column.name}", str(column.type), str(found_type), "restore the original columns")


def _is_compatible(arrow: Any, found: Any, expected: Any) -> bool:
    """Whether values of the Arrow type `found` can be read as values of the type `expected`."""
    types = arrow.types
    if types.is_dictionary(expected):
        text = found.value_type if types.is_dictionary(found) else found
        return bool(types.is_string(text) or types.is_large_string(text))
    if types.is_list(expected):
        is_list = types.is_list(found) or types.is_large_list(found) or types.is_fixed_size_list(found)
        return bool(is_list and _is_compatible(arrow, found.value_type, expected.value_type))
    if types.is_floating(expected):
        return bool(types.is_float32(found) or types.is_float64(found))
    return bool(types.is_integer(found))


def read_parquet_joints(path: Path, names: Sequence[str]) -> JointHistory | None:
    """Read the joint angles of a Parquet file over time; None if it has no such column or cannot be read.

    names: names of the robot's joints. Raises RecordingFormatError for a row with another number of joints, or with a
    value that is not finite.
    """
    arrow, parquet = _import_pyarrow()
    try:
        check_regular_file(path)
        file = parquet.ParquetFile(path)
        has_joints = JOINT_COLUMN in file.schema_arrow.names
    except Exception:  # as in `open_parquet`: the reader of the frames reports the damage
        return None
    with file:
        if not has_joints:
            return None
        _check_columns(path, arrow, file.schema_arrow)
        history = JointHistory(names, os.fspath(path))
        for number, row in _read_rows(path, file, ["time_s", JOINT_COLUMN]):
            angles = np.array([np.nan if angle is None else angle for angle in row[JOINT_COLUMN]], dtype=np.float64)
            if angles.shape != (len(names),) or not np.isfinite(angles).all():
                expected = f"{len(names)} finite angles"
                fail(path, f"row {number}, {JOINT_COLUMN}", expected, str(row[JOINT_COLUMN])[:60], "correct the row")
            if row["time_s"] > history.last_s:  # boards of one cycle may arrive out of order
                history.add(row["time_s"], angles)
    return history


def _read_frames(path: Path, file: Any) -> Iterator[TaxelFrame]:
    """Yield the taxel frames of all rows of a Parquet file.

    Raises RecordingFormatError for a row with a missing value.
    """
    names = [name for name in _make_schema(_import_pyarrow()[0]).names if name != "name"]
    with file:
        for number, row in _read_rows(path, file, names):
            yield check_frame(row, row["raw_counts"], path, f"row {number}")


def _read_rows(path: Path, file: Any, names: Sequence[str]) -> Iterator[tuple[int, dict[str, Any]]]:
    """Yield (row number from 1, values by column) of all rows of a Parquet file.

    names: columns to read. Raises RecordingFormatError for a damaged page and for a row with a missing value.
    """
    number = 0
    batches = iter(file.iter_batches(batch_size=BLOCK_ROWS, columns=list(names)))
    while True:
        try:
            batch = next(batches, None)
            rows = [] if batch is None else batch.to_pylist()
        except Exception as error:  # as in `open_parquet`
            fail(path, f"rows after {number}", "undamaged data", format_reason(error), "copy the file again")
        if batch is None:
            return
        for row in rows:
            number += 1
            empty = [name for name, value in row.items() if value is None]
            if empty:
                fail(path, f"row {number}, {empty[0]}", "a value", "none", "correct the row")
            yield number, row
