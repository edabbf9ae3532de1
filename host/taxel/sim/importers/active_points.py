"""Import of active taxels as 3-D coordinates in CSV: the output format of the thesis's simulator.

Source: section 4.2.2 and Figure 4.6 of the thesis.
"""

import os

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from taxel.hand.kinematics import compute_taxel_positions
from taxel.sim.cone_sensing import assign_nominal_force
from taxel.sim.importers.csv_grasps import PosedGrasp, group_rows_by_frame, read_hand, write_grasps
from taxel.sim.importers.csv_table import Column, CsvTable, read_csv
from taxel.sim.importers.grasp_rows import LABELS
from taxel.sim.importers.options import ImportOptions, ImportReport
from taxel.sim.importers.records import refuse_existing_file
from taxel.types import FloatArray

__all__ = ["MATCH_M", "POINT_COLUMNS", "import_active"]

MATCH_M = 0.001
"""Largest distance of a point from the centre of its taxel: a fifth of the pitch, so that the taxel is unambiguous."""

POINT_COLUMNS = (
    *LABELS,
    Column("time", aliases=("timestamp", "time_s", "stamp", "t")),
    Column("phase", "text"),
    *(Column(n, aliases=(f"p{n}", f"pos_{n}", f"position_{n}"), required=True) for n in ("x", "y", "z")),
    Column("active", "integer", ("is_active", "activated")),
)


def import_active(
    points: str | os.PathLike[str],
    out: str | os.PathLike[str],
    *,
    joints: str | os.PathLike[str] | None = None,
    poses: str | os.PathLike[str] | None = None,
    options: ImportOptions | None = None,
) -> ImportReport:
    """Convert a CSV file of active taxels into a grasp dataset.

    A point belongs to the taxel whose centre is nearest for the pose of the hand at that time. Taxels that are not
    listed are inactive. Active taxels carry a nominal force. Without the column `time`, a grasp is one frame.

    Args:
        points: CSV with `POINT_COLUMNS`; positions in the world, metres. Without the column `active`, all points
            are active.
        out: the dataset.
        joints: CSV of joint angles, see `hand_motion.read_joints`; exactly one of joints and poses.
        poses: CSV of poses, see `hand_motion.read_poses`.
        options: common options.

    Raises:
        ImportDataError: the first error in a file, such as a point farther than `MATCH_M` from every taxel, or a taxel
            twice in a frame.
        DatasetError: `out` cannot be written.
        ValueError: both joints and poses are given, or neither.
    """
    options = options or ImportOptions()
    refuse_existing_file(out, options.overwrite)
    table = read_csv(points, POINT_COLUMNS, options.progress)
    positions = np.column_stack([table.numbers[name] for name in ("x", "y", "z")])
    active = table.numbers.get("active", np.ones(len(positions)))
    is_invalid = active > 1
    if is_invalid.any():
        row = int(np.argmax(is_invalid))
        table.at(row, "active").fail("0 or 1", f"{active[row]:g}", "write 1 for an active taxel")

    motion = read_hand(joints, poses, options)

    def compute_forces(grasp: PosedGrasp, report: ImportReport) -> FloatArray:
        """Return the nominal force of each taxel, f64[T, n], newtons, and count the active points in `report`."""
        centres = compute_taxel_positions(options.hand, grasp.hand_track.sensor_pose)
        is_active = np.zeros(centres.shape[:2], bool)
        for frame, rows in group_rows_by_frame(grasp, np.ones(len(positions), bool)):
            is_active[frame, _match_taxels(table, rows, positions[rows], centres[frame])] = active[rows] > 0
            report.contacts += int(active[rows].sum())
        return assign_nominal_force(is_active)

    return write_grasps(table, motion, out, compute_forces, "import of active taxels, nominal forces", options)


def _match_taxels(table: CsvTable, rows: NDArray[np.intp], points: FloatArray, centres: FloatArray) -> NDArray[np.intp]:
    """Return the index of the taxel nearest to each of p points of a frame, i64[p].

    rows: i64[p], row of each point in the table. points: f64[p, 3], metres, world. centres: f64[n, 3], taxel centres.
    Raises ImportDataError for a point without a taxel, and for two points of the same taxel.
    """
    nearest = cKDTree(centres).query(points)
    distance, taxel = np.asarray(nearest[0]), np.asarray(nearest[1], np.intp)
    if (distance > MATCH_M).any():
        index = int(np.argmax(distance > MATCH_M))
        expected = f"a point within {MATCH_M * 1e3:g} mm of a taxel"
        remedy = "give world coordinates in metres, and the joint angles at the same time"
        table.at(rows[index], "x").fail(expected, f"the nearest taxel {distance[index] * 1e3:.4g} mm away", remedy)
    first_uses = np.unique(taxel, return_index=True)[1]
    repeated = np.setdiff1d(np.arange(len(taxel)), first_uses)
    if len(repeated):
        text = f"taxel {taxel[repeated[0]]} a second time in one frame"
        table.at(rows[repeated[0]], "x").fail("each taxel once", text, "remove the row, or add a column time")
    return taxel
