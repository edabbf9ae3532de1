"""PCD of the Point Cloud Library, version 0.7, as text or as uncompressed binary."""

from typing import Final

import numpy as np
import numpy.typing as npt

from taxel.cloud.contact_cloud import ContactCloud
from taxel.cloud.files.cloud_metadata import build_cloud, build_columns, format_comments, parse_comments
from taxel.cloud.files.source import MAX_HEADER_BYTES, Source, parse_natural, quote
from taxel.cloud.files.xyz import format_rows

TYPES: Final = {
    **{("F", size): f"<f{size}" for size in (4, 8)},
    **{("I", size): f"<i{size}" for size in (1, 2, 4, 8)},
    **{("U", size): f"<u{size}" for size in (1, 2, 4, 8)},
}
"""NumPy types by the words TYPE and SIZE of a PCD header."""


def read_cloud(source: Source) -> ContactCloud:
    """Read a contact cloud from a PCD file: the fields x, y, z, and counts, grasp, taxel if present.

    Other fields are ignored. Raises CloudFileError.
    """
    header, comments, start = _read_header(source)
    fields = header.get("FIELDS", [])
    count = _read_point_count(source, header)
    repeats = [parse_natural(word) for word in header.get("COUNT", ["1"] * len(fields))]
    if not fields or len(repeats) != len(fields) or set(repeats) - {1}:
        source.fail("COUNT", "1 for each of the FIELDS", " ".join(header.get("COUNT", ["nothing"])), "rewrite the file")
    encoding = " ".join(header.get("DATA", ["nothing"]))
    if encoding == "ascii":
        table = source.parse_table(source.data[start:].decode("latin-1"), len(fields), "points")
        columns = dict(zip(fields, table.T, strict=True))
    elif encoding == "binary":
        columns = _read_binary(source, header, fields, count, start)
    else:
        source.fail("DATA", "ascii or binary", quote(encoding), "write it without compression")
    if any(len(column) != count for column in columns.values()):
        found = str(len(next(iter(columns.values()))))
        source.fail("points", f"{count}, the value of POINTS", found, "use the whole file")
    return build_cloud(source, columns, parse_comments(source, comments))


def encode_cloud(cloud: ContactCloud) -> bytes:
    """Encode a contact cloud as a PCD text file with x, y, z, and counts, grasp, taxel if they are known."""
    names, table = build_columns(cloud)
    header = [
        "# .PCD v0.7 - Point Cloud Data file format",
        *(f"# {line}" for line in format_comments(cloud)),
        "VERSION 0.7",
        f"FIELDS {' '.join(names)}",
        f"SIZE {' '.join(['8'] * 3 + ['4'] * (len(names) - 3))}",
        f"TYPE {' '.join('I' if name in ('grasp', 'taxel') else 'F' for name in names)}",
        f"COUNT {' '.join(['1'] * len(names))}",
        f"WIDTH {len(cloud)}",
        "HEIGHT 1",
        "VIEWPOINT 0 0 0 1 0 0 0",
        f"POINTS {len(cloud)}",
        "DATA ascii",
    ]
    return ("\n".join(header) + "\n" + format_rows(table)).encode()


def _read_header(source: Source) -> tuple[dict[str, list[str]], list[str], int]:
    """Read the header of a PCD file.

    Returns the words of each line by the first word of the line, the comments, and the byte offset of the points.
    Raises CloudFileError for a file without the line DATA.
    """
    header: dict[str, list[str]] = {}
    comments = []
    start = 0
    while "DATA" not in header:
        end = source.data.find(b"\n", start, MAX_HEADER_BYTES)
        if end < 0:
            source.fail("header", "lines up to DATA", "no line DATA", "use a PCD file")
        line = source.data[start:end].decode("latin-1").strip()
        start = end + 1
        if line.startswith("#"):
            comments.append(line[1:].strip())
        elif line:
            key, *words = line.split()
            header[key] = words
    return header, comments, start


def _read_point_count(source: Source, header: dict[str, list[str]]) -> int:
    """Return the number of points that a PCD header states. Raises CloudFileError for more points than bytes in the
    file.
    """
    words = header.get("POINTS") or header.get("WIDTH") or ["nothing"]
    count = parse_natural(words[0])
    if count is None or count > len(source.data):
        source.fail("POINTS", "a number of points that the file can hold", quote(words[0]), "correct it")
    return count


def _read_binary(
    source: Source, header: dict[str, list[str]], fields: list[str], count: int, start: int
) -> dict[str, npt.NDArray[np.float64]]:
    """Read the fields of binary points of a PCD file by name, f64[count] each. Raises CloudFileError.

    start: first byte of the points.
    """
    sizes, kinds = header.get("SIZE", []), header.get("TYPE", [])
    if len(sizes) != len(fields) or len(kinds) != len(fields) or len(set(fields)) != len(fields):
        source.fail("FIELDS", "different names, each with a SIZE and a TYPE", quote(" ".join(fields)), "correct it")
    types = [TYPES.get((kind, parse_natural(size) or 0), "") for kind, size in zip(kinds, sizes, strict=True)]
    if "" in types:
        source.fail("TYPE", "F, I or U of 1 to 8 bytes", quote(" ".join(kinds + sizes)), "correct it")
    record = np.dtype(list(zip(fields, types, strict=True)))
    available = len(source.data) - start
    if count * record.itemsize > available:
        source.fail("points", f"{count * record.itemsize} bytes", str(available), "use the whole file")
    rows = np.frombuffer(source.data, record, count, start)
    with np.errstate(invalid="ignore"):  # a signalling NaN: the check of the cloud refuses it
        return {name: rows[name].astype(np.float64) for name in fields}
