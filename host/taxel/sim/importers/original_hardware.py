"""Import of the CSV files that the original ROS stack recorded on the hardware.

For each grasp the original stack writes these files without a header; N is the number of the iteration:

    GRASP_active_points_coordinates_N.csv     x,y,z,counts; one row for each taxel of the 22 boards 8 to 29
    GRASP_inactive_points_coordinates_N.csv   the same for the inactive taxels
    GRASP_joints_pos_N.csv                    name,position; six joints of the arm and 16 of the hand, radians

A row of a taxel that belongs to the other file is 0,0,0,0. The counts are the absolute difference from the baseline.
The raw-contacts file belongs to the simulation and is not read here.
"""

import csv
import os
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from taxel.grasp.timeline import Phase
from taxel.hand import Hand, load_hand
from taxel.hand.errors import HandGeometryError, format_value
from taxel.hand.kinematics import Kinematics, compute_taxel_positions
from taxel.hand.robot import load_robot
from taxel.hand.transforms import make_pose
from taxel.recording.grasp_format import BASELINE_FRAMES
from taxel.recording.grasp_record import GraspRecord
from taxel.sim.importers.csv_grasps import make_meshes
from taxel.sim.importers.errors import FileLocation, suggest_names
from taxel.sim.importers.options import ImportOptions, ImportReport
from taxel.sim.importers.records import RATE_HZ, open_new_dataset, refuse_existing_file
from taxel.sim.sensor_model import SimSensor
from taxel.types import BoolArray, FloatArray

__all__ = ["BASE_IN_WORLD", "ORIGINAL_OBJECT_POSE", "HardwareImportReport", "import_original_hardware"]

BASE_IN_WORLD: Final = make_pose([-0.0093, 0.3375, 0.99275], [0.0, 0.0, 0.0, 1.0])
"""Pose of the robot's base in the frame `world` of the original stack (workstation URDF; yaw 180 degrees)."""

ORIGINAL_OBJECT_POSE: Final = np.linalg.inv(BASE_IN_WORLD) @ make_pose(
    [-0.0049, -0.2062, 1.01645], [np.cos(0.0207 / 2), 0.0, 0.0, np.sin(0.0207 / 2)]
)
"""Pose of the object relative to the robot's base, on the table as in the planning scene of the original stack."""

_FILE_NAME = re.compile(r"(?P<grasp>.+)_active_points_coordinates_(?P<iteration>\d+)\.csv")
_POINT_VALUES = 4
_ARM_JOINTS = ("shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3")
_HAND_JOINTS = tuple(f"{finger}_j{joint}" for finger in ("ff", "mf", "rf", "th") for joint in range(4))
_JOINT_NAMES = {f"{name}_joint": name for name in _ARM_JOINTS} | {
    f"joint_{index}_0": name for index, name in enumerate(_HAND_JOINTS)
}
"""Joints of the robot by their names in the original files; the driver of the hand also writes joint_0.0."""


@dataclass
class HardwareImportReport(ImportReport):
    """Numbers of imported items of the original hardware.

    active_points: rows of the files of active points. position_deviation_m: median distance between the recorded
    positions and the taxels of the hand description at the recorded joint angles, metres; nan without positions.
    """

    active_points: int = 0
    position_deviation_m: float = float("nan")


@dataclass(frozen=True, eq=False)
class _HardwareGrasp:
    """The files of one grasp for a hand of n taxels on s boards.

    position: f64[n, 3], metres, frame `world` of the original stack; nan where a taxel is in neither file. signal:
    f64[n], absolute difference from the baseline, counts. is_used: bool[s], boards with at least one row that is not 0.
    joints: f64[j], radians.
    """

    grasp: str
    iteration: int
    position: FloatArray
    signal: FloatArray
    active_points: int
    is_used: BoolArray
    joints: FloatArray


