"""Contact points that Gazebo reported, as CSV: what the thesis's simulator worked from (section 4.2.2, Figure 4.6).

A row is a contact point in the world; a row without x, y, z is a frame without contact. A contact is felt by every
taxel whose centre is nearer than a threshold, which is the distance from tip to rim of the thesis's cones
(`taxel.sim.cone_sensing`). Without forces these taxels carry a nominal force. With forces, each contact's is shared
out among them, the more to a taxel the nearer it is, and none of it is lost.
"""

import os
from dataclasses import dataclass
from typing import NoReturn

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.distance import cdist

from taxel.hand import Hand
from taxel.hand.errors import format_value
from taxel.hand.kinematics import compute_taxel_positions
from taxel.sim.cone_sensing import ConeSensing, base_radius, nominal_forces
from taxel.sim.importers.csv_grasps import PlacedGrasp, frame_rows, read_hand, write_grasps
from taxel.sim.importers.csv_table import Column, CsvTable, read_csv
from taxel.sim.importers.errors import near_names
from taxel.sim.importers.grasp_rows import LABELS
from taxel.sim.importers.options import ImportOptions, ImportReport
from taxel.sim.importers.records import check_new
from taxel.types import FloatArray

__all__ = ["CONTACT_COLUMNS", "default_threshold", "import_contacts", "shared_forces"]

POSITION = ("x", "y", "z")
NORMAL = ("nx", "ny", "nz")
FORCE = ("fx", "fy", "fz")

CONTACT_COLUMNS = (
    *LABELS,
    Column("time", aliases=("timestamp", "time_s", "stamp", "t"), required=True),
    Column("phase", "text"),
    Column("board", "text", ("sensor", "sensor_name")),
    Column("collision", "text", ("collision1", "collision_1", "collision_name")),
    Column("link", "text", ("link_name", "body")),
    *(Column(n, aliases=(f"p{n}", f"pos_{n}", f"position_{n}"), required=True, blank=True) for n in POSITION),
    *(Column(f"n{n}", aliases=(f"normal_{n}",), blank=True) for n in POSITION),
    *(Column(f"f{n}", aliases=(f"force_{n}",), blank=True) for n in POSITION),
    Column("force", aliases=("force_n", "normal_force"), blank=True),
    Column("depth", aliases=("depth_m", "penetration"), blank=True),
)

FAR_M = 0.05
"""A grasp whose contacts are all farther than this from every taxel is of another frame or unit."""

_LEAST_WEIGHT = 1e-6
_ROUNDING = 1e-9


def default_threshold(hand: Hand) -> float:
    """The thesis's threshold, metres: 2.35 mm for its taxels (Figure 4.7)."""
    return ConeSensing(base_radius(hand)).threshold_m


def import_contacts(
    contacts: str | os.PathLike[str],
    out: str | os.PathLike[str],
    *,
    joints: str | os.PathLike[str] | None = None,
    poses: str | os.PathLike[str] | None = None,
    threshold_m: float | None = None,
    options: ImportOptions | None = None,
) -> ImportReport:
    """Turn a CSV file of contact points into a grasp dataset.

    contacts: with `CONTACT_COLUMNS`, metres and newtons, world. joints or poses: where the hand was, see
    `hand_motion.read_joints` and `read_poses`. threshold_m: from contact to taxel centre; None: `default_threshold`.

    Raises ImportDataError for the first mistake in a file, DatasetError for `out`, ValueError for a threshold that is
    not above 0 and for joints and poses both or neither.
    """
    options = options or ImportOptions()
    threshold = default_threshold(options.hand) if threshold_m is None else threshold_m
    if not (np.isfinite(threshold) and threshold > 0):
        raise ValueError(f"threshold_m: expected metres above 0, found {threshold}")
    check_new(out, options.overwrite)
    contacts_read = _contacts(read_csv(contacts, CONTACT_COLUMNS, options.progress), options.hand)
    motion = read_hand(joints, poses, options)

    def feel(one: PlacedGrasp, report: ImportReport) -> FloatArray:
        return _felt(contacts_read, one, options.hand, threshold, report)

    how = "nominal forces" if contacts_read.force is None else "given forces"
    what = f"import of contact points, threshold {threshold * 1e3:.4g} mm, {how}"
    return write_grasps(contacts_read.table, motion, out, feel, what, options)


@dataclass(frozen=True, eq=False)
class _Contacts:
    """Contact points of a file, r rows. there: bool[r], rows that are contacts. point: f64[r, 3]. force: f64[r] or
    None. board: i64[r], -1 where not said.
    """

    table: CsvTable
    there: NDArray[np.bool_]
    point: FloatArray
    force: FloatArray | None
    board: NDArray[np.int64]


def _contacts(table: CsvTable, hand: Hand) -> _Contacts:
    there = _contact_rows(table)
    point = np.column_stack([table.numbers[name] for name in POSITION])
    return _Contacts(table, there, point, _magnitudes(table, there), _boards(table, hand))


