"""Measured touches of the CapFingerId data set, from its text files into the package.

    python tools/import_capfingerid.py SOURCE_DIR

SOURCE_DIR holds `CapMatrix_<name>.txt` files and their LICENSE. A line is
`participant;hand;finger;task;-1;FRAME`, and FRAME is comma-separated: Unix seconds, nanoseconds, 405 values row by row
of 27 x 15 cells, and an empty end. A frame of another length was cut off when it was logged: it is skipped and counted.
Anything else that does not fit is an error.
"""

import argparse
import re
import shutil
import sys
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

DATA = Path(__file__).resolve().parents[1] / "host" / "taxel" / "recording" / "data"

ROWS, COLUMNS = 27, 15
FRAME_FIELDS = 2 + ROWS * COLUMNS + 1
TASKS = ("TAP", "SCROLL", "DRAG", "PAUSE")
HANDS = ("left", "right")
FINGERS = ("thumb", "index", "middle", "ring", "little")
NO_VALUE = ("", "-")
"""Written for a cell without a value; the data's authors read it as 0."""

NANOSECONDS = 10**9
VALUE_LIMITS = (-(2**15), 2**15 - 1)

_INTEGER = re.compile(r"-?[0-9]+", re.ASCII)
_FILE_NAME = re.compile(r"CapMatrix_([A-Za-z0-9_]+)\.txt", re.ASCII)


class FormatError(Exception):
    """A line that does not fit, named by file and line."""


class Line(NamedTuple):
    """One frame: `who` is (participant, hand, finger), `time_ns` Unix time, `values` row by row."""

    who: tuple[int, str, str]
    task: str
    time_ns: int
    values: list[int]


class Recording(NamedTuple):
    """One file; `skipped` lines were cut off."""

    who: tuple[int, str, str]
    time_ns: NDArray[np.int64]
    values: NDArray[np.int16]
    task: NDArray[np.str_]
    skipped: int


def integer(text: str, what: str, low: int, high: int) -> int:
    """The whole number `text`; FormatError unless it is one from `low` to `high`."""
    if not _INTEGER.fullmatch(text) or len(text) > 20 or not low <= int(text) <= high:
        raise FormatError(f"{what}: expected a whole number from {low} to {high}, found {text[:20]!r}")
    return int(text)


def one_of(text: str, what: str, known: tuple[str, ...]) -> str:
    """`text`; FormatError unless it is one of `known`."""
    if text not in known:
        raise FormatError(f"{what}: expected one of {', '.join(known)}, found {text[:20]!r}")
    return text


def parse_line(text: str) -> Line | None:
    """One line without its end; None if its frame has another length. Raises FormatError."""
    fields = text.split(";")
    if len(fields) != 6:
        raise FormatError(f"expected 6 fields between semicolons, found {len(fields)}")
    if fields[4] != "-1":
        raise FormatError(f"field 5: expected -1, found {fields[4][:20]!r}")
    who = (
        integer(fields[0], "participant", 0, 9999),
        one_of(fields[1], "hand", HANDS),
        one_of(fields[2], "finger", FINGERS),
    )
    task = one_of(fields[3], "task", TASKS)
    frame = fields[5].split(",")
    if len(frame) != FRAME_FIELDS:
        return None
    if frame[-1] != "":
        raise FormatError(f"expected nothing after the last comma, found {frame[-1][:20]!r}")
    seconds = integer(frame[0], "seconds", 0, 2**32)
    nanoseconds = integer(frame[1], "nanoseconds", 0, NANOSECONDS - 1)
    values = [
        0 if cell in NO_VALUE else integer(cell, f"value {i}", *VALUE_LIMITS) for i, cell in enumerate(frame[2:-1])
    ]
    return Line(who, task, seconds * NANOSECONDS + nanoseconds, values)


def read_recording(path: Path) -> Recording:
    """All frames of one file. Raises FormatError with file and line."""
    lines: list[Line] = []
    skipped = 0
    with path.open(encoding="ascii", newline="\n") as file:
        for number, text in enumerate(file, 1):
            try:
                line = parse_line(text.removesuffix("\n"))
                if line is not None and lines and line.who != lines[0].who:
                    raise FormatError(f"expected {lines[0].who} as on the lines before, found {line.who}")
                if line is not None and lines and line.time_ns < lines[-1].time_ns:
                    raise FormatError("its time lies before that of the last line")
            except FormatError as error:
                raise FormatError(f"{path}, line {number}: {error}") from None
            if line is None:
                skipped += 1
            else:
                lines.append(line)
    if not lines:
        raise FormatError(f"{path}: holds no frame")
    return Recording(
        lines[0].who,
        np.array([line.time_ns for line in lines], dtype=np.int64),
        np.array([line.values for line in lines], dtype=np.int16).reshape(-1, ROWS, COLUMNS),
        np.array([line.task for line in lines], dtype="<U6"),
        skipped,
    )


def packed(name: str, recording: Recording) -> dict[str, NDArray[np.generic]]:
    """The arrays that are stored for one file."""
    participant, hand, finger = recording.who
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
    """Read `source`, write `capfingerid.npz` and its licence to `data`; returns what was done.

    Raises FormatError, and OSError for files that cannot be read or written.
    """
    found = sorted((match[1], path) for path in source.iterdir() if (match := _FILE_NAME.fullmatch(path.name)))
    if not found:
        raise FormatError(f"{source}: holds no CapMatrix_<name>.txt")
    arrays: dict[str, NDArray[np.generic]] = {}
    report = []
    for name, path in found:
        recording = read_recording(path)
        arrays |= packed(name, recording)
        repeats = np.all(recording.values[1:] == recording.values[:-1], axis=(1, 2)).sum()
        seconds = arrays[f"{name}.time_s"][-1]
        report.append(
            f"{name}: {len(recording.values)} frames in {seconds:.1f} s, {repeats} repeat the frame before, "
            f"values {recording.values.min()} to {recording.values.max()}, {recording.skipped} lines skipped"
        )
    target = data / "capfingerid.npz"
    np.savez_compressed(target, allow_pickle=False, **arrays)
    shutil.copyfile(source / "LICENSE", data / "capfingerid.LICENSE")
    return "\n".join([*report, f"{target}: {target.stat().st_size:,} bytes"])


def main() -> int:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description="Import CapFingerId text files into the package.")
    parser.add_argument("source", type=Path, metavar="SOURCE_DIR", help="folder of CapMatrix_<name>.txt and LICENSE")
    try:
        print(import_folder(parser.parse_args().source, DATA))
    except (FormatError, OSError, UnicodeDecodeError) as error:
        print(f"import_capfingerid: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
