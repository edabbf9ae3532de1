"""Holds: intervals during which a target rests at a known distance in front of a board, as a CSV file."""

import math
import os
import re
from collections.abc import Sequence
from dataclasses import dataclass

from taxel.hand import Hand
from taxel.hand.errors import format_path, format_value
from taxel.input_files import TextError
from taxel.input_files.csv_rows import parse_float, read_csv_rows
from taxel.proximity.errors import CalibrationFileError

COLUMNS = ("start_s", "end_s", "board", "target", "distance_mm")
REST = "rest"
"""Value of the column `target` of an interval without a target in front of the board; `distance_mm` is then empty."""

MAX_DISTANCE_M = 0.03
"""Largest distance of a hold, metres: at larger distances no taxel of the described hands has a signal."""

MAX_HOLDS = 10_000
"""Largest number of holds in a file: more than eight hours of holds of three seconds."""

TARGET_NAME = re.compile(r"[a-z][a-z0-9_]{0,31}")


@dataclass(frozen=True)
class Hold:
    """An interval during which a target rests at a known distance in front of a board, or without a target.

    start_s, end_s: times on the stream's clock, seconds. board: name of the board. target: name of the target, or
    `REST` without a target. distance_m: distance between target and skin, metres; None without a target.
    """

    start_s: float
    end_s: float
    board: str
    target: str
    distance_m: float | None


def read_holds(path: str | os.PathLike[str], hand: Hand) -> list[Hold]:
    """Read a file of holds, sorted by time.

    Raises `CalibrationFileError` for an invalid value, and OSError for a file that cannot be read.
    """
    file = format_path(os.fspath(path))
    holds: list[Hold] = []
    try:
        rows = read_csv_rows(path)
        header = next(rows, (1, []))[1]
        if tuple(name.strip() for name in header) != COLUMNS:
            found = format_value(",".join(header)) if header else "nothing"
            raise CalibrationFileError(file, "line 1", f"'{','.join(COLUMNS)}'", found, "correct the header")
        for number, row in rows:
            if len(holds) == MAX_HOLDS:
                place, expected = f"line {number}", f"at most {MAX_HOLDS} holds"
                raise CalibrationFileError(file, place, expected, "more", "divide the file")
            holds += [_parse_row(file, number, row, hand)] if row else []
    except TextError as error:
        raise CalibrationFileError(file, error.position, error.expected, error.found, "correct the line") from None
    if not holds:
        raise CalibrationFileError(file, "file", "at least one hold", "none", "add the intervals of the recording")
    return sorted(holds, key=lambda hold: hold.start_s)


def _parse_row(file: str, number: int, row: Sequence[str], hand: Hand) -> Hold:
    """Parse a line of a file of holds. number: line number in messages. Raises `CalibrationFileError`."""

    def fail(column: str, expected: str, found: str) -> CalibrationFileError:
        """Create the error of one column."""
        return CalibrationFileError(file, f"line {number}, {column}", expected, found, "correct the line")

    if len(row) != len(COLUMNS):
        raise fail("columns", f"{len(COLUMNS)} values", str(len(row)))
    start, end, board, target, distance = (value.strip() for value in row)
    names = [each.name for each in hand.boards]
    if board not in names:
        raise fail("board", f"a board of hand '{hand.name}' ({', '.join(names[:4])}, ...)", repr(board))
    if not TARGET_NAME.fullmatch(target):
        raise fail("target", "'rest' or a name of lower-case letters, digits and _", repr(target))
    interval = _parse_number(start), _parse_number(end)
    if not (0.0 <= interval[0] < interval[1] < math.inf):
        raise fail("start_s, end_s", "a start of at least 0 before the end", f"{start}, {end}")
    if target == REST:
        if distance:
            raise fail("distance_mm", "no value for a rest", repr(distance))
        return Hold(*interval, board, target, None)
    metres = 1e-3 * _parse_number(distance)
    if not 0.0 < metres <= MAX_DISTANCE_M:
        raise fail("distance_mm", f"a number above 0, at most {1e3 * MAX_DISTANCE_M:g}", repr(distance))
    return Hold(*interval, board, target, metres)


def _parse_number(text: str) -> float:
    """Parse a number; return NaN for a string that is no number."""
    try:
        return parse_float(text)
    except ValueError:
        return math.nan


def format_holds(holds: Sequence[Hold]) -> str:
    """Format holds as the text of a CSV file."""
    lines = [",".join(COLUMNS)]
    for hold in holds:
        distance = "" if hold.distance_m is None else f"{1e3 * hold.distance_m:g}"
        lines.append(f"{hold.start_s:.6g},{hold.end_s:.6g},{hold.board},{hold.target},{distance}")
    return "\n".join(lines) + "\n"
