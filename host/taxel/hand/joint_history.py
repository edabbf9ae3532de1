"""Joint angles over time: measured samples, their interpolation at the times of frames, and their file."""

import contextlib
import math
import os
import threading
import time
from collections.abc import Callable, Iterable, Sequence
from typing import Final

import numpy as np

from taxel.errors import FieldError, TaxelError
from taxel.hand.errors import format_path, format_value
from taxel.input_files import TextError
from taxel.input_files.csv_rows import parse_float, read_csv_rows
from taxel.output import LiveOutput
from taxel.types import FloatArray

TIME_COLUMN: Final = "time_s"
MAX_SAMPLES: Final = 20_000
"""Number of samples that a live history keeps: one minute of the hand's reports at 333 Hz. Frames are at most seconds
older than the latest sample.
"""

SILENT_S: Final = 0.5
"""Time without a sample after which a live source is reported as silent, seconds."""

EDGE_S: Final = 0.1
"""Time before the first frame of a recording at which the first sample is taken, seconds: one poll cycle or more."""


class JointFileError(FieldError):
    """Error: a file of joint angles cannot be read."""


class NoJointAnglesError(TaxelError):
    """Error: no joint angles have been measured."""


class JointHistory:
    """Joint angles of a robot over time; may be filled by another thread.

    The object is a joint source: `select_time` chooses the time, and a call returns the angles f64[j], radians, at this
    time: linearly interpolated between two samples, and the first or last sample outside their times.
    """

    def __init__(self, names: Sequence[str], name: str, max_samples: int | None = None) -> None:
        """Create an empty history. names: joints in the order of the angles. name: source, for error messages.

        max_samples: least number of latest samples that are kept; None: all.
        """
        self.names = tuple(names)
        self.name = name
        self._max_samples = max_samples
        self._lock = threading.Lock()
        self._times: list[float] = []
        self._angles: list[FloatArray] = []
        self._selected_s = math.inf
        self.is_live = False
        """Whether samples are added while frames are read, with times of the clock `time.monotonic`."""
        self.uses_stream_time = True
        """False: frames have another clock than the samples, and a frame gets the latest sample."""
        self.on_silence: Callable[[str], None] | None = None
        """Called once with one line if a live source has added no sample for `SILENT_S`."""

    def __len__(self) -> int:
        return len(self._times)

    def add(self, time_s: float, angles: FloatArray) -> None:
        """Add the angles f64[j], radians, at a time, seconds; stored samples of this or a later time are removed first.

        A sample with a number that is not finite is ignored. If more than twice `max_samples` samples are stored, the
        oldest `max_samples` of them are removed.
        """
        if not (math.isfinite(time_s) and np.isfinite(angles).all()):
            return
        with self._lock:
            while self._times and self._times[-1] >= time_s:
                self._times.pop()
                self._angles.pop()
            self._times.append(time_s)
            self._angles.append(np.array(angles, dtype=np.float64))
            if self._max_samples is not None and len(self._times) > 2 * self._max_samples:
                del self._times[: self._max_samples], self._angles[: self._max_samples]

    def shift(self, seconds: float) -> None:
        """Add a number of seconds to the times of all samples."""
        with self._lock:
            self._times = [time_s + seconds for time_s in self._times]

    @property
    def first_s(self) -> float:
        """Time of the first sample, seconds; infinity without a sample."""
        with self._lock:
            return self._times[0] if self._times else math.inf

    @property
    def last_s(self) -> float:
        """Time of the latest sample, seconds; minus infinity without a sample."""
        with self._lock:
            return self._times[-1] if self._times else -math.inf

    def select_time(self, time_s: float) -> None:
        """Choose the time of the angles that the next calls return, seconds; infinity: the latest sample.

        Calls `on_silence` if a live source has become silent.
        """
        self._selected_s = time_s if self.uses_stream_time else math.inf
        if self.is_live and self.on_silence is not None and time.monotonic() - self.last_s > SILENT_S:
            self.on_silence(
                f"{self.name}: no joint angles for {SILENT_S:g} s: the frames from here on get the latest angles"
            )
            self.on_silence = None

    def __call__(self) -> FloatArray:
        """Return the angles at the selected time. Raises NoJointAnglesError without any sample."""
        return self.interpolate(self._selected_s)

    def interpolate(self, time_s: float) -> FloatArray:
        """Return the angles at a time, f64[j], radians: interpolated linearly, or the first or last sample outside.

        Raises NoJointAnglesError without any sample.
        """
        with self._lock:
            if not self._times:
                raise NoJointAnglesError(f"{self.name}: no joint angles have arrived; check that the source is running")
            after = int(np.searchsorted(self._times, time_s))
            if after == 0 or after == len(self._times):
                return self._angles[min(after, len(self._times) - 1)].copy()
            first_s, second_s = self._times[after - 1], self._times[after]
            share = (time_s - first_s) / (second_s - first_s)
            return self._angles[after - 1] + share * (self._angles[after] - self._angles[after - 1])


