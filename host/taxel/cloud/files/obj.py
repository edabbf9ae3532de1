"""Wavefront OBJ: vertices and faces. All other lines are ignored; no other file is opened."""

from itertools import pairwise

import numpy as np

from taxel.cloud.files.source import Source, parse_natural, quote
from taxel.cloud.files.xyz import format_rows
from taxel.cloud.mesh import TriangleMesh
from taxel.types import FloatArray, IntArray


def read_mesh(source: Source) -> tuple[FloatArray, IntArray]:
    """Read vertices f64[v, 3] and triangles i64[f, 3] of an OBJ file. Raises CloudFileError.

    A face of more than three corners is split into a fan about its first corner.
    """
    vertex_lines: list[str] = []
    triangles: list[tuple[int, int, int]] = []
    for number, line in enumerate(source.decode_text().splitlines(), 1):
        key, _, remainder = line.strip().partition(" ")
        if key == "v":
            words = remainder.split()
            if len(words) < 3:
                source.fail(f"line {number}", "v and three numbers", quote(line), "correct it")
            vertex_lines.append(" ".join(words[:3]))
        elif key == "f":
            corners = [_parse_corner(source, word, len(vertex_lines), number) for word in remainder.split()]
            if len(corners) < 3:
                source.fail(f"line {number}", "f and three corners or more", quote(line), "correct it")
            triangles += [(corners[0], a, b) for a, b in pairwise(corners[1:])]
    vertices = source.parse_table("\n".join(vertex_lines), 3, "v")
    return vertices, np.array(triangles, np.int64).reshape(-1, 3)


def encode_mesh(mesh: TriangleMesh) -> bytes:
    """Encode a mesh as an OBJ text file; OBJ counts vertices from 1."""
    vertices = "".join(f"v {line}\n" for line in format_rows(mesh.vertices).splitlines())
    faces = "".join(f"f {a} {b} {c}\n" for a, b, c in (mesh.faces + 1).tolist())
    return (vertices + faces).encode()


def _parse_corner(source: Source, word: str, vertices: int, line: int) -> int:
    """Parse the corner of a face in an OBJ file; returns the vertex number, counted from 0.

    The file counts from 1, or backwards from the last vertex; texture and normal follow a "/". vertices: number of
    vertices so far. line: number of the line, for the message.
    """
    text = word.partition("/")[0]
    value = parse_natural(text.removeprefix("-"))
    if value is None or (value == 0 and text.startswith("-")):
        source.fail(f"line {line}", "vertex numbers", quote(word), "correct it")
    return vertices - value if text.startswith("-") else value - 1
