"""XYZ: one point per line, x y z in metres, with the counts as a fourth number if they are known."""

import numpy as np
import numpy.typing as npt

from taxel.cloud.contact_cloud import ContactCloud
from taxel.cloud.files.source import Source, quote

COMMENT_MARKS = ("#", "//")


def read_cloud(source: Source) -> ContactCloud:
    """Read a contact cloud from an XYZ file: columns x, y, z, and counts if present; further columns are ignored.

    The columns are separated by blanks, commas or semicolons. Raises CloudFileError.
    """
    lines = [
        line
        for line in source.decode_text().splitlines()
        if line.strip() and not line.lstrip().startswith(COMMENT_MARKS)
    ]
    if not lines:
        source.fail("points", "lines of x y z", "no line", "use another file")
    rows = [line.replace(",", " ").replace(";", " ") for line in lines]
    columns = len(rows[0].split())
    if columns < 3:
        source.fail("line 1", "x y z, and counts if known", quote(lines[0]), "correct it")
    for number, row in enumerate(rows, 1):
        if len(row.split()) != columns:
            source.fail(f"line {number}", f"{columns} numbers as in line 1", quote(row), "correct it")
    table = source.parse_table("\n".join(rows), columns, "points")
    return ContactCloud.from_points(table[:, :3], table[:, 3] if columns > 3 else None, source.name)


def encode_cloud(cloud: ContactCloud) -> bytes:
    """Encode a contact cloud as an XYZ text file, without the column of counts if any of them is unknown."""
    is_known = bool(len(cloud)) and not np.isnan(cloud.counts).any()
    table = np.column_stack([cloud.points, cloud.counts]) if is_known else cloud.points
    return format_rows(table).encode()


def format_rows(table: npt.NDArray[np.float64]) -> str:
    """Format rows of numbers as text, each number with the fewest digits that restore its value."""
    return "".join(" ".join(map(_format_number, row)) + "\n" for row in table.tolist())


def _format_number(value: float) -> str:
    """Format a number with the fewest digits that restore its value; integers without a decimal point."""
    return repr(int(value)) if value == int(value) and abs(value) < 2**53 else repr(value)