def import_original_hardware(
    files: Iterable[str | os.PathLike[str]],
    out: str | os.PathLike[str],
    *,
    object_name: str,
    approach: str | None = None,
    options: ImportOptions | None = None,
) -> HardwareImportReport:
    """Convert the files of the original stack's hardware into a grasp dataset with source "real".

    The files contain one moment of each grasp, and neither raw counts nor a baseline. A grasp becomes frames of the
    phase baseline, followed by one frame of the phase hold. The baseline is the nominal baseline of the simulator's
    sensor. The files contain the difference from the baseline without its sign; every difference is taken as a
    decrease, so that a raw count is the baseline minus the recorded difference.

    Args:
        files: the files GRASP_active_points_coordinates_N.csv. The two other files of each grasp are beside it.
        out: the dataset.
        object_name: grasped object, a key of `options.objects`.
        approach: name of the approach of all grasps; None: the part GRASP of the file name.
        options: common options; wrist_pose, sensor noise and seed are not used. object_poses: relative to the robot's
            base; without an entry, `ORIGINAL_OBJECT_POSE`. baseline_frames: number of added baseline frames; None: 100.

    Raises:
        ImportDataError: the first error in a file. DatasetError: `out` cannot be written. HandGeometryError: a hand
            without a robot.
    """
    options = options or ImportOptions(hand=load_hand("original"))
    refuse_existing_file(out, options.overwrite)
    if options.hand.robot is None:
        raise HandGeometryError(options.hand.name)
    paths = [Path(file) for file in files]
    if object_name not in options.objects:
        suggestion = suggest_names(object_name, options.objects)
        location = FileLocation(str(paths[0]) if paths else os.fspath(out))
        location.fail("an object whose shape is known", format_value(object_name), suggestion)
    grasps = [_read_grasp(path, options.hand) for path in paths]
    kinematics = Kinematics(load_robot(options.hand.robot), options.hand)
    object_pose = options.object_poses.get(object_name, ORIGINAL_OBJECT_POSE)
    meshes = make_meshes([options.objects[object_name]])
    report, deviations = HardwareImportReport(), [np.zeros(0)]
    description = "import of the original stack's hardware files, nominal baseline"
    with open_new_dataset(out, options, meshes, RATE_HZ, description, source="real") as writer:
        for number, grasp in enumerate(grasps, start=1):
            options.progress("grasps", number - 1, len(grasps))
            sensor_pose = kinematics.compute_sensor_poses(grasp.joints[None])[0]
            deviations.append(_compute_deviations(grasp, options.hand, sensor_pose))
            label = approach or grasp.grasp
            record = _make_record(grasp, object_name, label, sensor_pose, object_pose, options, report)
            writer.add(record, f"{number:04}_{grasp.grasp}_{grasp.iteration}")
    distances = np.concatenate(deviations)
    report.position_deviation_m = float(np.median(distances)) if len(distances) else float("nan")
    return report


def _make_record(
    grasp: _HardwareGrasp,
    object_name: str,
    approach: str,
    sensor_pose: FloatArray,
    object_pose: FloatArray,
    options: ImportOptions,
    report: HardwareImportReport,
) -> GraspRecord:
    """Make the dataset record of a grasp: baseline frames and one frame of the phase hold; count them in the report.

    sensor_pose: f64[s, 4, 4], poses of the brackets, and object_pose: f64[4, 4], both in the frame of the robot's base.
    """
    added = BASELINE_FRAMES if options.baseline_frames is None else options.baseline_frames
    frames = added + 1
    counts = np.full((frames, len(grasp.signal)), SimSensor().baseline_counts)
    counts[-1] -= grasp.signal
    report.grasps += 1
    report.frames += frames
    report.added_frames += added
    report.active_points += grasp.active_points
    return GraspRecord(
        object=object_name,
        approach=approach,
        iteration=grasp.iteration,
        session=0,
        timestamp=np.arange(frames) / RATE_HZ,
        phase=np.array([Phase.BASELINE] * added + [Phase.HOLD], np.uint8),
        raw_counts=np.rint(counts).astype(np.uint16),
        valid=np.tile(grasp.is_used, (frames, 1)),
        sensor_pose=sensor_pose,
        object_pose=object_pose,
        joint_position=np.tile(grasp.joints, (frames, 1)),
    )