class JointFileWriter:
    """Writer of joint angles as a CSV file: time_s, then one column for each joint, radians."""

    _last_s = -math.inf
    _cycle = -1
    _newest_s = -math.inf

    def __init__(self, output: LiveOutput, names: Sequence[str]) -> None:
        """Write the heading to an open output, which replaces an existing file with its first sample."""
        self._output = output
        self._write_line((TIME_COLUMN, *names))
        output.begin()

    def write(self, time_s: float, angles: FloatArray) -> None:
        """Append one sample; it is on disk when the call returns, except for the buffers of the system."""
        self._write_line(repr(value) for value in (time_s, *angles.tolist()))
        self._output.publish()

    def _write_line(self, values: Iterable[str]) -> None:
        """Append one line; after a failure the file is truncated to its complete lines. Raises JointFileError."""
        file = self._output.file
        end = file.tell()
        data = (",".join(values) + "\n").encode()
        try:
            while data:
                data = data[file.write(data) or 0 :]
        except OSError as error:
            with contextlib.suppress(OSError):
                os.ftruncate(file.fileno(), end)
            self._output.fail()
            name = format_path(self._output.path)
            reason = error.strerror or "an error"
            raise JointFileError(name, "file", "space and permission to write", reason, "correct that") from None

    def write_frame(self, history: JointHistory, cycle: int, time_s: float) -> None:
        """Append the angles at the time of the first frame of each poll cycle; call it for every frame.

        cycle: number of the frame's poll cycle. time_s: time of the frame. The first frame of a recording also gives a
        sample `EDGE_S` before its time, because the scans of other boards of the same cycle may have started earlier.
        """
        self._newest_s = max(self._newest_s, time_s)
        if cycle == self._cycle or time_s <= self._last_s:
            return
        if self._cycle < 0:
            edge_s = max(time_s - EDGE_S, history.first_s)
            if edge_s < time_s:
                self._write_at(history, edge_s)
        self._cycle = cycle
        self._write_at(history, time_s)

    def _write_at(self, history: JointHistory, time_s: float) -> None:
        """Select a time, seconds, in the history, and append the angles at this time to the file."""
        self._last_s = time_s
        history.select_time(time_s)
        self.write(time_s, history())

    def finish(self, history: JointHistory) -> None:
        """Append the angles at the time of the latest frame, and close the file. A second call has no effect."""
        if self._output.file.closed:
            return
        end_s = min(self._newest_s, history.last_s)
        if end_s > self._last_s:
            self._write_at(history, end_s)
        self.close()

    def close(self) -> None:
        """Flush the file to the disk and close it. A file without samples does not replace an existing one."""
        if self._output.is_published:
            self._output.close()
        else:
            self._output.discard()

    def discard(self) -> None:
        """Remove a file without samples."""
        self._output.discard()


def read_joint_file(path: str | os.PathLike[str], names: Sequence[str]) -> JointHistory:
    """Read a file of joint angles for a robot with these joints. The columns may have any order.

    Raises JointFileError for a missing or unknown column, a number that is missing or not finite, or times that do not
    increase; the message names the line.
    """
    file = format_path(os.fspath(path))
    history = JointHistory(names, file)
    try:
        lines = read_csv_rows(path)
        order = _find_columns(next(lines, (1, []))[1], names, file)
        for number, line in lines:
            _add_line(history, file, number, line, order)
    except OSError as error:
        raise JointFileError(file, "file", "a readable CSV file", str(error.strerror), "correct the path") from None
    except TextError as error:
        raise JointFileError(file, error.position, error.expected, error.found, "correct the line") from None
    if not len(history):
        raise JointFileError(file, "file", "at least one line of angles", "none", "record the angles again")
    return history


def _find_columns(heading: list[str], names: Sequence[str], file: str) -> list[int]:
    """Return the column positions of the time and then of each joint. Raises JointFileError for other columns."""
    expected = [TIME_COLUMN, *names]
    for column in expected:
        if column not in heading:
            raise JointFileError(file, "line 1", f"a column {column}", "none", "add the column")
    if len(heading) != len(expected):
        unknown = next((name for name in heading if name not in expected), "a repeated column")
        raise JointFileError(file, "line 1", "the joints of the robot", format_value(unknown), "remove the column")
    return [heading.index(column) for column in expected]


def _add_line(history: JointHistory, file: str, number: int, line: list[str], order: list[int]) -> None:
    """Add a line of a file of joint angles to the history.

    number: of the line, for errors. order: column positions of time and joints. Raises JointFileError for a line with
    missing or invalid numbers, and for a time that does not increase.
    """
    field = f"line {number}"
    if len(line) != len(order):
        raise JointFileError(file, field, f"{len(order)} columns", str(len(line)), "check that the file is complete")
    for index, name in zip(order, (TIME_COLUMN, *history.names), strict=True):
        try:
            value = parse_float(line[index])
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            raise JointFileError(file, f"{field}, {name}", "a finite number", format_value(line[index]), "correct it")
    values = [float(line[index]) for index in order]
    if values[0] <= history.last_s:
        raise JointFileError(
            file, f"{field}, {TIME_COLUMN}", f"more than {history.last_s:g}", f"{values[0]:g}", "sort by time"
        )
    history.add(values[0], np.array(values[1:]))
