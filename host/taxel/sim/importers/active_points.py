"""The thesis's own output: active taxels as 3D coordinates in CSV (section 4.2.2, Figure 4.6)."""

import os

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from taxel.hand.kinematics import compute_taxel_positions
from taxel.sim.cone_sensing import nominal_forces
from taxel.sim.importers.csv_grasps import PlacedGrasp, frame_rows, read_hand, write_grasps
from taxel.sim.importers.csv_table import Column, CsvTable, read_csv
from taxel.sim.importers.grasp_rows import LABELS
from taxel.sim.importers.options import ImportOptions, ImportReport
from taxel.sim.importers.records import check_new
from taxel.types import FloatArray

__all__ = ["MATCH_M", "POINT_COLUMNS", "import_active"]

MATCH_M = 0.001
"""How far a point may lie from its taxel's centre: a fifth of the pitch, so that no other taxel can be meant."""

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
    """Turn a CSV file of active taxels, `POINT_COLUMNS`, into a grasp dataset.

    A point, metres, world, belongs to the taxel whose centre is nearest where the hand was (joints or poses, as for
    `import_contacts`). Without a column active all points are active; taxels that are not listed are not. Active
    taxels carry a nominal force. Without a column time a grasp is one frame.

    Raises ImportDataError for the first mistake in a file, such as a point farther than `MATCH_M` from every taxel or
    a taxel twice in a frame; DatasetError for `out`; ValueError for joints and poses both or neither.
    """
    options = options or ImportOptions()
    check_new(out, options.overwrite)
    table = read_csv(points, POINT_COLUMNS, options.progress)
    where = np.column_stack([table.numbers[name] for name in ("x", "y", "z")])
    active = table.numbers.get("active", np.ones(len(where)))
    wrong = active > 1
    if wrong.any():
        row = int(np.argmax(wrong))
        table.at(row, "active").fail("0 or 1", f"{active[row]:g}", "write 1 for an active taxel")

    motion = read_hand(joints, poses, options)

    def feel(one: PlacedGrasp, report: ImportReport) -> FloatArray:
        centres = compute_taxel_positions(options.hand, one.hand.sensor_pose)
        result = np.zeros(centres.shape[:2], bool)
        for index, rows in frame_rows(one, np.ones(len(where), bool)):
            result[index, _matched(table, rows, where[rows], centres[index])] = active[rows] > 0
            report.contacts += int(active[rows].sum())
        return nominal_forces(result)

    return write_grasps(table, motion, out, feel, "import of active taxels, nominal forces", options)


def _matched(table: CsvTable, rows: NDArray[np.intp], points: FloatArray, centres: FloatArray) -> NDArray[np.intp]:
    """The taxel of each point of a frame, i64[p]; each at most once."""
    found = cKDTree(centres).query(points)
    gap, taxel = np.asarray(found[0]), np.asarray(found[1], np.intp)
    if (gap > MATCH_M).any():
        at = int(np.argmax(gap > MATCH_M))
        expected = f"a point within {MATCH_M * 1e3:g} mm of a taxel"
        remedy = "give world coordinates, metres, and the joint angles of the same moment"
        table.at(rows[at], "x").fail(expected, f"the nearest {gap[at] * 1e3:.4g} mm away", remedy)
    first = np.unique(taxel, return_index=True)[1]
    again = np.setdiff1d(np.arange(len(taxel)), first)
    if len(again):
        text = f"taxel {taxel[again[0]]} a second time in one frame"
        table.at(rows[again[0]], "x").fail("each taxel once", text, "remove the row, or add a column time")
    return taxel
