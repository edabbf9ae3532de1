"""Poses of an object over time: measured samples, and their CSV file."""

from __future__ import annotations

import math
import os
import threading
from bisect import bisect_right
from typing import Final

import numpy as np

from taxel.hand.errors import format_path, format_value
from taxel.hand.transforms import interpolate, make_pose
from taxel.input_files import TextError
from taxel.input_files.csv_rows import parse_float, read_csv_table
from taxel.twin.errors import TwinInputError
from taxel.types import FloatArray

COLUMNS: Final = ("time_s", "x_m", "y_m", "z_m", "qw", "qx", "qy", "qz")
"""Columns of a file: time, position in the world, and orientation as a quaternion."""

MAX_SAMPLES: Final = 1_000_000
"""Largest number of samples of a file, and number of newest samples of a live source that are kept (chosen)."""

MAX_SILENCE_S: Final = 1.0
"""A pose is used for times up to this long before the first or after the last sample, and between two samples at most
twice as far apart, seconds (chosen); at other times the pose is unknown."""

QUATERNION_TOLERANCE: Final = 0.01
"""Largest deviation of a quaternion's length from 1: files have rounded numbers."""


class ObjectHistory:
    """Poses of an object over time; may be filled by another thread."""

    def __init__(self, name: str) -> None:
        """Create an empty history. name: source, for messages."""
        self.name = name
        self._lock = threading.Lock()
        self._times: list[float] = []
        self._poses: list[FloatArray] = []
        self.uses_stream_time = True
        """False: frames have another clock than the samples, and a frame gets the latest sample."""

    def __len__(self) -> int:
        return len(self._times)

    def add(self, time_s: float, position: FloatArray, quaternion: FloatArray) -> None:
        """Add a pose: time, position f64[3] in metres, quaternion f64[4] (w, x, y, z).

        A sample that is not later than the last one, or has a number that is not finite, is ignored. Raises ValueError
        for a quaternion whose length is not 1.
        """
        if not (math.isfinite(time_s) and np.isfinite(position).all() and np.isfinite(quaternion).all()):
            return
        length = float(np.linalg.norm(quaternion))
        if abs(length - 1.0) > QUATERNION_TOLERANCE:
            raise ValueError(f"expected a quaternion of length 1, found {length:g}")
        with self._lock:
            if self._times and time_s <= self._times[-1]:
                return
            self._times.append(time_s)
            self._poses.append(make_pose(position, quaternion / length))
            if len(self._times) > 2 * MAX_SAMPLES:
                del self._times[:MAX_SAMPLES], self._poses[:MAX_SAMPLES]

    def find(self, time_s: float) -> FloatArray | None:
        """Return the pose at a time, f64[4, 4], interpolated between two samples; None if no sample is near."""
        with self._lock:
            if not self.uses_stream_time:
                return self._poses[-1] if self._poses else None
            after = bisect_right(self._times, time_s)
            near = [index for index in (after - 1, after) if 0 <= index < len(self._times)]
            near = [index for index in near if abs(self._times[index] - time_s) <= MAX_SILENCE_S]
            if not near:
                return None
            if len(near) == 1:
                return self._poses[near[0]]
            first, second = near
            share = (time_s - self._times[first]) / (self._times[second] - self._times[first])
            return interpolate(self._poses[first], self._poses[second], share)


def read_object_poses(path: str | os.PathLike[str]) -> ObjectHistory:
    """Read a CSV file of object poses with the columns of `COLUMNS`. Raises TwinInputError with file and line."""
    name = format_path(os.fspath(path))
    history = ObjectHistory(name)
    try:
        for number, row in read_csv_table(path, COLUMNS, MAX_SAMPLES):
            place = f"{name}: line {number}"
            _add_row(
                history,
                [_parse_number(text, f"{place}: {column}") for column, text in zip(COLUMNS, row, strict=True)],
                place,
            )
    except OSError as error:
        raise TwinInputError(name, "a readable CSV file", error.strerror or "an error", "correct the path") from None
    except TextError as error:
        raise TwinInputError(f"{name}: {error.position}", error.expected, error.found, "correct the line") from None
    if not len(history):
        raise TwinInputError(name, "at least one pose", "none", "record the poses again")
    return history


def _parse_number(text: str, place: str) -> float:
    """Parse an entry. place: file, line and column. Raises TwinInputError unless it is a finite number."""
    try:
        value = parse_float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise TwinInputError(place, "a finite number", format_value(text), "correct the number")
    return value


def _add_row(history: ObjectHistory, values: list[float], place: str) -> None:
    """Add the eight numbers of a row. place: file and line. Raises TwinInputError for an invalid time or quaternion."""
    count = len(history)
    try:
        history.add(values[0], np.array(values[1:4]), np.array(values[4:]))
    except ValueError as error:
        # The message of `ObjectHistory.add` is "expected ..., found ...".
        expected, _, found = str(error).removeprefix("expected ").partition(", found ")
        raise TwinInputError(place, expected, found, "correct qw, qx, qy, qz") from None
    if len(history) == count:  # the history ignores a time that is not later than the last one
        raise TwinInputError(f"{place}: time_s", "a time after the line before", f"{values[0]:g}", "sort by time")
