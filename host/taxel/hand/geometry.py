"""Where the taxels of a board are, in its bracket's frame.

The bracket frame is the board's own: z points out of the skin, x to the distal end (falling TX number), y to the left
as seen from outside (falling RX number).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

_DEGENERATE = 1e-6


@dataclass(frozen=True, eq=False)
class Surface:
    """Taxel centres on one kind of board.

    Attributes:
        position: f64[count, 3], metres, centre of the electrode, bracket frame.
        normal: f64[count, 3], outward unit normal, bracket frame.
        distal: f64[count, 3], unit vector along the electrode's side that points to the distal end.

    Raises:
        ValueError: shapes do not agree, or a normal has no length.
    """

    position: NDArray[np.float64]
    normal: NDArray[np.float64]
    distal: NDArray[np.float64]

    def __post_init__(self) -> None:
        for name in ("position", "normal", "distal"):
            array = np.array(getattr(self, name), dtype=np.float64)
            if array.ndim != 2 or array.shape[1] != 3 or len(array) != len(self.position):
                raise ValueError(f"{name}: expected [count, 3], found {array.shape}")
            if name != "position":
                array = _unit(array, name)
            array.setflags(write=False)
            object.__setattr__(self, name, array)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Surface):
            return NotImplemented
        names = ("position", "normal", "distal")
        return all(np.array_equal(getattr(self, name), getattr(other, name)) for name in names)

    def __hash__(self) -> int:
        return hash(self.position.tobytes())


def build_surface(rows: NDArray[np.float64], tx: NDArray[np.uint8], rx: NDArray[np.uint8]) -> Surface:
    """The surface of a kind.

    rows: f64[count, 6]: x, y, z, nx, ny, nz. tx, rx: electrode lines of each taxel, u8[count]; a taxel's neighbours on
    a line give the direction of its sides.
    """
    position, normal = rows[:, :3], _unit(rows[:, 3:], "normal")
    return Surface(position, normal, _distal(position, normal, tx.astype(int), rx.astype(int)))


def _distal(
    position: NDArray[np.float64], normal: NDArray[np.float64], tx: NDArray[np.int_], rx: NDArray[np.int_]
) -> NDArray[np.float64]:
    """Direction of falling TX at each taxel, tangential: from its neighbours, else from the frame's x, else its y."""
    place = {crossing: index for index, crossing in enumerate(zip(tx.tolist(), rx.tolist(), strict=True))}
    along = np.zeros_like(position)
    for (row, column), index in place.items():
        ahead, behind = place.get((row - 1, column), index), place.get((row + 1, column), index)
        along[index] = position[ahead] - position[behind]
    along -= normal * np.sum(along * normal, axis=1, keepdims=True)
    for fallback in ([1.0, 0.0, 0.0], [0.0, 1.0, 0.0]):
        lost = np.linalg.norm(along, axis=1) < _DEGENERATE
        projected = fallback - normal * (normal @ np.array(fallback))[:, None]
        along[lost] = projected[lost]
    return _unit(along, "distal")


def _unit(vectors: NDArray[np.float64], name: str) -> NDArray[np.float64]:
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    if not np.all(length > _DEGENERATE):
        raise ValueError(f"{name}: a vector has no length")
    result: NDArray[np.float64] = vectors / length
    return result
