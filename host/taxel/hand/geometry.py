"""Taxel positions and directions on a board, in its bracket frame.

Bracket frame of a board: z points out of the skin, x to the distal end (decreasing TX number), y to the left seen from
outside (decreasing RX number).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

_DEGENERATE = 1e-6
"""Smallest length of a vector that defines a direction."""


@dataclass(frozen=True, eq=False)
class Surface:
    """Taxel centres and directions of one kind of board.

    Attributes:
        position: f64[count, 3], metres, centre of the electrode, bracket frame.
        normal: f64[count, 3], outward unit normal, bracket frame.
        distal: f64[count, 3], unit vector along the electrode side towards the distal end.

    Raises:
        ValueError: shapes do not agree, or a vector has length 0.
    """

    position: NDArray[np.float64]
    normal: NDArray[np.float64]
    distal: NDArray[np.float64]

    def __post_init__(self) -> None:
        """Check the three arrays [count, 3], normalise `normal` and `distal`, and store read-only copies."""
        for name in ("position", "normal", "distal"):
            array = np.array(getattr(self, name), dtype=np.float64)
            if array.ndim != 2 or array.shape[1] != 3 or len(array) != len(self.position):
                raise ValueError(f"{name}: expected [count, 3], found {array.shape}")
            if name != "position":
                array = _normalise(array, name)
            array.setflags(write=False)
            object.__setattr__(self, name, array)

    def __eq__(self, other: object) -> bool:
        """Whether `other` is a surface with the same taxel positions, normals and distal directions."""
        if not isinstance(other, Surface):
            return NotImplemented
        names = ("position", "normal", "distal")
        return all(np.array_equal(getattr(self, name), getattr(other, name)) for name in names)

    def __hash__(self) -> int:
        return hash(self.position.tobytes())


def build_surface(rows: NDArray[np.float64], tx: NDArray[np.uint8], rx: NDArray[np.uint8]) -> Surface:
    """Build the surface of a kind from its table of taxels.

    rows: f64[count, 6], x, y, z, nx, ny, nz. tx, rx: electrode lines of each taxel, u8[count]; the neighbours of a
    taxel on its RX line determine its distal direction.
    """
    position, normal = rows[:, :3], _normalise(rows[:, 3:], "normal")
    return Surface(position, normal, _compute_distal(position, normal, tx.astype(int), rx.astype(int)))


def _compute_distal(
    position: NDArray[np.float64], normal: NDArray[np.float64], tx: NDArray[np.int_], rx: NDArray[np.int_]
) -> NDArray[np.float64]:
    """Compute the distal direction of each taxel, a tangential unit vector towards smaller TX numbers, f64[count, 3].

    position, normal: f64[count, 3]. tx, rx: electrode lines, int[count]. The direction leads from the neighbour with
    the next larger to the one with the next smaller TX number; without such neighbours an axis (x or y) of the bracket
    frame is projected onto the tangential plane.
    """
    index_of = {crossing: index for index, crossing in enumerate(zip(tx.tolist(), rx.tolist(), strict=True))}
    direction = np.zeros_like(position)
    for (row, column), index in index_of.items():
        next_distal, next_proximal = index_of.get((row - 1, column), index), index_of.get((row + 1, column), index)
        direction[index] = position[next_distal] - position[next_proximal]
    direction -= normal * np.sum(direction * normal, axis=1, keepdims=True)
    for fallback in ([1.0, 0.0, 0.0], [0.0, 1.0, 0.0]):
        is_degenerate = np.linalg.norm(direction, axis=1) < _DEGENERATE
        projected = fallback - normal * (normal @ np.array(fallback))[:, None]
        direction[is_degenerate] = projected[is_degenerate]
    return _normalise(direction, "distal")


def _normalise(vectors: NDArray[np.float64], name: str) -> NDArray[np.float64]:
    """Divide vectors f64[n, 3] by their lengths.

    Raises ValueError for a zero vector; name: the array in the message.
    """
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    if not np.all(length > _DEGENERATE):
        raise ValueError(f"{name}: expected vectors longer than 0, found a zero vector")
    result: NDArray[np.float64] = vectors / length
    return result
