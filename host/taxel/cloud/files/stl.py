"""STL: triangles, as binary or as text. Corners that are equal to the last bit become one vertex."""

import re
from typing import Final

import numpy as np

from taxel.cloud.files.source import Source
from taxel.cloud.mesh import TriangleMesh
from taxel.types import FloatArray, IntArray

HEADER_BYTES: Final = 84
RECORD: Final = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])

VERTEX: Final = re.compile(r"^\s*vertex\s+(\S+\s+\S+\s+\S+)\s*$", re.MULTILINE | re.IGNORECASE)


def read_mesh(source: Source) -> tuple[FloatArray, IntArray]:
    """Read vertices f64[v, 3] and triangles i64[f, 3] of an STL file, text or binary.

    A file is binary if its size agrees with its number of triangles. Raises CloudFileError.
    """
    count = int.from_bytes(source.data[HEADER_BYTES - 4 : HEADER_BYTES], "little")
    if len(source.data) >= HEADER_BYTES and len(source.data) == HEADER_BYTES + count * RECORD.itemsize:
        single = np.frombuffer(source.data, RECORD, count, HEADER_BYTES)["corners"].reshape(-1, 3)
        with np.errstate(invalid="ignore"):  # a signalling NaN: the check of the mesh refuses it
            corners = single.astype(np.float64)
    elif source.data.lstrip()[:5].lower() == b"solid":
        corners = source.parse_table("\n".join(VERTEX.findall(source.decode_text())), 3, "vertex")
    else:
        size = HEADER_BYTES + count * RECORD.itemsize
        expected = f"{size} bytes for {count} triangles, or text that begins with solid"
        source.fail("file", expected, f"{len(source.data)} bytes", "use the whole file")
    if len(corners) % 3 or not len(corners):
        source.fail("vertex", "three for each triangle", str(len(corners)), "correct it")
    vertices, index = np.unique(corners, axis=0, return_inverse=True, equal_nan=False)
    return vertices, index.reshape(-1, 3).astype(np.int64)


def encode_mesh(mesh: TriangleMesh) -> bytes:
    """Encode a mesh as a binary STL file in single precision, the only precision of the format."""
    rows = np.zeros(len(mesh.faces), RECORD)
    rows["normal"], rows["corners"] = mesh.normals, mesh.vertices[mesh.faces]
    header = b"taxel".ljust(HEADER_BYTES - 4, b" ")  # not "solid", with which a text file begins
    return header + len(rows).to_bytes(4, "little") + rows.tobytes()
