"""Import of the contact files of the original simulator: numbers without a header, one file for each grasp.

Raw contacts are x, y, z of the physics engine's contact points; active points are x, y, z, force of the active taxels.
Source: the contact plug-in of abed-almrad/BICI_SENSORS_ROS. The files name neither grasp nor board.
"""

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from taxel.errors import TaxelError
from taxel.hand import Hand
from taxel.hand.errors import format_path
from taxel.hand.transforms import apply
from taxel.input_files import TextError
from taxel.input_files.csv_rows import parse_float, read_csv_rows
from taxel.sim.cone_sensing import NOMINAL_FORCE_N
from taxel.sim.importers.active_points import MATCH_M
from taxel.sim.importers.csv_grasps import PosedGrasp, group_rows_by_frame, read_hand, write_grasps
from taxel.sim.importers.csv_table import CsvTable
from taxel.sim.importers.errors import FileLocation, ImportDataError
from taxel.sim.importers.options import ImportOptions, ImportReport
from taxel.sim.importers.records import refuse_existing_file
from taxel.sim.original_sensing import OriginalRules, StoredPoints, find_active, get_centres
from taxel.types import FloatArray

__all__ = ["OriginalGrasp", "import_original_contacts", "read_original_contacts"]

_RAW_COLUMNS, _ACTIVE_COLUMNS = 3, 4
_FAR_M = 1e6  # coordinate of taxels that the plug-in has no centre for, metres


@dataclass(frozen=True)
class OriginalGrasp:
    """Labels of imported grasps, which the files lack. object, approach: names, such as "cylinder" and "side_1"."""

    object: str
    approach: str


def _is_header(fields: Sequence[str]) -> bool:
    """Whether the first line contains the names of the columns, and no number."""
    return fields[0].strip() in {"x", "x_m"} and not any(_is_number(field) for field in fields)


def _is_number(text: str) -> bool:
    """Whether a string is a number."""
    try:
        parse_float(text)
    except ValueError:
        return False
    return True


def read_original_contacts(path: str | os.PathLike[str]) -> tuple[NDArray[np.int64], FloatArray]:
    """Read one contact file; return the line number of each row, i64[r], and the rows.

    The rows are f64[r, 3] raw contacts (x, y, z) or f64[r, 4] active points (x, y, z, force), metres, N. A first line
    of column names is permitted. Raises ImportDataError for the first error in the file.
    """
    source, file = FileLocation(os.fspath(path)), Path(path)
    if not file.is_file():
        source.fail("a CSV file", "a folder" if file.is_dir() else "no such file", "check the path")
    rows: list[list[float]] = []
    line_numbers: list[int] = []
    try:
        lines = list(read_csv_rows(file))
    except TextError as error:
        raise ImportDataError(
            format_path(source.file), error.position, error.expected, error.found, "correct this line"
        ) from None
    except OSError as error:
        source.fail("a readable file", error.strerror or type(error).__name__, "check its permissions")
    for number, fields in lines:
        if not any(field.strip() for field in fields) or (number == 1 and _is_header(fields)):
            continue
        try:
            values = [parse_float(field) for field in fields]
        except ValueError:
            values = [np.nan]
        expected = "x, y, z or x, y, z, force"
        if len(values) not in {_RAW_COLUMNS, _ACTIVE_COLUMNS} or not np.isfinite(values).all():
            source.at(number).fail(
                expected, ",".join(fields)[:40] or "nothing", "give finite numbers, metres and newtons"
            )
        if rows and len(values) != len(rows[0]):
            remedy = "give all lines of a file the same number of values"
            source.at(number).fail(f"{len(rows[0])} values, as in the lines above", str(len(values)), remedy)
        if len(values) == _ACTIVE_COLUMNS and values[3] < 0:
            source.at(number).fail("a force of 0 or more", f"{values[3]:g}", "give the norm of the force, newtons")
        rows.append(values)
        line_numbers.append(number)
    if not rows:
        source.fail("lines with coordinates", "none", "check whether the simulation saved contacts")
    return np.array(line_numbers, np.int64), np.array(rows)


