"""Import measured touches of the CapFingerId data set from its text files into the package.

    python tools/import_capfingerid.py SOURCE_DIR

SOURCE_DIR contains `CapMatrix_<name>.txt` files and their LICENSE. A line is
`participant;hand;finger;task;-1;FRAME`, and FRAME is comma-separated: Unix seconds, nanoseconds, 405 values row by row
of 27 x 15 cells, and an empty end. A frame of another length was truncated when it was logged; it is skipped and
counted. Any other deviation is an error.
"""

import argparse
import re
import sys
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from taxel.output import open_whole, write_whole
from taxel.types import IntArray

DATA = Path(__file__).resolve().parents[1] / "host" / "taxel" / "recording" / "data"

ROWS, COLUMNS = 27, 15
FRAME_FIELDS = 2 + ROWS * COLUMNS + 1
TASKS = ("TAP", "SCROLL", "DRAG", "PAUSE")
HANDS = ("left", "right")
FINGERS = ("thumb", "index", "middle", "ring", "little")
NO_VALUE = ("", "-")
"""Texts of a cell without a value; the authors of the data read them as 0."""

NANOSECONDS = 10**9
VALUE_LIMITS = (-(2**15), 2**15 - 1)

_INTEGER = re.compile(r"-?[0-9]+", re.ASCII)
_FILE_NAME = re.compile(r"CapMatrix_([A-Za-z0-9_]+)\.txt", re.ASCII)


class FormatError(Exception):
    """A line has an invalid format; the message names file and line."""


class Line(NamedTuple):
    """One frame. finger: (participant, hand, finger). time_ns: Unix time. values: cell values row by row."""

    finger: tuple[int, str, str]
    task: str
    time_ns: int
    values: list[int]


class Recording(NamedTuple):
    """The frames of one file. skipped: number of truncated lines."""

    finger: tuple[int, str, str]
    time_ns: IntArray
    values: NDArray[np.int16]
    task: NDArray[np.str_]
    skipped: int


def parse_integer(text: str, field: str, low: int, high: int) -> int:
    """Return the integer in `text`. field: name for the message. Raises FormatError outside `low` to `high`."""
    if not _INTEGER.fullmatch(text) or len(text) > 20 or not low <= int(text) <= high:
        raise FormatError(f"{field}: expected an integer from {low} to {high}, found {text[:20]!r}")
    return int(text)


def check_choice(text: str, field: str, choices: tuple[str, ...]) -> str:
    """Return `text` if it is one of `choices`. field: name for the message. Raises FormatError otherwise."""
    if text not in choices:
        raise FormatError(f"{field}: expected one of {', '.join(choices)}, found {text[:20]!r}")
    return text


def parse_line(text: str) -> Line | None:
    """Parse one line of a CapFingerId file, without its line end, as a frame of the touch panel.

    A line is `participant;hand;finger;task;-1;FRAME`; FRAME is seconds, nanoseconds and 405 values. Returns None for a
    truncated frame, which has another number of values. Raises FormatError.
    """
    fields = text.split(";")
    if len(fields) != 6:
        raise FormatError(f"expected 6 fields between semicolons, found {len(fields)}")
    if fields[4] != "-1":
        raise FormatError(f"field 5: expected -1, found {fields[4][:20]!r}")
    finger = (
        parse_integer(fields[0], "participant", 0, 9999),
        check_choice(fields[1], "hand", HANDS),
        check_choice(fields[2], "finger", FINGERS),
    )
    task = check_choice(fields[3], "task", TASKS)
    frame = fields[5].split(",")
    if len(frame) != FRAME_FIELDS:
        return None
    if frame[-1] != "":
        raise FormatError(f"expected nothing after the last comma, found {frame[-1][:20]!r}")
    seconds = parse_integer(frame[0], "seconds", 0, 2**32)
    nanoseconds = parse_integer(frame[1], "nanoseconds", 0, NANOSECONDS - 1)
    values = [
        0 if cell in NO_VALUE else parse_integer(cell, f"value {i}", *VALUE_LIMITS)
        for i, cell in enumerate(frame[2:-1])
    ]
    return Line(finger, task, seconds * NANOSECONDS + nanoseconds, values)


