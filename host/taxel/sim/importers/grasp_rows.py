"""Grouping of the rows of a CSV file into grasps, and of each grasp into frames."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from taxel.grasp.timeline import Phase
from taxel.hand.errors import format_value
from taxel.sim.importers.csv_table import Column, CsvTable
from taxel.sim.importers.hand_motion import GraspTrack, parse_phase

__all__ = ["LABELS", "Frames", "GraspRows", "group_frames", "group_grasps", "make_dataset_ids"]

LABELS = (
    Column("grasp", "text", ("grasp_id", "id"), required=True),
    Column("object", "text", ("object_name",), required=True),
    Column("approach", "text", ("approach_name",), required=True),
    Column("iteration", "integer", ("repeat", "trial")),
    Column("session", "integer", ("mounting",)),
)

TIME_TOLERANCE_S = 1e-3
"""Largest difference between the times of the same frame in two files; shorter than the time step of any recording."""

_ID_DIGITS = 4


@dataclass(frozen=True, eq=False)
class GraspRows:
    """The rows of one grasp in a table, with its labels. rows: i64, indices of rows of the table."""

    id: str
    object: str
    approach: str
    iteration: int
    session: int
    rows: NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class Frames:
    """The T frames of a grasp with r rows.

    time_s: f64[T], increasing. phase: u8[T]. frame: i64[r], index of the frame of each row.
    """

    time_s: NDArray[np.float64]
    phase: NDArray[np.uint8]
    frame: NDArray[np.intp]


def group_grasps(table: CsvTable) -> list[GraspRows]:
    """Group the rows of a table by grasp, in the order of their first rows.

    Raises ImportDataError if the labels of a grasp, such as its object, differ between its rows.
    """
    rows_by_grasp: dict[str, list[int]] = {}
    for row, name in enumerate(table.texts["grasp"]):
        rows_by_grasp.setdefault(name, []).append(row)
    grasps = []
    for name, rows in rows_by_grasp.items():
        for column in ("object", "approach", "iteration", "session"):
            _require_equal(table, rows, column, name)
        first = rows[0]
        iteration, session = (int(table.numbers[k][first]) if table.has(k) else 0 for k in ("iteration", "session"))
        labels = table.texts["object"][first], table.texts["approach"][first]
        grasps.append(GraspRows(name, *labels, iteration, session, np.array(rows, np.intp)))
    return grasps


def _require_equal(table: CsvTable, rows: list[int], column: str, grasp: str) -> None:
    """Raise ImportDataError if a column differs between the rows of a grasp."""
    if not table.has(column):
        return
    values = table.texts[column] if column in table.texts else table.numbers[column]
    for row in rows:
        if values[row] != values[rows[0]]:
            found = f"{format_value(values[row])} after {format_value(values[rows[0]])} in grasp {format_value(grasp)}"
            table.at(row, column).fail(
                f"the same {column} in all rows of a grasp", found, "correct it, or name a new grasp"
            )


def make_dataset_ids(names: Sequence[str]) -> list[str]:
    """Make ids of grasps whose alphabetical order is the order of the file.

    Numbers get leading zeros. If the names are not in alphabetical order, they get the prefixes 0001_, 0002_, ...
    """
    ids = [name.zfill(_ID_DIGITS) if name.isascii() and name.isdigit() else name for name in names]
    ids = [name.replace("/", "_") for name in ids]
    if all(a < b for a, b in pairwise(ids)):
        return ids
    return [f"{number:0{_ID_DIGITS}}_{name}" for number, name in enumerate(ids, start=1)]


def group_frames(table: CsvTable, grasp: GraspRows, track: GraspTrack) -> Frames:
    """Determine the frames of a grasp, and the frame of each of its rows in the table.

    If the file of the hand's motion has phases, its rows are the frames, and each row of `table` must have the time of
    a frame. Otherwise the times in `table` are the frames, with the phases in `table`. Without phases all frames have
    the phase hold, because the program of the thesis recorded the closed hand only (section 5.3). Raises
    ImportDataError for times that do not match, and for two phases at the same time.
    """
    if table.has("time"):
        times = table.numbers["time"][grasp.rows]
    else:
        if len(track.time_s) > 1:
            found = f"none; {track.source.file} has {len(track.time_s)} times of grasp {format_value(grasp.id)}"
            table.at(0).fail("a column time", found, "add it, or give one pose of the hand for each grasp")
        times = np.full(len(grasp.rows), track.time_s[0])
    if track.phase is not None:
        frame = _find_nearest(track.time_s, times)
        difference = np.abs(track.time_s[frame] - times)
        if difference.max() > TIME_TOLERANCE_S:
            index = int(np.argmax(difference > TIME_TOLERANCE_S))
            expected = f"a time of {track.source.file}, within {TIME_TOLERANCE_S * 1000:g} ms"
            remedy = "use the same times in both files, or write the phases into this file"
            table.at(grasp.rows[index], "time").fail(expected, f"{times[index]:.9g}", remedy)
        return Frames(track.time_s, track.phase, frame)
    unique, frame = np.unique(times, return_inverse=True)
    if not table.has("phase"):
        return Frames(unique, np.full(len(unique), Phase.HOLD, np.uint8), frame)
    texts = table.texts["phase"]
    phase_of_row = np.array([parse_phase(texts[row], table.at(row, "phase")) for row in grasp.rows], np.uint8)
    phase = np.zeros(len(unique), np.uint8)
    phase[frame] = phase_of_row
    is_different = phase[frame] != phase_of_row
    if is_different.any():
        index = int(np.argmax(is_different))
        found = f"{phase_of_row[index]} and {phase[frame[index]]} at {times[index]:.9g} s"
        table.at(grasp.rows[index], "phase").fail("one phase at a time", found, "correct one of them")
    return Frames(unique, phase, frame)


def _find_nearest(increasing: NDArray[np.float64], values: NDArray[np.float64]) -> NDArray[np.intp]:
    """Return for each value the index of the nearest number in the array `increasing`."""
    after = np.clip(np.searchsorted(increasing, values), 0, len(increasing) - 1)
    before = np.maximum(after - 1, 0)
    return np.where(np.abs(increasing[before] - values) <= np.abs(increasing[after] - values), before, after)
