"""Taxel positions and directions on a board, in its bracket frame.

Each taxel measures a square of the sheet, with one side along `distal` (to the fingertip) and the other along
normal x distal (to the left seen from outside).
"""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

SQUARE_NUMBERS = 11
"""Numbers of a row that describes a square: centre, normal, distal direction, two sides."""

REFERENCE_AREA_M2 = 0.005**2
"""Area to which the force laws of the layer refer, square metres: one taxel at a pitch of 5 mm."""

_DEGENERATE = 1e-6
"""Smallest length of a vector that defines a direction."""


@dataclass(frozen=True, eq=False)
class Surface:
    """Taxel centres and directions of one kind of board.

    Attributes:
        position: f64[count, 3], metres, centre of the electrode, bracket frame.
        normal: f64[count, 3], outward unit normal, bracket frame.
        distal: f64[count, 3], unit vector along the electrode side towards the distal end.
        size: f64[count, 2], sides of the square that a taxel measures, along `distal` and across it, metres;
            without rows: squares of the area to which the force laws of the layer refer.
        margin: f64[m, 11], rectangles of bare sheet between and beside the taxels: centre, normal, distal direction and
            sides; None: one pitch around the board, extrapolated from the taxels.

    Raises:
        ValueError: shapes do not agree, or a vector has length 0.
    """

    position: NDArray[np.float64]
    normal: NDArray[np.float64]
    distal: NDArray[np.float64]
    size: NDArray[np.float64] = field(default_factory=lambda: np.empty((0, 2)))
    margin: NDArray[np.float64] | None = None

    def __post_init__(self) -> None:
        """Check the shapes of the arrays, normalise `normal` and `distal`, and store read-only copies.

        Raises ValueError for shapes that do not agree, and for a normal or distal vector of length 0.
        """
        if not len(self.size):
            side = np.sqrt(REFERENCE_AREA_M2)
            object.__setattr__(self, "size", np.full((len(self.position), 2), side))
        for name, width in (("position", 3), ("normal", 3), ("distal", 3), ("size", 2)):
            array = np.array(getattr(self, name), dtype=np.float64)
            if array.ndim != 2 or array.shape[1] != width or len(array) != len(self.position):
                raise ValueError(f"{name}: expected [count, {width}], found {array.shape}")
            if width == 3 and name != "position":
                array = _normalise(array, name)
            array.setflags(write=False)
            object.__setattr__(self, name, array)

    def __eq__(self, other: object) -> bool:
        """Return whether `other` is a surface with the same positions, normals, distal directions, sizes and margin."""
        if not isinstance(other, Surface):
            return NotImplemented
        names = ("position", "normal", "distal", "size")
        is_equal = all(np.array_equal(getattr(self, name), getattr(other, name)) for name in names)
        return is_equal and np.array_equal(_get_rows(self.margin), _get_rows(other.margin))

    def __hash__(self) -> int:
        return hash(self.position.tobytes())


def build_surface(
    rows: NDArray[np.float64],
    row: NDArray[np.int16],
    column: NDArray[np.int16],
    pitch_m: float,
    margin: NDArray[np.float64] | None = None,
) -> Surface:
    """Build the surface of a board kind (position, normal, distal direction and size of each taxel) from its table.

    rows: f64[count, 6], position x, y, z and normal nx, ny, nz of each taxel, or f64[count, 11], in addition the distal
    direction (towards the fingertip) and the two sides of the taxel's square. row, column: position of each taxel on
    the unrolled sheet, [count]. If `rows` has 6 columns, the neighbours of a taxel in its column of the sheet determine
    the distal direction, and each square has the side `pitch_m`. margin: rectangles of sheet beside the taxels, as in
    `Surface`.
    """
    position, normal = rows[:, :3], _normalise(rows[:, 3:6], "normal")
    if rows.shape[1] == SQUARE_NUMBERS:
        return Surface(position, normal, rows[:, 6:9], rows[:, 9:], margin)
    distal = _compute_distal(position, normal, row.astype(int), column.astype(int))
    return Surface(position, normal, distal, np.full((len(rows), 2), pitch_m), margin)


def _compute_distal(
    position: NDArray[np.float64], normal: NDArray[np.float64], row: NDArray[np.int_], column: NDArray[np.int_]
) -> NDArray[np.float64]:
    """Compute the distal direction of each taxel: the tangent along which the row number decreases, f64[count, 3].

    The direction follows from the neighbours of a taxel in its column. A taxel without neighbours gets the projection
    of the x axis, or of the y axis if the normal is along x.
    """
    index_of = {place: index for index, place in enumerate(zip(row.tolist(), column.tolist(), strict=True))}
    direction = np.zeros_like(position)
    for (r, c), index in index_of.items():
        next_distal, next_proximal = index_of.get((r - 1, c), index), index_of.get((r + 1, c), index)
        direction[index] = position[next_distal] - position[next_proximal]
    direction -= normal * np.sum(direction * normal, axis=1, keepdims=True)
    for fallback in ([1.0, 0.0, 0.0], [0.0, 1.0, 0.0]):
        is_degenerate = np.linalg.norm(direction, axis=1) < _DEGENERATE
        projected = fallback - normal * (normal @ np.array(fallback))[:, None]
        direction[is_degenerate] = projected[is_degenerate]
    return _normalise(direction, "distal")


def _get_rows(margin: NDArray[np.float64] | None) -> NDArray[np.float64]:
    """Return the margin, or an empty array for None, so that two optional margins can be compared."""
    return np.empty(0) if margin is None else margin


def _normalise(vectors: NDArray[np.float64], name: str) -> NDArray[np.float64]:
    """Divide vectors f64[n, 3] by their lengths.

    Raises ValueError for a zero vector; name: name of the array in the message.
    """
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    if not np.all(length > _DEGENERATE):
        raise ValueError(f"{name}: expected vectors longer than 0, found a zero vector")
    result: NDArray[np.float64] = vectors / length
    return result