def _compute_deviations(grasp: _HardwareGrasp, hand: Hand, sensor_pose: FloatArray) -> FloatArray:
    """Compute the distances between recorded and modelled taxel positions, f64[p], metres, of the p recorded taxels."""
    centres = compute_taxel_positions(hand, sensor_pose[None])[0]
    # The recorded positions are in the world frame of the original stack, the centres in the frame of the robot's base.
    # A row vector times the rotation matrix is rotated by the inverse rotation, from the world to the base.
    recorded = (grasp.position - BASE_IN_WORLD[:3, 3]) @ BASE_IN_WORLD[:3, :3]
    distances = np.linalg.norm(recorded - centres, axis=1)
    return np.asarray(distances[np.isfinite(distances)])


def _read_grasp(path: Path, hand: Hand) -> _HardwareGrasp:
    """Read the three files of a grasp. path: file of the active points; the other two are in the same folder.

    Both files of points have one row for each taxel. The row of a taxel is 0,0,0,0 in the file to which the taxel does
    not belong. Raises ImportDataError for an error in a file, and for files that contradict each other.
    """
    match = _FILE_NAME.fullmatch(path.name)
    if match is None:
        expected = "a name GRASP_active_points_coordinates_N.csv"
        FileLocation(str(path)).fail(expected, format_value(path.name), "keep the names of the original stack")
    grasp, iteration = match["grasp"], int(match["iteration"])
    inactive_path = path.with_name(f"{grasp}_inactive_points_coordinates_{iteration}.csv")
    active, inactive = _read_points(path), _read_points(inactive_path)
    is_active, is_inactive = np.any(active != 0, axis=1), np.any(inactive != 0, axis=1)
    if (is_active & is_inactive).any():
        row = int(np.argmax(is_active & is_inactive))
        found = f"values there and in line {row + 1} of {inactive_path.name}"
        FileLocation(str(path)).at(row + 1).fail("a taxel in one of the two files", found, "use files of one moment")
    points = np.where(is_active[:, None], active, inactive)
    rows = _find_rows(hand, points, path)
    is_present = np.any(points[rows] != 0, axis=1)
    baseline = SimSensor().baseline_counts
    if (points[rows, 3] > baseline).any():
        row = int(rows[int(np.argmax(points[rows, 3] > baseline))])
        file = path if is_active[row] else inactive_path
        expected = f"a difference of at most {baseline:g} counts, the nominal baseline"
        FileLocation(str(file)).at(row + 1).fail(expected, f"{points[row, 3]:g}", "correct the row")
    return _HardwareGrasp(
        grasp,
        iteration,
        np.where(is_present[:, None], points[rows, :3], np.nan),
        points[rows, 3],
        int(is_active[rows].sum()),
        np.array([is_present[hand.get_slice(board.address)].any() for board in hand.boards]),
        _read_joints(path.with_name(f"{grasp}_joints_pos_{iteration}.csv"), hand),
    )


@cache
def _load_complete_hand() -> Hand:
    """Return the complete original hand, whose taxel order is the order of the rows: boards 8 to 29."""
    return load_hand("original_complete")


def _find_rows(hand: Hand, points: FloatArray, path: Path) -> NDArray[np.intp]:
    """Return the file row of each taxel of a hand, i64[n].

    points: f64[1324, 4], all rows of a file. path: the file, for errors. Raises ImportDataError for a hand with boards
    that the original hand lacks, and for values in the rows of a board that the hand lacks.
    """
    complete = _load_complete_hand()
    sizes = {board.address: board.kind.taxel_count for board in complete.boards}
    for board in hand.boards:
        if sizes.get(board.address) != board.kind.taxel_count:
            found = f"{board.name} of hand {format_value(hand.name)} with {board.kind.taxel_count} taxels"
            expected = f"a board of the original hand at 0x{board.address:02X}"
            FileLocation(str(path)).fail(expected, found, "use --hand original or original_complete")
    addresses = {board.address for board in hand.boards}
    for board in complete.boards:
        rows = complete.get_slice(board.address)
        if board.address not in addresses and points[rows].any():
            line = rows.start + int(np.argmax(np.any(points[rows] != 0, axis=1))) + 1
            expected, found = f"0,0,0,0, because hand {hand.name} has no board {board.address}", "values"
            FileLocation(str(path)).at(line).fail(expected, found, "use --hand original_complete")
    slices = [complete.get_slice(board.address) for board in hand.boards]
    return np.concatenate([np.arange(each.start, each.stop) for each in slices])


