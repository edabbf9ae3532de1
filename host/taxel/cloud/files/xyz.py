"""XYZ: a point a line, x y z in metres, and the counts as a fourth number where they are known."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from taxel.cloud.contact_cloud import ContactCloud
from taxel.cloud.files.source import Source, shown

COMMENT = ("#", "//")


def read(source: Source) -> ContactCloud:
    """Columns may be apart by blanks, commas or semicolons; those after the fourth are not read."""
    lines = [line for line in source.text().splitlines() if line.strip() and not line.lstrip().startswith(COMMENT)]
    if not lines:
        source.fail("points", "lines of x y z", "none", "use another file")
    rows = [line.replace(",", " ").replace(";", " ") for line in lines]
    columns = len(rows[0].split())
    if columns < 3:
        source.fail("line 1", "x y z, and counts if known", shown(lines[0]), "correct it")
    for number, row in enumerate(rows, 1):
        if len(row.split()) != columns:
            source.fail(f"line {number}", f"{columns} numbers as in the first", shown(row), "correct it")
    table = source.table("\n".join(rows), columns, "points")
    return ContactCloud.of_points(table[:, :3], table[:, 3] if columns > 3 else None, source.name)


def to_bytes(cloud: ContactCloud) -> bytes:
    """Counts are left out if any is unknown."""
    known = bool(len(cloud)) and not np.isnan(cloud.counts).any()
    table = np.column_stack([cloud.points, cloud.counts]) if known else cloud.points
    return lines_of(table).encode()


def lines_of(table: npt.NDArray[np.float64]) -> str:
    """Rows of numbers as text, each as short as it can be without losing anything."""
    return "".join(" ".join(map(_shortest, row)) + "\n" for row in table.tolist())


def _shortest(value: float) -> str:
    return repr(int(value)) if value == int(value) and abs(value) < 2**53 else repr(value)
