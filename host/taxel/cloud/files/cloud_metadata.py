"""Counts, grasps, approaches and inactive taxels of a cloud as columns and comments of a file.

Comments ``taxel.approach ROW NAME`` and ``taxel.grasp ROW APPROACH_ROW ID`` name the grasps to which the row numbers in
the column ``grasp`` refer. If a file has no such comments because another program wrote it, all points belong to one
grasp.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
import numpy.typing as npt

from taxel.cloud.contact_cloud import ContactCloud
from taxel.cloud.files.source import Source, convert_to_integers, parse_natural, quote

Columns = Mapping[str, npt.NDArray[np.float64]]

APPROACH: Final = "taxel.approach"
GRASP: Final = "taxel.grasp"

SCALAR_PREFIX: Final = "scalar_"
"""Prefix that CloudCompare writes before the names of scalars."""

SILENT: Final = "silent"
"""Name of the PLY element with the rows x, y, z, grasp of the inactive taxels."""

MAX_NAME_LENGTH: Final = 200
MAX_NAMES: Final = 100_000


@dataclass(frozen=True)
class GraspNames:
    """Names in the comments of a cloud file.

    grasps: identifiers of the grasps. approach: row in `approaches` of each grasp. approaches: names of the approaches.
    """

    grasps: tuple[str, ...]
    approach: tuple[int, ...]
    approaches: tuple[str, ...]


def format_comments(cloud: ContactCloud) -> list[str]:
    """Format the names of approaches and grasps as comment lines of a cloud file; none for a cloud without names."""
    if not any(cloud.grasps):
        return []
    lines = [f"{APPROACH} {row} {_printable(name)}" for row, name in enumerate(cloud.approaches)]
    rows = zip(cloud.grasp_approach.tolist(), cloud.grasps, strict=True)
    return lines + [f"{GRASP} {row} {approach} {_printable(name)}" for row, (approach, name) in enumerate(rows)]


def parse_comments(source: Source, comments: Sequence[str]) -> GraspNames | None:
    """Parse the names of approaches and grasps from the comments of a cloud file; return None without named grasps.

    Raises CloudFileError for rows that are not in order and for approaches that are not named before.
    """
    approaches: list[str] = []
    grasps: list[str] = []
    rows: list[int] = []
    for line in comments:
        key, _, remainder = line.partition(" ")
        if key == APPROACH:
            row, _, name = remainder.partition(" ")
            _check_row(source, row, len(approaches), line)
            approaches.append(name[:MAX_NAME_LENGTH])
        elif key == GRASP:
            row, _, remainder = remainder.partition(" ")
            approach, _, name = remainder.partition(" ")
            _check_row(source, row, len(grasps), line)
            number = parse_natural(approach)
            if number is None or number >= len(approaches):
                source.fail("comment", "an approach that an earlier comment names", quote(line), "correct it")
            grasps.append(name[:MAX_NAME_LENGTH])
            rows.append(number)
    return GraspNames(tuple(grasps), tuple(rows), tuple(approaches)) if grasps else None


def build_columns(cloud: ContactCloud) -> tuple[list[str], npt.NDArray[np.float64]]:
    """Return names and values, f64[N, k], of the columns of a cloud file.

    The columns are x, y, z, and counts, grasp and taxel if they are known.
    """
    names, columns = ["x", "y", "z"], [*cloud.points.T]
    if len(cloud) and not np.isnan(cloud.counts).any():
        names.append("counts")
        columns.append(cloud.counts)
    if any(cloud.grasps):
        names += ["grasp", "taxel"]
        columns += [cloud.grasp.astype(np.float64), cloud.taxel.astype(np.float64)]
    return names, np.column_stack(columns)


def build_cloud(source: Source, columns: Columns, names: GraspNames | None) -> ContactCloud:
    """Make a contact cloud from the named columns of a file. Raises CloudFileError without x, y or z.

    names: of grasps and approaches, from the comments; None: unknown.
    """
    by_name = {name.removeprefix(SCALAR_PREFIX): column for name, column in columns.items()}
    points = stack_points(source, by_name)
    cloud = ContactCloud.from_points(points, by_name.get("counts"), source.name)
    if names is None or "grasp" not in by_name:
        return cloud
    taxel = convert_to_integers(by_name["taxel"], source, "taxel") if "taxel" in by_name else cloud.taxel
    grasp = convert_to_integers(by_name["grasp"], source, "grasp")
    return ContactCloud(
        source.name, points, cloud.counts, grasp, taxel, names.grasps, np.array(names.approach), names.approaches
    )


def build_silent_rows(cloud: ContactCloud) -> npt.NDArray[np.float64]:
    """Return x, y, z and grasp of the M inactive taxels of a cloud, f64[M, 4]; no row for a cloud without grasp
    names.
    """
    rows = np.column_stack([cloud.inactive_points, cloud.inactive_grasp.astype(np.float64)])
    return np.asarray(rows[: len(rows) if any(cloud.grasps) else 0])


def add_inactive_points(source: Source, cloud: ContactCloud, columns: Columns) -> ContactCloud:
    """Return the cloud with the inactive taxels that a PLY file contains. columns: x, y, z and grasp.

    Raises CloudFileError if a column is missing.
    """
    if "grasp" not in columns:
        source.fail(SILENT, "x, y, z and grasp", "no grasp", "use the whole file")
    grasp = convert_to_integers(columns["grasp"], source, f"{SILENT} grasp")
    return replace(cloud, inactive_points=stack_points(source, columns), inactive_grasp=grasp)


def stack_points(source: Source, columns: Columns) -> npt.NDArray[np.float64]:
    """Stack the columns x, y and z of a cloud file, f64[N, 3]. Raises CloudFileError if one is missing."""
    missing = [axis for axis in "xyz" if axis not in columns]
    if missing:
        source.fail("points", "x, y and z", f"no {missing[0]}", "use a file of points")
    return np.column_stack([columns[axis] for axis in "xyz"])


def _check_row(source: Source, row: str, expected: int, line: str) -> None:
    """Raise CloudFileError unless the row number in a comment of a cloud file is the expected one."""
    if row != str(expected) or expected >= MAX_NAMES:
        source.fail("comment", f"row {expected}, at most {MAX_NAMES}", quote(line), "correct it")


def _printable(name: str) -> str:
    """Convert a name to printable ASCII on one line, of limited length."""
    return "".join(letter if letter.isprintable() and letter.isascii() else "?" for letter in name)[:MAX_NAME_LENGTH]
