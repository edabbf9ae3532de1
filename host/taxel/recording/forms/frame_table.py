"""What every table of frames has: its columns, and the checks of a row that comes from a file."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NoReturn, Protocol

import numpy as np

from taxel.errors import FieldError
from taxel.hand.errors import shown, shown_path
from taxel.link import CaptureError
from taxel.link.capture import EXISTS
from taxel.stream import TaxelFrame

FORMAT = "taxel-recording"
VERSION = 1
HEADER_MAX = 1 << 22
LARGEST_TIME_S = 1e11  # beyond it, microseconds are lost in a float64
NUMBERS: Mapping[str, int] = {
    "address": 127, "sequence": 65_535, "cycle": 65_535, "board_time_us": 2**32 - 1, "hub_time_us": 2**32 - 1,
}  # fmt: skip
"""Whole-number columns of a frame, and the largest value of each."""


class RecordingFormError(FieldError):
    """A recording in CSV, Parquet or HDF5 that cannot be read."""


class FrameSink(Protocol):
    """Something that frames are written to."""

    def take(self, frame: TaxelFrame) -> None:
        """One frame, in the order of arrival."""
        ...

    def close(self, is_whole: bool) -> None:
        """No more frames come. `is_whole` False: something failed; what was written is removed."""
        ...


def fail(file: str | os.PathLike[str], field: str, expected: str, found: object, remedy: str) -> NoReturn:
    """Raise RecordingFormError for a place in a file."""
    raise RecordingFormError(shown_path(os.fspath(file)), field, expected, shown(found), remedy)


def check_free(path: Path, overwrite: bool) -> None:
    """Refuse a name that is taken, and one in a folder that is not there."""
    if path.exists() and not overwrite:
        raise CaptureError(os.fspath(path), EXISTS)
    if not path.parent.is_dir():
        raise CaptureError(os.fspath(path), "cannot be written (its folder is missing)")


def header_text(header: Mapping[str, Any]) -> str:
    """A recording's header as JSON, with the form's name."""
    return json.dumps({"format": FORMAT, "version": VERSION, **header}, indent=1)


def parse_header(text: str | bytes, file: str | os.PathLike[str]) -> dict[str, Any]:
    """The header of such a text. Raises RecordingFormError for another form or version."""
    try:
        header = json.loads(text)
    except (ValueError, RecursionError):
        fail(file, "header", "JSON", text[:40], "write it with taxel convert")
    if not isinstance(header, dict) or header.get("format") != FORMAT or header.get("version") != VERSION:
        found = header.get("version") if isinstance(header, dict) and header.get("format") == FORMAT else header
        fail(file, "header", f"format {FORMAT}, version {VERSION}", str(found)[:60], "write it with taxel convert")
    return header


def checked_frame(values: Mapping[str, Any], counts: Any, file: str | os.PathLike[str], place: str) -> TaxelFrame:
    """The frame of a row. `values`: numbers by column, `time_s` among them; `counts`: sequence of whole numbers."""
    for name, largest in NUMBERS.items():
        if not 0 <= values[name] <= largest:
            fail(file, f"{place}, {name}", f"0 to {largest}", values[name], "correct the row")
    time_s = values["time_s"]
    if not 0.0 <= time_s <= LARGEST_TIME_S:
        fail(file, f"{place}, time_s", "seconds, 0 or more", time_s, "correct the row")
    array = np.asarray(counts, dtype=np.int64)
    if array.ndim != 1 or not len(array) or array.min() < 0 or array.max() > 65_535:
        fail(file, f"{place}, raw counts", "0 to 65535", f"{array.min()} to {array.max()}" if array.size else "none",
             "correct the row")  # fmt: skip
    numbers = {name: int(values[name]) for name in NUMBERS}
    return TaxelFrame(time_s=float(time_s), raw_counts=array.astype(np.uint16), **numbers)