def _read_points(path: Path) -> FloatArray:
    """Read a file of active or inactive points, f64[1324, 4]: x, y, z in metres, counts. Raises ImportDataError."""
    source, expected_rows = FileLocation(str(path)), _load_complete_hand().n_taxels
    rows = _read_rows(path)
    points = np.zeros((len(rows), _POINT_VALUES))
    for index, (line, values) in enumerate(rows):
        if len(values) != _POINT_VALUES:
            source.at(line).fail(
                "4 values x,y,z,counts", str(len(values)), "use files of the original stack's hardware"
            )
        points[index] = [_parse_number(text, source.at(line)) for text in values]
        if points[index, 3] < 0:
            source.at(line).fail("counts of 0 or more", values[3], "give the absolute difference from the baseline")
    if len(rows) != expected_rows:
        remedy = "use a complete file of the hardware; files of the simulation list only active taxels"
        source.fail(f"{expected_rows} rows, one for each taxel of the boards 8 to 29", str(len(rows)), remedy)
    return points


def _read_joints(path: Path, hand: Hand) -> FloatArray:
    """Read the joint angles of a file GRASP_joints_pos_N.csv, f64[j], radians, in the order of the hand's robot.

    Raises ImportDataError for an unknown, repeated or missing joint.
    """
    source, angles = FileLocation(str(path)), dict[str, float]()
    for line, values in _read_rows(path):
        location = source.at(line)
        if len(values) != len(("name", "position")):
            location.fail("2 values name,position", str(len(values)), "use files of the original stack")
        name = _JOINT_NAMES.get(values[0].replace(".", "_"))  # joint_0.0 is another spelling of joint_0_0
        if name is None:
            location.fail("a joint of arm or hand", format_value(values[0]), suggest_names(values[0], _JOINT_NAMES))
        if name in angles:
            location.fail("each joint once", f"{format_value(values[0])} again", "remove one of the rows")
        angles[name] = _parse_number(values[1], location)
    assert hand.robot is not None
    for name in load_robot(hand.robot).joint_names:
        if name not in angles:
            original = next((key for key, joint in _JOINT_NAMES.items() if joint == name), name)
            source.fail(f"a row of joint {original}", "none", "add the angle in radians")
    return np.array([angles[name] for name in load_robot(hand.robot).joint_names])


def _read_rows(path: Path) -> list[tuple[int, Sequence[str]]]:
    """Read (line number, values) of the rows of a CSV file without a header; empty lines are skipped."""
    source = FileLocation(str(path))
    if not path.is_file():
        source.fail("a CSV file", "a folder" if path.is_dir() else "no such file", "keep all files of a grasp together")
    try:
        with path.open(encoding="utf-8-sig", newline="") as stream:
            reader = csv.reader(stream, strict=True)
            return [(reader.line_num, [text.strip() for text in row]) for row in reader if any(map(str.strip, row))]
    except UnicodeDecodeError:
        source.fail("UTF-8 text", "other bytes", "copy the file again")
    except csv.Error as error:
        source.fail("comma-separated values", format_value(str(error)), "copy the file again")
    except OSError as error:
        source.fail("a readable file", error.strerror or type(error).__name__, "check its permissions")


def _parse_number(text: str, location: FileLocation) -> float:
    """Convert a string to a finite number. Raises ImportDataError for any other string."""
    try:
        value = float(text) if "_" not in text else float("nan")  # Python would accept 1_000
    except ValueError:
        value = float("nan")
    if not np.isfinite(value):
        location.fail("a finite number", format_value(text), "write it as 0.125")
    return value