def import_original_contacts(
    files: Sequence[str | os.PathLike[str]],
    out: str | os.PathLike[str],
    grasp: OriginalGrasp,
    *,
    joints: str | os.PathLike[str] | None = None,
    poses: str | os.PathLike[str] | None = None,
    rules: OriginalRules | None = None,
    options: ImportOptions | None = None,
) -> ImportReport:
    """Convert contact files of the original simulator into a grasp dataset.

    Raw contacts activate taxels by the rule of the plug-in (`find_active`) with the threshold and the centres of
    `rules`; since the files do not name boards, a contact acts on every board. An active point belongs to the taxel
    with the nearest centre, which must be within `MATCH_M`. This taxel carries the force of the point, or the nominal
    force if the force of the point is 0. Taxels that raw contacts activate carry the nominal force.

    Args:
        files: one file for each repeat of the grasp, all of one type.
        out: the dataset.
        grasp: labels of the grasps.
        joints: CSV of joint angles, see `hand_motion.read_joints`; exactly one of joints and poses. The name of a grasp
            in it is the name of the contact file without folder and suffix.
        poses: CSV of poses, see `hand_motion.read_poses`.
        rules: threshold and centres; None: those of the original.
        options: common options; the hand is the original hand.

    Raises:
        ImportDataError: the first error in a file.
        NoCodedCentresError: another hand, although `rules` use the numbers of the original hand.
        DatasetError: `out` cannot be written.
        ValueError: both joints and poses are given, or neither.
    """
    options, rules = options or ImportOptions(), rules or OriginalRules()
    refuse_existing_file(out, options.overwrite)
    centres = get_centres(options.hand, rules)
    table, values = _make_table(files, grasp)
    motion = read_hand(joints, poses, options)
    is_raw = values.shape[1] == _RAW_COLUMNS

    def compute_forces(posed: PosedGrasp, report: ImportReport) -> FloatArray:
        """Return the force of each taxel in a grasp, f64[T, n], newtons, and count its points in `report`."""
        sensors = posed.hand_track.sensor_pose
        forces = np.zeros((len(sensors), options.hand.n_taxels))
        for frame, rows in group_rows_by_frame(posed, np.ones(len(values), bool)):
            placed = _place_centres(options.hand, centres, sensors[frame])
            report.contacts += len(rows)
            if is_raw:
                forces[frame] = _activate(options.hand, placed, values[rows], rules.threshold_m, report)
            else:
                # A taxel without a centre (NaN) is placed far away, so that it is never the nearest one.
                nearest = cKDTree(np.nan_to_num(placed, nan=_FAR_M)).query(values[rows, :3])
                distance, taxel = np.asarray(nearest[0]), np.asarray(nearest[1], np.intp)
                if (distance > MATCH_M).any():
                    index = int(np.argmax(distance > MATCH_M))
                    expected = f"a point within {MATCH_M * 1e3:g} mm of a taxel"
                    remedy = "check the pose of the hand, and the centres (coded or true)"
                    found = f"the nearest taxel {distance[index] * 1e3:.4g} mm away"
                    table.at(int(rows[index])).fail(expected, found, remedy)
                forces[frame, taxel] = np.where(values[rows, 3] > 0, values[rows, 3], NOMINAL_FORCE_N)
        return forces

    kind = "raw contacts" if is_raw else "active points"
    description = f"import of {kind} of the original simulator, threshold {rules.threshold_m * 1e3:.4g} mm"
    return write_grasps(table, motion, out, compute_forces, description, options)


def _make_table(files: Sequence[str | os.PathLike[str]], grasp: OriginalGrasp) -> tuple[CsvTable, FloatArray]:
    """Join the r rows of all files into one table with labels; return the table and the numbers, f64[r, 3 or 4].

    Raises ImportDataError for an error in a file, for files with different numbers of columns, and for two files with
    the same name.
    """
    if not files:
        raise TaxelError("no contact file: give at least one file of the original simulator")
    names = [Path(file).stem for file in files]
    lines, parts = zip(*(read_original_contacts(file) for file in files), strict=True)
    locations = [FileLocation(os.fspath(file)) for file in files]
    for location, name, part in zip(locations, names, parts, strict=True):
        if names.count(name) > 1:
            location.fail("files with different names", f"{name} twice", "rename one; the name is that of the grasp")
        if part.shape[1] != parts[0].shape[1]:
            location.fail(
                f"{parts[0].shape[1]} columns, as in the first file", str(part.shape[1]), "import it separately"
            )
    lengths = [len(part) for part in parts]
    total = sum(lengths)
    texts = {
        "grasp": [name for name, length in zip(names, lengths, strict=True) for _ in range(length)],
        "object": [grasp.object] * total,
        "approach": [grasp.approach] * total,
    }
    numbers = {"iteration": np.repeat(np.arange(len(files), dtype=np.float64), lengths)}
    source = locations[0] if len(files) == 1 else FileLocation(f"{len(files)} contact files")
    row_sources = [location for location, length in zip(locations, lengths, strict=True) for _ in range(length)]
    return CsvTable(source, np.concatenate(lines), texts, numbers, row_sources), np.concatenate(parts)


def _place_centres(hand: Hand, centres: FloatArray, sensor_pose: FloatArray) -> FloatArray:
    """Transform taxel centres f64[n, 3], metres, from the brackets' frames to the world.

    sensor_pose: f64[s, 4, 4], brackets in the world.
    """
    placed = np.empty_like(centres)
    for index, board in enumerate(hand.boards):
        where = hand.get_slice(board.address)
        placed[where] = apply(sensor_pose[index], centres[where])
    return placed


def _activate(
    hand: Hand, placed: FloatArray, points: FloatArray, threshold_m: float, report: ImportReport
) -> FloatArray:
    """Activate the taxels near contact points: return `NOMINAL_FORCE_N` on active taxels and 0 on others, f64[n], N.

    placed: f64[n, 3], taxel centres in the world. points: f64[c, 3], contact points in the world. threshold_m: distance
    below which a point activates a taxel. The report counts the points that activate no taxel.
    """
    stored = StoredPoints(points, np.full(len(points), NOMINAL_FORCE_N))
    force = np.zeros(hand.n_taxels)
    for board in hand.boards:
        where = hand.get_slice(board.address)
        force[where] = find_active(placed[where], stored, threshold_m)[1]
    # A taxel without a centre (NaN) is placed far away, so that it is never the nearest one.
    distance, _ = cKDTree(np.nan_to_num(placed, nan=_FAR_M)).query(points)
    report.far_contacts += int((np.asarray(distance) >= threshold_m).sum())
    return force
