"""Import of Gazebo contact points in CSV, the input of the thesis's simulator (section 4.2.2, Figure 4.6).

A row is a contact point in the world; a row without x, y, z is a frame without contact. A contact acts on every taxel
whose centre is within a threshold distance: by default the slant height of the cones of the thesis
(`taxel.sim.cone_sensing`). If the file has no forces, each of these taxels carries a nominal force. If the file has
forces, the force of a contact is distributed over these taxels with weights that decrease with the distance; the sum
of the forces is preserved.
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
from taxel.sim.cone_sensing import ConeSensing, assign_nominal_force, compute_base_radius
from taxel.sim.importers.csv_grasps import PosedGrasp, group_rows_by_frame, read_hand, write_grasps
from taxel.sim.importers.csv_table import Column, CsvTable, read_csv
from taxel.sim.importers.errors import suggest_names
from taxel.sim.importers.grasp_rows import LABELS
from taxel.sim.importers.options import ImportOptions, ImportReport
from taxel.sim.importers.records import refuse_existing_file
from taxel.types import FloatArray

__all__ = ["CONTACT_COLUMNS", "compute_default_threshold", "distribute_forces", "import_contacts"]

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
"""If all contacts of a grasp are farther than this from every taxel, the file uses another frame or unit."""

_MIN_WEIGHT = 1e-6  # of a taxel within the threshold
_ROUNDING = 1e-9  # relative tolerance of comparisons with the threshold


def compute_default_threshold(hand: Hand) -> float:
    """Compute the distance threshold of the thesis, metres: 2.35 mm for 3 mm taxels (Figure 4.7)."""
    return ConeSensing(compute_base_radius(hand)).threshold_m


def import_contacts(
    contacts: str | os.PathLike[str],
    out: str | os.PathLike[str],
    *,
    joints: str | os.PathLike[str] | None = None,
    poses: str | os.PathLike[str] | None = None,
    threshold_m: float | None = None,
    options: ImportOptions | None = None,
) -> ImportReport:
    """Convert a CSV file of contact points into a grasp dataset.

    Args:
        contacts: CSV with `CONTACT_COLUMNS`; positions in the world, metres; forces in newtons.
        out: the dataset.
        joints: CSV of joint angles, see `hand_motion.read_joints`; exactly one of joints and poses.
        poses: CSV of poses, see `hand_motion.read_poses`.
        threshold_m: largest distance from a contact to the centre of a taxel on which it acts; None:
            `compute_default_threshold`.
        options: common options.

    Raises:
        ImportDataError: the first error in a file.
        DatasetError: `out` cannot be written.
        ValueError: a threshold that is not above 0; both joints and poses are given, or neither.
    """
    options = options or ImportOptions()
    threshold = compute_default_threshold(options.hand) if threshold_m is None else threshold_m
    if not (np.isfinite(threshold) and threshold > 0):
        raise ValueError(f"threshold_m: expected metres above 0, found {threshold}")
    refuse_existing_file(out, options.overwrite)
    contact_points = _make_contact_points(read_csv(contacts, CONTACT_COLUMNS, options.progress), options.hand)
    motion = read_hand(joints, poses, options)

    def compute_forces(grasp: PosedGrasp, report: ImportReport) -> FloatArray:
        """Return the contact force of each taxel in a grasp, f64[T, n], newtons, and count its contacts in `report`."""
        return _compute_taxel_forces(contact_points, grasp, options.hand, threshold, report)

    force_source = "nominal forces" if contact_points.force is None else "given forces"
    description = f"import of contact points, threshold {threshold * 1e3:.4g} mm, {force_source}"
    return write_grasps(contact_points.table, motion, out, compute_forces, description, options)


@dataclass(frozen=True, eq=False)
class _ContactPoints:
    """Contact points of a CSV file with r rows.

    is_contact: bool[r]; false for a frame without contact. position: f64[r, 3], world, metres. force: f64[r], newtons;
    None without forces. board: i64[r], the only board on which a contact acts; -1: any board.
    """

    table: CsvTable
    is_contact: NDArray[np.bool_]
    position: FloatArray
    force: FloatArray | None
    board: NDArray[np.int64]


def _make_contact_points(table: CsvTable, hand: Hand) -> _ContactPoints:
    """Extract the contact points from a CSV table. Raises ImportDataError for the first error."""
    is_contact = _find_contact_rows(table)
    position = np.column_stack([table.numbers[name] for name in POSITION])
    return _ContactPoints(table, is_contact, position, _normal_forces(table, is_contact), _board_indices(table, hand))


def _compute_taxel_forces(
    contacts: _ContactPoints, grasp: PosedGrasp, hand: Hand, threshold_m: float, report: ImportReport
) -> FloatArray:
    """Distribute the contact forces of one grasp over the taxels, f64[T, n], newtons.

    threshold_m: largest distance from a contact to the centre of a taxel on which it acts. The report counts all
    contacts and those that act on no taxel. Raises ImportDataError if no contact is within `FAR_M` of a taxel.
    """
    centres = compute_taxel_positions(hand, grasp.hand_track.sensor_pose)
    forces, smallest_distance = np.zeros(centres.shape[:2]), np.inf
    frames = group_rows_by_frame(grasp, contacts.is_contact)
    for frame, rows in frames:
        board = contacts.board[rows, None]
        is_excluded = (board >= 0) & (board != hand.board_index)
        distance = np.where(is_excluded, np.inf, cdist(contacts.position[rows], centres[frame]))
        force = None if contacts.force is None else contacts.force[rows]
        forces[frame] = distribute_forces(distance, threshold_m, force)
        is_far = distance.min(axis=1) > threshold_m * (1 + _ROUNDING)
        smallest_distance = min(smallest_distance, float(distance.min()))
        report.contacts += len(rows)
        report.far_contacts += int(is_far.sum())
        report.far_force_n += 0.0 if force is None else float(force[is_far].sum())
    if frames and smallest_distance > FAR_M:
        _fail_for_distance(contacts.table, int(frames[0][1][0]), smallest_distance)
    return forces


def distribute_forces(distance: FloatArray, threshold_m: float, force: FloatArray | None) -> FloatArray:
    """Distribute the forces of c contacts over n taxels, f64[n], newtons.

    distance: f64[c, n], from contact to taxel centre, metres. force: f64[c] of the contacts, newtons; None: a nominal
    force on each taxel within the threshold. The force of a contact is divided among the taxels within the threshold,
    with weights that decrease linearly to 0 at the threshold.
    """
    is_within = distance <= threshold_m * (1 + _ROUNDING)
    if force is None:
        return assign_nominal_force(np.any(is_within, axis=0))
    # The smallest weight preserves the force of a contact whose only taxel is exactly at the threshold.
    linear = 1.0 - np.where(is_within, distance, 0.0) / threshold_m
    weight = np.where(is_within, np.maximum(linear, _MIN_WEIGHT), 0.0)
    total = weight.sum(axis=1)
    share = np.divide(force, total, out=np.zeros_like(force), where=total > 0)
    return np.asarray(share @ weight)


def _find_contact_rows(table: CsvTable) -> NDArray[np.bool_]:
    """Find the rows that are contacts, bool[r]; a row without x, y and z is a frame without contact.

    Raises ImportDataError for a row with only some coordinates, and for a contact without a value in a column of the
    file for normal, force or depth.
    """
    is_blank = np.column_stack([np.isnan(table.numbers[name]) for name in POSITION])
    is_partly_blank = is_blank.any(axis=1) & ~is_blank.all(axis=1)
    if is_partly_blank.any():
        row = int(np.argmax(is_partly_blank))
        column = POSITION[int(np.argmax(is_blank[row]))]
        remedy = "give x, y and z, or none of them for a frame without contact"
        table.at(row, column).fail("a finite number", "nothing", remedy)
    is_contact = np.asarray(~is_blank.any(axis=1))
    for name in (*NORMAL, *FORCE, "force", "depth"):
        is_missing = is_contact & np.isnan(table.numbers[name]) if name in table.numbers else np.zeros(1, bool)
        if is_missing.any():
            row = int(np.argmax(is_missing))
            table.at(row, name).fail("a finite number", "nothing", "add the value, or leave out the column")
    return is_contact


def _normal_forces(table: CsvTable, is_contact: NDArray[np.bool_]) -> FloatArray | None:
    """Compute the magnitude of each contact's force along its normal, f64[r], newtons; None if the file has no forces.

    If the file has no normals, the result is the length of the force vector. The sign is ignored, because it depends on
    the order in which Gazebo lists the two bodies. Raises ImportDataError for a negative force.
    """
    vector, normal = table.vectors(FORCE), _unit_normals(table, is_contact)
    if "force" in table.numbers:
        if vector is not None:
            table.source.at(1).fail("fx, fy, fz or force", "both", "leave out one of the two")
        force = table.numbers["force"]
        is_negative = is_contact & (force < 0)
        if is_negative.any():
            row = int(np.argmax(is_negative))
            table.at(row, "force").fail("newtons of 0 or more", f"{force[row]:g}", "give the magnitude of the force")
        return force
    if vector is None:
        return None
    if normal is None:
        return np.asarray(np.linalg.norm(vector, axis=1))
    return np.asarray(np.abs(np.sum(vector * normal, axis=1)))


def _unit_normals(table: CsvTable, is_contact: NDArray[np.bool_]) -> FloatArray | None:
    """Return the unit normal of each contact, f64[r, 3]; None if the file has no normals.

    Raises ImportDataError for a contact with a zero normal.
    """
    normal = table.vectors(NORMAL)
    if normal is None:
        return None
    length = np.linalg.norm(normal, axis=1)
    is_zero = is_contact & (length == 0)
    if is_zero.any():
        row = int(np.argmax(is_zero))
        table.at(row, "nx").fail("a direction", "0, 0, 0", "give the normal, or leave out its columns")
    return np.asarray(normal / np.where(length > 0, length, 1.0)[:, None])


def _board_indices(table: CsvTable, hand: Hand) -> NDArray[np.int64]:
    """Return the index of the board named in each row of the table, i64[r]; -1 in all rows without a column "board".

    Raises ImportDataError for an unknown board.
    """
    indices = np.full(len(table.line), -1, np.int64)
    names = {board.name: index for index, board in enumerate(hand.boards)}
    for row, name in enumerate(table.texts.get("board", ())):
        if name not in names:
            remedy = f"write names of Gazebo into a column collision ({suggest_names(name, names)})"
            table.at(row, "board").fail(f"a board of {hand.name}", format_value(name), remedy)
        indices[row] = names[name]
    return indices


def _fail_for_distance(table: CsvTable, row: int, smallest_distance_m: float) -> NoReturn:
    """Raise ImportDataError for a grasp whose contacts are all far from the hand.

    row: a row of the grasp. smallest_distance_m: from a contact to the nearest taxel.
    """
    expected = f"contacts of a grasp on the hand, at least one within {FAR_M * 1000:g} mm of a taxel"
    remedy = "give metres, in the frame of the hand's poses (the base of the robot)"
    table.at(row, "x").fail(expected, f"the nearest {smallest_distance_m:.3g} m away", remedy)
