"""Division of the layer's square columns along the edges of a solid: NumPy reference of `native/division.c`.

The soft layer consists of columns with a square cross-section (`taxel.sim.soft_contact`). Over this square, the depth
of a point below the plane of each face of the solid is a linear function. The smallest depth over all faces is the
indentation: the square is divided into polygons, in each of which one face has the smallest depth.
"""

from typing import NamedTuple

import numpy as np

from taxel.types import FloatArray, IndexArray

_CORNERS = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
"""Corners of a square, in half sides from its middle."""
_SQUARE_AREA = 4.0  # in squared half sides
_MIN_SHARE = 1e-12
"""Smallest part as a share of the area of its square; smaller parts are due to rounding."""


class Parts(NamedTuple):
    """The p parts of squares that are indented by one face each.

    column, face: int[p], indices of the column and of the face. share: f64[p], area as a share of the square's area.
    centre: f64[p, 2], centroid, in half sides from the middle of the square. depth, deviation: f64[p], mean and
    standard deviation of the depth over the part, metres.
    """

    column: IndexArray
    face: IndexArray
    share: FloatArray
    centre: FloatArray
    depth: FloatArray
    deviation: FloatArray


def divide_squares(depth: FloatArray, depth_change: FloatArray) -> Parts:
    """Divide m squares into the parts that each of k faces indents; squares outside the solid have no parts.

    depth: f64[m, k], depths of the middles of the squares below the planes of the faces, metres. depth_change:
    f64[m, k, 2], change of these depths from the middle of a square along each of its two half sides, metres.
    """
    # A face is a candidate if it may have the smallest depth (that of the solid) somewhere in the square.
    extent = np.abs(depth_change).sum(axis=2)
    upper = (depth + extent).min(axis=1)
    is_candidate = (depth - extent <= upper[:, None]) & (upper[:, None] > 0.0)
    is_whole = (is_candidate.sum(axis=1) == 1) & ((depth - extent).min(axis=1) >= 0.0)
    whole = np.flatnonzero(is_whole)
    only = is_candidate[whole].argmax(axis=1)
    # Standard deviation of a linear function over a square: each coordinate in half sides has the variance 1 / 3.
    deviation = np.sqrt((depth_change[whole, only] ** 2).sum(axis=1) / 3.0)
    undivided = Parts(whole, only, np.ones(len(whole)), np.zeros((len(whole), 2)), depth[whole, only], deviation)
    rows: list[tuple[int, int, float, FloatArray, float, float]] = []
    for column in np.flatnonzero((upper > 0.0) & ~is_whole).tolist():
        faces = np.flatnonzero(is_candidate[column])
        rows += [(column, *part) for part in _divide_square(faces, depth[column], depth_change[column])]
    if not rows:
        return undivided
    divided = (np.array(values) for values in zip(*rows, strict=True))
    return Parts(*(np.concatenate(pair) for pair in zip(undivided, divided, strict=True)))


def _divide_square(
    faces: IndexArray, depth: FloatArray, depth_change: FloatArray
) -> list[tuple[int, float, FloatArray, float, float]]:
    """Divide one square: (face, share, centre, mean and standard deviation of the depth) of each part, as in `Parts`.

    faces: indices of the faces that may have the smallest depth somewhere. depth: f64[k] and depth_change: f64[k, 2] of
    the square, as in `divide_squares`.
    """
    parts = []
    for face in faces.tolist():
        polygon = _clip_polygon(_CORNERS, depth[face] + _CORNERS @ depth_change[face])
        for other in faces[faces != face].tolist():
            difference = depth[other] - depth[face] + polygon @ (depth_change[other] - depth_change[face])
            if not difference.any() and other < face:  # of two equal faces, the first one receives the part
                polygon = np.empty((0, 2))
            polygon = _clip_polygon(polygon, difference[: len(polygon)])
        if len(polygon) > 2:
            share, centre, mean, deviation = _measure_polygon(polygon, depth[face], depth_change[face])
            if share >= _MIN_SHARE:
                parts.append((face, share, centre, mean, deviation))
    return parts


def _clip_polygon(polygon: FloatArray, value: FloatArray) -> FloatArray:
    """Cut off the part of a convex polygon in which a linear function is negative; return the remaining polygon.

    polygon: f64[v, 2], vertices. value: f64[v], values of the function at the vertices.
    """
    points = []
    for i in range(len(polygon)):
        following = (i + 1) % len(polygon)
        if value[i] >= 0.0:
            points.append(polygon[i])
        if (value[i] >= 0.0) != (value[following] >= 0.0):
            fraction = value[i] / (value[i] - value[following])
            points.append(polygon[i] + fraction * (polygon[following] - polygon[i]))
    return np.array(points).reshape(-1, 2)


def _measure_polygon(
    polygon: FloatArray, depth: float, depth_change: FloatArray
) -> tuple[float, FloatArray, float, float]:
    """Compute area share, centroid f64[2], and mean and standard deviation of the depth of a part of a square.

    polygon: f64[v, 2], vertices of the part in half sides. depth: at the middle of the square, metres. depth_change:
    f64[2], along its half sides. For a share below `_MIN_SHARE` the other results are 0.
    """
    corners = np.stack([np.repeat(polygon[:1], len(polygon) - 2, axis=0), polygon[1:-1], polygon[2:]], axis=1)
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    area = 0.5 * (first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0])
    total = float(area.sum())
    share = total / _SQUARE_AREA
    if share < _MIN_SHARE:
        return share, np.zeros(2), 0.0, 0.0
    depths = depth + corners @ depth_change
    # Integrals over the triangles of a fan: of a linear function with the corner values d, area * sum(d) / 3; of its
    # square, area * (sum(d^2) + sum(d)^2) / 12.
    mean = float(area @ depths.mean(axis=1)) / total
    square = float(area @ ((depths**2).sum(axis=1) + depths.sum(axis=1) ** 2)) / (12.0 * total)
    return share, area @ corners.mean(axis=1) / total, mean, float(np.sqrt(max(square - mean * mean, 0.0)))