def _felt(contacts: _Contacts, one: PlacedGrasp, hand: Hand, threshold_m: float, report: ImportReport) -> FloatArray:
    """Contact forces of one grasp, f64[T, n]."""
    centres = compute_taxel_positions(hand, one.hand.sensor_pose)
    result, nearest = np.zeros(centres.shape[:2]), np.inf
    frames = frame_rows(one, contacts.there)
    for index, rows in frames:
        board = contacts.board[rows, None]
        gap = np.where((board >= 0) & (board != hand.board_index), np.inf, cdist(contacts.point[rows], centres[index]))
        force = None if contacts.force is None else contacts.force[rows]
        result[index] = shared_forces(gap, threshold_m, force)
        lost = gap.min(axis=1) > threshold_m * (1 + _ROUNDING)
        nearest = min(nearest, float(gap.min()))
        report.contacts += len(rows)
        report.far_contacts += int(lost.sum())
        report.far_force_n += 0.0 if force is None else float(force[lost].sum())
    if frames and nearest > FAR_M:
        _elsewhere(contacts.table, int(frames[0][1][0]), nearest)
    return result


def shared_forces(gap: FloatArray, threshold_m: float, force: FloatArray | None) -> FloatArray:
    """Forces on n taxels, f64[n], newtons, from c contacts.

    gap: f64[c, n], from contact to taxel centre, metres. force: f64[c] of each contact; None: nominal. A contact's
    force is shared out among the taxels up to the threshold, by weights that fall linearly to 0 there.
    """
    within = gap <= threshold_m * (1 + _ROUNDING)
    if force is None:
        return nominal_forces(np.any(within, axis=0))
    # The smallest weight keeps the force of a contact whose only taxel is exactly at the threshold.
    weight = np.where(within, np.maximum(1.0 - np.where(within, gap, 0.0) / threshold_m, _LEAST_WEIGHT), 0.0)
    total = weight.sum(axis=1)
    share = np.divide(force, total, out=np.zeros_like(force), where=total > 0)
    return np.asarray(share @ weight)


def _contact_rows(table: CsvTable) -> NDArray[np.bool_]:
    """Which rows are contacts, bool[r]; a row without all of x, y, z is a frame without contact."""
    blank = np.column_stack([np.isnan(table.numbers[name]) for name in POSITION])
    partly = blank.any(axis=1) & ~blank.all(axis=1)
    if partly.any():
        row = int(np.argmax(partly))
        column = POSITION[int(np.argmax(blank[row]))]
        remedy = "give x, y and z, or none of them for a frame without contact"
        table.at(row, column).fail("a finite number", "nothing", remedy)
    there = np.asarray(~blank.any(axis=1))
    for name in (*NORMAL, *FORCE, "force", "depth"):
        missing = there & np.isnan(table.numbers[name]) if name in table.numbers else np.zeros(1, bool)
        if missing.any():
            table.at(int(np.argmax(missing)), name).fail(
                "a finite number", "nothing", "fill it in, or leave the column out"
            )
    return there


def _magnitudes(table: CsvTable, there: NDArray[np.bool_]) -> FloatArray | None:
    """Force of each contact along its normal, newtons, f64[r]; None if the file has none.

    A vector without a normal counts in full. Its sign depends on which of the two bodies Gazebo named first.
    """
    vector, normal = table.vectors(FORCE), _normals(table, there)
    if "force" in table.numbers:
        if vector is not None:
            table.source.at(1).fail("fx, fy, fz or force", "both", "leave out one of the two")
        force = table.numbers["force"]
        negative = there & (force < 0)
        if negative.any():
            row = int(np.argmax(negative))
            table.at(row, "force").fail("newtons of 0 or more", f"{force[row]:g}", "a contact presses; give its size")
        return force
    if vector is None:
        return None
    if normal is None:
        return np.asarray(np.linalg.norm(vector, axis=1))
    return np.asarray(np.abs(np.sum(vector * normal, axis=1)))


def _normals(table: CsvTable, there: NDArray[np.bool_]) -> FloatArray | None:
    normal = table.vectors(NORMAL)
    if normal is None:
        return None
    length = np.linalg.norm(normal, axis=1)
    if (there & (length == 0)).any():
        row = int(np.argmax(there & (length == 0)))
        table.at(row, "nx").fail("a direction", "0, 0, 0", "give the normal, or leave out its columns")
    return np.asarray(normal / np.where(length > 0, length, 1.0)[:, None])


def _boards(table: CsvTable, hand: Hand) -> NDArray[np.int64]:
    """Index of the board that a contact is said to be on, i64[r]; -1: not said."""
    result = np.full(len(table.line), -1, np.int64)
    names = {board.name: index for index, board in enumerate(hand.boards)}
    for row, name in enumerate(table.texts.get("board", ())):
        if name not in names:
            remedy = f"a name of Gazebo's belongs into a column collision ({near_names(name, names)})"
            table.at(row, "board").fail(f"a board of {hand.name}", format_value(name), remedy)
        result[row] = names[name]
    return result


def _elsewhere(table: CsvTable, row: int, nearest: float) -> NoReturn:
    expected = f"contacts of a grasp on the hand, one within {FAR_M * 1000:g} mm of a taxel"
    remedy = "give metres, in the frame that the hand's poses are in (the robot's base)"
    table.at(row, "x").fail(expected, f"the nearest {nearest:.3g} m away", remedy)
