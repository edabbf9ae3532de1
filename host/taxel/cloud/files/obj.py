"""Wavefront OBJ: vertices and faces; everything else, other files above all, is passed over."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from taxel.cloud.files.source import Source, natural, shown
from taxel.cloud.files.xyz import lines_of
from taxel.cloud.mesh import TriangleMesh
from taxel.types import FloatArray, IntArray


def read(source: Source) -> tuple[FloatArray, IntArray]:
    """Vertices f64[v, 3] and triangles i64[f, 3]; a face of more corners becomes a fan about its first."""
    places: list[str] = []
    triangles: list[tuple[int, int, int]] = []
    for number, line in enumerate(source.text().splitlines(), 1):
        key, _, rest = line.strip().partition(" ")
        if key == "v":
            words = rest.split()
            if len(words) < 3:
                source.fail(f"line {number}", "v and three numbers", shown(line), "correct it")
            places.append(" ".join(words[:3]))
        elif key == "f":
            corners = [_corner(source, word, len(places), number) for word in rest.split()]
            if len(corners) < 3:
                source.fail(f"line {number}", "f and three corners or more", shown(line), "correct it")
            triangles += [(corners[0], a, b) for a, b in pairwise(corners[1:])]
    vertices = source.table("\n".join(places), 3, "v")
    return vertices, np.array(triangles, np.int64).reshape(-1, 3)


def to_bytes(mesh: TriangleMesh) -> bytes:
    """As text; vertices count from 1."""
    vertices = "".join(f"v {line}\n" for line in lines_of(mesh.vertices).splitlines())
    faces = "".join(f"f {a} {b} {c}\n" for a, b, c in (mesh.faces + 1).tolist())
    return (vertices + faces).encode()


def _corner(source: Source, word: str, known: int, line: int) -> int:
    """Number of a vertex from 0; in the file from 1, or backwards from the last. Textures and normals follow a /."""
    text = word.partition("/")[0]
    value = natural(text.removeprefix("-"))
    if value is None:
        source.fail(f"line {line}", "numbers of vertices", shown(word), "correct it")
    return known - value if text.startswith("-") else value - 1
