"""Common parts of the formats that store a table of frames: header, columns, and checks of a row from a file."""

import json
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NoReturn, Protocol

import numpy as np

from taxel.errors import FieldError
from taxel.hand.errors import format_path, format_value
from taxel.input_files import TextError, parse_json
from taxel.link import CaptureError
from taxel.link.live_records import EXISTS
from taxel.link.recording_header import check_recording_header
from taxel.output import OutputError, PendingOutput
from taxel.stream import TaxelFrame

FORMAT = "taxel-recording"
VERSION = 1
HEADER_MAX = 1 << 22
"""Largest size of a header, bytes."""

LARGEST_TIME_S = 1e11
"""Largest time of a frame, seconds. A float64 above this value does not resolve 1 microsecond safely."""

INTEGER_COLUMNS: Mapping[str, int] = {
    "address": 127, "sequence": 65_535, "cycle": 65_535, "board_time_us": 2**32 - 1, "hub_time_us": 2**32 - 1,
}  # fmt: skip
"""Integer columns of a frame, and the largest value of each."""


class RecordingFormatError(FieldError):
    """Error: a recording in CSV, Parquet or HDF5 cannot be read."""


class FrameSink(Protocol):
    """Interface of the writers of taxel frames to a recording."""

    def take(self, frame: TaxelFrame) -> None:
        """Write one frame. Frames come in the order of their arrival."""
        ...

    def close(self, is_complete: bool) -> None:
        """Complete the file. is_complete False: an error occurred; the written data are removed."""
        ...


def fail(file: str | os.PathLike[str], field: str, expected: str, found: object, remedy: str) -> NoReturn:
    """Raise RecordingFormatError for a field of a file; remedy: what the user should do."""
    raise RecordingFormatError(format_path(os.fspath(file)), field, expected, format_value(found), remedy)


def check_target(path: Path, overwrite: bool) -> None:
    """Raise CaptureError if `path` exists and `overwrite` is False, before the source is opened."""
    if path.exists() and not overwrite:
        raise CaptureError(os.fspath(path), EXISTS)


@contextmanager
def open_target(path: Path, overwrite: bool, is_folder: bool = False) -> Iterator[PendingOutput]:
    """Context manager for the creation of a writer: gives a temporary output, which is discarded if the block fails.

    After a successful block the writer commits or discards the output. Raises CaptureError if the system refuses, or if
    another program writes the output.
    """
    with convert_output_errors(path):
        pending = PendingOutput(path, overwrite=overwrite, is_folder=is_folder)
    try:
        with convert_output_errors(path):
            yield pending
    except BaseException:
        pending.discard()
        raise


@contextmanager
def convert_output_errors(path: Path) -> Iterator[None]:
    """Context manager that converts errors of an output to a CaptureError that names `path`."""
    try:
        yield
    except OutputError as error:
        problem = f"expected {error.expected}, found {error.found}; {error.remedy}"
        raise CaptureError(os.fspath(path), problem) from None
    except OSError as error:
        raise CaptureError(os.fspath(path), f"cannot be written ({error.strerror or error})") from error


def format_header(header: Mapping[str, Any]) -> str:
    """Format the header of a recording as JSON, with the name and the version of the format."""
    return json.dumps({"format": FORMAT, "version": VERSION, **header}, indent=1)


def parse_header(text: bytes, file: str | os.PathLike[str]) -> dict[str, Any]:
    """Parse a recording's header that `format_header` has written; file: name in error messages.

    Raises RecordingFormatError for another format or version.
    """
    try:
        header = check_recording_header(parse_json(text, HEADER_MAX))
    except TextError as error:
        fail(file, f"header, {error.position}", error.expected, error.found, "write it with taxel convert")
    if header.get("format") != FORMAT or header.get("version") != VERSION:
        found = header.get("version") if header.get("format") == FORMAT else header
        fail(file, "header", f"format {FORMAT}, version {VERSION}", str(found)[:60], "write it with taxel convert")
    return header


def check_frame(values: Mapping[str, Any], counts: Any, file: str | os.PathLike[str], row: str) -> TaxelFrame:
    """Check the values of a row and return its taxel frame. Raises RecordingFormatError for a value out of range.

    values: numbers by column name, including `time_s`. counts: sequence of integers. row: name of the row in error
    messages, such as "line 7".
    """
    for name, largest in INTEGER_COLUMNS.items():
        if not 0 <= values[name] <= largest:
            fail(file, f"{row}, {name}", f"0 to {largest}", values[name], "correct the row")
    time_s = values["time_s"]
    if not 0.0 <= time_s <= LARGEST_TIME_S:
        fail(file, f"{row}, time_s", "seconds, 0 or more", time_s, "correct the row")
    try:
        array = np.asarray(counts, dtype=np.int64)
    except (TypeError, ValueError, OverflowError):
        fail(file, f"{row}, raw counts", "0 to 65535", str(counts)[:60], "correct the row")
    if array.ndim != 1 or not len(array) or array.min() < 0 or array.max() > 65_535:
        fail(file, f"{row}, raw counts", "0 to 65535", f"{array.min()} to {array.max()}" if array.size else "none",
             "correct the row")  # fmt: skip
    numbers = {name: int(values[name]) for name in INTEGER_COLUMNS}
    return TaxelFrame(time_s=float(time_s), raw_counts=array.astype(np.uint16), **numbers)
