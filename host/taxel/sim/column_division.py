"""Division of the squares of columns along the edges of a solid: NumPy reference of `native/division.c`.

Over the square of a column, the depth of each face is a linear function. The least depth over all faces is the
indentation: the square is divided into polygons in which one face is the least deep one.
"""

from typing import NamedTuple

import numpy as np

from taxel.types import FloatArray, IndexArray

_CORNERS = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
"""Corners of a square in half sides from its middle."""
_SQUARE_AREA = 4.0
_MIN_SHARE = 1e-12
"""Smallest share of a part in the area of its square; smaller parts are due to rounding."""


class Parts(NamedTuple):
    """The p parts of squares that are indented by one face each.

    column, face: int[p]. share: f64[p], of the area of the square. centre: f64[p, 2], centroid in half sides. depth,
    deviation: f64[p], mean and standard deviation of the depth, metres.
    """

    column: IndexArray
    face: IndexArray
    share: FloatArray
    centre: FloatArray
    depth: FloatArray
    deviation: FloatArray


def divide_squares(depth: FloatArray, change: FloatArray) -> Parts:
    """Divide squares into the parts that each face indents.

    depth: f64[m, k], metres, of k faces below the middles of m squares. change: f64[m, k, 2], of the depths along each
    half side.
    """
    extent = np.abs(change).sum(axis=2)
    upper = (depth + extent).min(axis=1)
    is_candidate = (depth - extent <= upper[:, None]) & (upper[:, None] > 0.0)
    is_whole = (is_candidate.sum(axis=1) == 1) & ((depth - extent).min(axis=1) >= 0.0)
    whole = np.flatnonzero(is_whole)
    only = is_candidate[whole].argmax(axis=1)
    deviation = np.sqrt((change[whole, only] ** 2).sum(axis=1) / 3.0)
    undivided = Parts(whole, only, np.ones(len(whole)), np.zeros((len(whole), 2)), depth[whole, only], deviation)
    rows: list[tuple[int, int, float, FloatArray, float, float]] = []
    for column in np.flatnonzero((upper > 0.0) & ~is_whole).tolist():
        faces = np.flatnonzero(is_candidate[column])
        rows += [(column, *part) for part in _divide_square(faces, depth[column], change[column])]
    if not rows:
        return undivided
    divided = (np.array(values) for values in zip(*rows, strict=True))
    return Parts(*(np.concatenate(pair) for pair in zip(undivided, divided, strict=True)))


def _divide_square(
    faces: IndexArray, depth: FloatArray, change: FloatArray
) -> list[tuple[int, float, FloatArray, float, float]]:
    """Divide one square: face, share, centre, mean and standard deviation of the depth of each part.

    faces: indices of the faces that may be the least deep one somewhere. depth: f64[k]. change: f64[k, 2].
    """
    parts = []
    for face in faces.tolist():
        polygon = _clip(_CORNERS, depth[face] + _CORNERS @ change[face])
        for other in faces[faces != face].tolist():
            difference = depth[other] - depth[face] + polygon @ (change[other] - change[face])
            if not difference.any() and other < face:  # of two equal faces the first one counts
                polygon = np.empty((0, 2))
            polygon = _clip(polygon, difference[: len(polygon)])
        if len(polygon) > 2:
            share, centre, mean, deviation = _measure(polygon, depth[face], change[face])
            if share >= _MIN_SHARE:
                parts.append((face, share, centre, mean, deviation))
    return parts


def _clip(polygon: FloatArray, value: FloatArray) -> FloatArray:
    """Cut off the part of a convex polygon f64[v, 2] where a linear function with the values f64[v] is negative."""
    points = []
    for i in range(len(polygon)):
        following = (i + 1) % len(polygon)
        if value[i] >= 0.0:
            points.append(polygon[i])
        if (value[i] >= 0.0) != (value[following] >= 0.0):
            fraction = value[i] / (value[i] - value[following])
            points.append(polygon[i] + fraction * (polygon[following] - polygon[i]))
    return np.array(points).reshape(-1, 2)


def _measure(polygon: FloatArray, depth: float, change: FloatArray) -> tuple[float, FloatArray, float, float]:
    """Share, centroid f64[2], and mean and standard deviation of the depth of a polygon f64[v, 2] of a square."""
    corners = np.stack([np.repeat(polygon[:1], len(polygon) - 2, axis=0), polygon[1:-1], polygon[2:]], axis=1)
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    area = 0.5 * (first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0])
    total = float(area.sum())
    share = total / _SQUARE_AREA
    if share < _MIN_SHARE:
        return share, np.zeros(2), 0.0, 0.0
    depths = depth + corners @ change
    mean = float(area @ depths.mean(axis=1)) / total
    square = float(area @ ((depths**2).sum(axis=1) + depths.sum(axis=1) ** 2)) / (12.0 * total)
    return share, area @ corners.mean(axis=1) / total, mean, float(np.sqrt(max(square - mean * mean, 0.0)))