def read_recording(path: Path) -> Recording:
    """Read all frames of one file. Raises FormatError with file and line."""
    lines: list[Line] = []
    skipped = 0
    with path.open(encoding="ascii", newline="\n") as file:
        for number, text in enumerate(file, 1):
            try:
                line = parse_line(text.removesuffix("\n"))
                if line is not None and lines:
                    _check_order(line, lines[-1])
            except FormatError as error:
                raise FormatError(f"{path}, line {number}: {error}") from None
            if line is None:
                skipped += 1
            else:
                lines.append(line)
    if not lines:
        raise FormatError(f"{path}: expected at least one frame, found none")
    return Recording(
        lines[0].finger,
        np.array([line.time_ns for line in lines], dtype=np.int64),
        np.array([line.values for line in lines], dtype=np.int16).reshape(-1, ROWS, COLUMNS),
        np.array([line.task for line in lines], dtype="<U6"),
        skipped,
    )


def _check_order(line: Line, previous: Line) -> None:
    """Check that a line has the same finger as the previous line and is not earlier. Raises `FormatError`."""
    if line.finger != previous.finger:
        raise FormatError(f"expected {previous.finger} as in the lines before, found {line.finger}")
    if line.time_ns < previous.time_ns:
        raise FormatError("expected a time at or after that of the line before, found an earlier one")


def build_arrays(name: str, recording: Recording) -> dict[str, NDArray[np.generic]]:
    """Return the arrays of one file as they are stored, by name."""
    participant, hand, finger = recording.finger
    start_ns = recording.time_ns[0]
    return {
        f"{name}.values": recording.values,
        f"{name}.time_s": (recording.time_ns - start_ns) / float(NANOSECONDS),
        f"{name}.start_unix_ns": np.array(start_ns, dtype=np.int64),
        f"{name}.task": recording.task,
        f"{name}.participant": np.array(participant, dtype=np.int64),
        f"{name}.hand": np.array(hand, dtype="<U5"),
        f"{name}.finger": np.array(finger, dtype="<U6"),
    }


def import_folder(source: Path, data: Path) -> str:
    """Read the folder `source`, write `capfingerid.npz` and its licence to the folder `data`, and return a summary.

    Raises FormatError, and OSError for files that cannot be read or written.
    """
    paths = sorted((match[1], path) for path in source.iterdir() if (match := _FILE_NAME.fullmatch(path.name)))
    if not paths:
        raise FormatError(f"{source}: expected files CapMatrix_<name>.txt, found none")
    arrays: dict[str, NDArray[np.generic]] = {}
    report = []
    for name, path in paths:
        recording = read_recording(path)
        arrays |= build_arrays(name, recording)
        repeats = np.all(recording.values[1:] == recording.values[:-1], axis=(1, 2)).sum()
        seconds = arrays[f"{name}.time_s"][-1]
        report.append(
            f"{name}: {len(recording.values)} frames in {seconds:.1f} s, {repeats} repeat the frame before, "
            f"values {recording.values.min()} to {recording.values.max()}, {recording.skipped} lines skipped"
        )
    target = data / "capfingerid.npz"
    with open_whole(target) as file:
        np.savez_compressed(file, allow_pickle=False, **arrays)
    write_whole(data / "capfingerid.LICENSE", (source / "LICENSE").read_bytes())
    return "\n".join([*report, f"{target}: {target.stat().st_size:,} bytes"])


def main() -> int:
    """Import the CapFingerId text files; after a one-line error message the exit status is 1."""
    parser = argparse.ArgumentParser(description="Import CapFingerId text files into the package.")
    parser.add_argument(
        "source", type=Path, metavar="SOURCE_DIR", help="folder with CapMatrix_<name>.txt files and their LICENSE"
    )
    try:
        print(import_folder(parser.parse_args().source, DATA))
    except (FormatError, OSError, UnicodeDecodeError) as error:
        print(f"import_capfingerid: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
