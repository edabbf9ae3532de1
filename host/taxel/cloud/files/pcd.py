"""PCD of the Point Cloud Library, version 0.7: text or binary, not compressed."""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

from taxel.cloud.contact_cloud import ContactCloud
from taxel.cloud.files.extras import cloud_of_columns, comments_of, extra_columns, names_of
from taxel.cloud.files.source import LONGEST_HEADER, Source, natural, shown
from taxel.cloud.files.xyz import lines_of

TYPES: Final = {
    **{("F", size): f"<f{size}" for size in (4, 8)},
    **{("I", size): f"<i{size}" for size in (1, 2, 4, 8)},
    **{("U", size): f"<u{size}" for size in (1, 2, 4, 8)},
}
"""By TYPE and SIZE."""


def read(source: Source) -> ContactCloud:
    """Fields x, y, z, and counts, grasp, taxel where they are there; others are not read."""
    header, comments, start = _header(source)
    fields = header.get("FIELDS", [])
    count = _count(source, header)
    repeats = [natural(word) for word in header.get("COUNT", ["1"] * len(fields))]
    if not fields or len(repeats) != len(fields) or set(repeats) - {1}:
        source.fail("COUNT", "1 for each of the FIELDS", " ".join(header.get("COUNT", ["nothing"])), "rewrite the file")
    kind = " ".join(header.get("DATA", ["nothing"]))
    if kind == "ascii":
        table = source.table(source.data[start:].decode("latin-1"), len(fields), "points")
        columns = dict(zip(fields, table.T, strict=True))
    elif kind == "binary":
        columns = _binary(source, header, fields, count, start)
    else:
        source.fail("DATA", "ascii or binary", shown(kind), "write it without compression")
    if any(len(column) != count for column in columns.values()):
        found = str(len(next(iter(columns.values()))))
        source.fail("points", f"{count}, as POINTS says", found, "use the whole file")
    return cloud_of_columns(source, columns, names_of(source, comments))


def to_bytes(cloud: ContactCloud) -> bytes:
    """As text; x, y, z and counts, grasp, taxel where they are known."""
    names, table = extra_columns(cloud)
    header = [
        "# .PCD v0.7 - Point Cloud Data file format",
        *(f"# {line}" for line in comments_of(cloud)),
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
    return ("\n".join(header) + "\n" + lines_of(table)).encode()


def _header(source: Source) -> tuple[dict[str, list[str]], list[str], int]:
    """Words of each line by the first, the comments, and where the points begin."""
    header: dict[str, list[str]] = {}
    comments = []
    start = 0
    while "DATA" not in header:
        end = source.data.find(b"\n", start, LONGEST_HEADER)
        if end < 0:
            source.fail("header", "lines up to DATA", "none", "use a PCD file")
        line = source.data[start:end].decode("latin-1").strip()
        start = end + 1
        if line.startswith("#"):
            comments.append(line[1:].strip())
        elif line:
            key, *words = line.split()
            header[key] = words
    return header, comments, start


def _count(source: Source, header: dict[str, list[str]]) -> int:
    words = header.get("POINTS") or header.get("WIDTH") or ["nothing"]
    count = natural(words[0])
    if count is None or count > len(source.data):
        source.fail("POINTS", "a number of points that the file can hold", shown(words[0]), "correct it")
    return count


def _binary(
    source: Source, header: dict[str, list[str]], fields: list[str], count: int, start: int
) -> dict[str, npt.NDArray[np.float64]]:
    sizes, kinds = header.get("SIZE", []), header.get("TYPE", [])
    if len(sizes) != len(fields) or len(kinds) != len(fields) or len(set(fields)) != len(fields):
        source.fail("FIELDS", "different names, each with a SIZE and a TYPE", shown(" ".join(fields)), "correct it")
    types = [TYPES.get((kind, natural(size) or 0), "") for kind, size in zip(kinds, sizes, strict=True)]
    if "" in types:
        source.fail("TYPE", "F, I or U of 1 to 8 bytes", shown(" ".join(kinds + sizes)), "correct it")
    record = np.dtype(list(zip(fields, types, strict=True)))
    left = len(source.data) - start
    if count * record.itemsize > left:
        source.fail("points", f"{count * record.itemsize} bytes", str(left), "use the whole file")
    rows = np.frombuffer(source.data, record, count, start)
    with np.errstate(invalid="ignore"):  # a signalling NaN; the cloud refuses it
        return {name: rows[name].astype(np.float64) for name in fields}
