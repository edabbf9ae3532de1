"""The rows of a CSV file sorted into grasps, and the frames of each grasp."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from taxel.grasp.timeline import Phase
from taxel.hand.errors import format_value
from taxel.sim.importers.csv_table import Column, CsvTable
from taxel.sim.importers.hand_motion import GraspTrack, phase_number

__all__ = ["LABELS", "Frames", "GraspRows", "dataset_ids", "frames_of", "grasps_of"]

LABELS = (
    Column("grasp", "text", ("grasp_id", "id"), required=True),
    Column("object", "text", ("object_name",), required=True),
    Column("approach", "text", ("approach_name",), required=True),
    Column("iteration", "integer", ("repeat", "trial")),
    Column("session", "integer", ("mounting",)),
)

TIME_TOLERANCE_S = 1e-3
"""How far apart two files may put the same moment; below the step of any recording."""

_ID_DIGITS = 4


@dataclass(frozen=True, eq=False)
class GraspRows:
    """The rows of one grasp: `rows` are indices into the table."""

    id: str
    object: str
    approach: str
    iteration: int
    session: int
    rows: NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class Frames:
    """time_s: f64[T], rising. phase: u8[T]. frame: i64[r], the frame that each row of the grasp belongs to."""

    time_s: NDArray[np.float64]
    phase: NDArray[np.uint8]
    frame: NDArray[np.intp]


def grasps_of(table: CsvTable) -> list[GraspRows]:
    """The grasps in the order of their first rows. What is said of a grasp must be the same in all its rows."""
    own: dict[str, list[int]] = {}
    for row, name in enumerate(table.texts["grasp"]):
        own.setdefault(name, []).append(row)
    result = []
    for name, rows in own.items():
        for column in ("object", "approach", "iteration", "session"):
            _check_same(table, rows, column, name)
        first = rows[0]
        iteration, session = (int(table.numbers[k][first]) if table.has(k) else 0 for k in ("iteration", "session"))
        labels = table.texts["object"][first], table.texts["approach"][first]
        result.append(GraspRows(name, *labels, iteration, session, np.array(rows, np.intp)))
    return result


def _check_same(table: CsvTable, rows: list[int], column: str, grasp: str) -> None:
    if not table.has(column):
        return
    values = table.texts[column] if column in table.texts else table.numbers[column]
    for row in rows:
        if values[row] != values[rows[0]]:
            found = f"{format_value(values[row])} after {format_value(values[rows[0]])} in grasp {format_value(grasp)}"
            table.at(row, column).fail(f"the same {column} in a whole grasp", found, "correct it, or name a new grasp")


def dataset_ids(names: Sequence[str]) -> list[str]:
    """Ids that sort in the order of the file: the names, numbers with leading zeros, else "0001_" and so on before."""
    ids = [name.zfill(_ID_DIGITS) if name.isascii() and name.isdigit() else name for name in names]
    ids = [name.replace("/", "_") for name in ids]
    if all(a < b for a, b in pairwise(ids)):
        return ids
    return [f"{place:0{_ID_DIGITS}}_{name}" for place, name in enumerate(ids, start=1)]


def frames_of(table: CsvTable, grasp: GraspRows, track: GraspTrack) -> Frames:
    """The frames of a grasp.

    Where the file of the hand's motion has phases, its rows are the frames, and every row of `table` must be at the
    time of one. Else the times in `table` are the frames, with its own phases; without any, all are hold: files of
    the closed hand are what the thesis's program recorded (section 5.3).
    """
    if table.has("time"):
        times = table.numbers["time"][grasp.rows]
    else:
        if len(track.time_s) > 1:
            found = f"none, where {track.source.file} has {len(track.time_s)} moments of grasp {format_value(grasp.id)}"
            table.at(0).fail("a column time", found, "add it, or give the hand once for each grasp")
        times = np.full(len(grasp.rows), track.time_s[0])
    if track.phase is not None:
        frame = _nearest(track.time_s, times)
        apart = np.abs(track.time_s[frame] - times)
        if apart.max() > TIME_TOLERANCE_S:
            at = int(np.argmax(apart > TIME_TOLERANCE_S))
            expected = f"a time that {track.source.file} has too, within {TIME_TOLERANCE_S * 1000:g} ms"
            remedy = "write both at the same moments, or put the phases into this file"
            table.at(grasp.rows[at], "time").fail(expected, f"{times[at]:.9g}", remedy)
        return Frames(track.time_s, track.phase, frame)
    unique, frame = np.unique(times, return_inverse=True)
    if not table.has("phase"):
        return Frames(unique, np.full(len(unique), Phase.HOLD, np.uint8), frame)
    texts = table.texts["phase"]
    given = np.array([phase_number(texts[row], table.at(row, "phase")) for row in grasp.rows], np.uint8)
    phase = np.zeros(len(unique), np.uint8)
    phase[frame] = given
    other = phase[frame] != given
    if other.any():
        at = int(np.argmax(other))
        found = f"{given[at]} and {phase[frame[at]]} at {times[at]:.9g} s"
        table.at(grasp.rows[at], "phase").fail("one phase at a time", found, "correct one of them")
    return Frames(unique, phase, frame)


def _nearest(known: NDArray[np.float64], wanted: NDArray[np.float64]) -> NDArray[np.intp]:
    after = np.clip(np.searchsorted(known, wanted), 0, len(known) - 1)
    before = np.maximum(after - 1, 0)
    return np.where(np.abs(known[before] - wanted) <= np.abs(known[after] - wanted), before, after)
