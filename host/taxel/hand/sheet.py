"""Dielectric sheet of each board: squares over the taxels and a margin of squares beside them.

The margin transmits contact forces like the other squares, but there is no electrode below it.
"""

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from taxel.hand.boards import Board, BoardKind
from taxel.hand.description import Hand
from taxel.hand.geometry import REFERENCE_AREA_M2, Surface
from taxel.types import FloatArray

_NEIGHBOUR_STEPS = ((-1, 0), (1, 0), (0, -1), (0, 1))
_FLAT_RAD = 1e-9
"""Angle between neighbouring normals, radians, below which the sheet is flat."""


@dataclass(frozen=True, eq=False)
class Sheet:
    """Rectangles of the sheet: first over the taxels in the order of the hand, then the margin.

    Attributes:
        position, normal, distal: f64[n, 3], as in `Hand`.
        size: f64[n, 2], sides along `distal` and across it, metres.
        board_index: index of the board of each square, [n].
        n_taxels: number of squares n; has this name so that functions accept a `Hand` or a `Sheet`.
        name, boards, layer_m: of the hand.
    """

    name: str
    boards: tuple[Board, ...]
    layer_m: float | None
    position: FloatArray
    normal: FloatArray
    distal: FloatArray
    size: FloatArray
    board_index: NDArray[np.intp]

    @property
    def n_taxels(self) -> int:
        """Number of rectangles."""
        return len(self.position)

    @cached_property
    def area_share(self) -> FloatArray:
        """Area of each rectangle divided by the area to which the force laws of the layer refer, f64[n]."""
        return np.asarray(self.size[:, 0] * self.size[:, 1] / REFERENCE_AREA_M2)

    @cached_property
    def half_sides(self) -> FloatArray:
        """Half of each side of each rectangle, along `distal` and across it, f64[n, 2, 3], metres."""
        directions = np.stack([self.distal, np.cross(self.normal, self.distal)], axis=1)
        return np.asarray(0.5 * self.size[:, :, None] * directions)


@lru_cache(maxsize=8)
def build_sheet(hand: Hand, parts: int = 1) -> Sheet:
    """Build the sheet (the dielectric layer over taxels and margin) of all boards, as small rectangles.

    Each square of the sheet is divided into parts x parts consecutive pieces. Pieces over a taxel follow the
    curvature of the sheet; pieces of the margin lie in the plane of their square. Raises HandGeometryError if the
    description contains no positions.
    """
    squares = np.hstack([hand.position, hand.normal, hand.distal, hand.square_size])
    rows, board_indices = [squares], [hand.board_index]
    curvatures = [
        _compute_curvatures(board.kind, board.kind.surface) for board in hand.boards if board.kind.surface is not None
    ]
    for index, board in enumerate(hand.boards):
        if board.kind.surface is not None:
            rows.append(build_margin(board.kind, board.kind.surface, hand.pitch_m))
            board_indices.append(np.full(len(rows[-1]), index))
            curvatures.append(np.zeros((len(rows[-1]), 2)))
    table = _divide_squares(np.vstack(rows), np.vstack(curvatures), parts)
    board_index = np.repeat(np.concatenate(board_indices), parts * parts)
    columns = table[:, :3], table[:, 3:6], table[:, 6:9], table[:, 9:]
    return Sheet(hand.name, hand.boards, hand.layer_m, *columns, board_index)


def _compute_curvatures(kind: BoardKind, surface: Surface) -> FloatArray:
    """Compute the curvature in the distal and the left direction at every taxel, 1/m, f64[count, 2].

    Curvature: change of the normal between the neighbours on both sides, divided by their distance. At an edge the
    taxel itself takes the place of the missing neighbour; the curvature is 0 without neighbours.
    """
    index_of = {place: i for i, place in enumerate(zip(kind.row.tolist(), kind.column.tolist(), strict=True))}
    curvatures = np.zeros((len(surface.position), 2))
    for (row, column), index in index_of.items():
        distal = surface.distal[index]
        for axis, (along, step) in enumerate(((distal, (1, 0)), (np.cross(surface.normal[index], distal), (0, 1)))):
            # Row 0 is distal and column 0 is left, so the neighbour with the smaller index lies ahead on `along`.
            ends = [index_of.get((row + sign * step[0], column + sign * step[1]), index) for sign in (-1, 1)]
            distance = (surface.position[ends[0]] - surface.position[ends[1]]) @ along
            if distance > 0.0:
                curvatures[index, axis] = (surface.normal[ends[0]] - surface.normal[ends[1]]) @ along / distance
    return curvatures


def _divide_squares(table: FloatArray, curvatures: FloatArray, parts: int) -> FloatArray:
    """Divide m rectangles into parts x parts pieces that follow their curvature; return the pieces, f64[m parts^2, 11].

    table: f64[m, 11], centre, normal, distal direction and sides of each rectangle. curvatures: f64[m, 2], 1/m.
    """
    if parts == 1:
        return table
    # Offsets of the centres of the pieces from the centre of their square: in units of its sides, then in metres.
    fractions = (np.arange(parts) + 0.5) / parts - 0.5
    normal, distal = table[:, None, 3:6], table[:, None, 6:9]
    lateral = np.cross(normal, distal)
    along, across = (
        grid.ravel()[None, :, None] * table[:, None, None, 9 + axis]
        for axis, grid in enumerate(np.meshgrid(fractions, fractions, indexing="ij"))
    )
    # Second order: at an offset x the normal tilts by curvature * x, and the sheet lies curvature * x^2 / 2 lower.
    slope_along, slope_across = curvatures[:, :1, None] * along, curvatures[:, 1:, None] * across
    depth = 0.5 * (slope_along * along + slope_across * across)
    pieces = np.repeat(table[:, None], parts * parts, axis=1)
    pieces[..., :3] += along * distal + across * lateral - depth * normal
    pieces[..., 3:6] += slope_along * distal + slope_across * lateral
    pieces[..., 3:6] /= np.linalg.norm(pieces[..., 3:6], axis=2, keepdims=True)
    # The distal direction is made perpendicular to the tilted normal.
    pieces[..., 6:9] -= pieces[..., 3:6] * np.sum(pieces[..., 3:6] * pieces[..., 6:9], axis=2, keepdims=True)
    pieces[..., 6:9] /= np.linalg.norm(pieces[..., 6:9], axis=2, keepdims=True)
    pieces[..., 9:] /= parts
    return np.asarray(pieces.reshape(-1, table.shape[1]))


def build_margin(kind: BoardKind, surface: Surface, pitch_m: float) -> FloatArray:
    """Build the margin of a board: m squares of sheet beside its taxels, f64[m, 11], in the bracket frame.

    Columns: centre (metres), normal, distal direction, two sides (metres). Each place (row, column) that has no taxel
    but is adjacent to a taxel gets a square, also just outside the layout. A square is the mean of the extrapolations
    from its adjacent taxels along the curvature of the sheet. A margin that the hand description contains
    (`Surface.margin`) is returned unchanged.
    """
    if surface.margin is not None:
        return surface.margin
    index_of = {place: i for i, place in enumerate(zip(kind.row.tolist(), kind.column.tolist(), strict=True))}
    extrapolated: dict[tuple[int, int], list[FloatArray]] = {}
    for (row, column), index in index_of.items():
        for step in _NEIGHBOUR_STEPS:
            place = (row + step[0], column + step[1])
            if place not in index_of:
                opposite = index_of.get((row - step[0], column - step[1]))
                extrapolated.setdefault(place, []).append(_extrapolate(surface, index, opposite, step, pitch_m))
    squares = [np.mean(extrapolated[place], axis=0) for place in sorted(extrapolated)]
    if not squares:
        return np.empty((0, 11))
    rows = np.stack(squares)
    rows[:, 3:6] /= np.linalg.norm(rows[:, 3:6], axis=1, keepdims=True)
    rows[:, 6:] -= rows[:, 3:6] * np.sum(rows[:, 3:6] * rows[:, 6:], axis=1, keepdims=True)
    rows[:, 6:] /= np.linalg.norm(rows[:, 6:], axis=1, keepdims=True)
    return np.hstack([rows, np.full((len(rows), 2), pitch_m)])


def _extrapolate(surface: Surface, index: int, opposite: int | None, step: tuple[int, int], pitch: float) -> FloatArray:
    """Compute the square next to taxel `index`, one pitch away on the side given by `step`, as f64[9].

    step: change of (row, column) towards the new square. opposite: index of the neighbour on the other side of the
    taxel, whose normal gives the curvature; None: the sheet continues straight. pitch: side of a square, metres.
    Returns centre, normal and distal direction.
    """
    position, normal, distal = surface.position[index], surface.normal[index], surface.distal[index]
    lateral = np.cross(normal, distal)  # to the left, seen from outside with the distal direction upwards
    along = -step[0] * distal - step[1] * lateral  # row 0 is distal, column 0 is left
    angle = 0.0
    if opposite is not None:  # the opposite normal tilts backwards: -component along the step = sine of the angle
        angle = float(np.arcsin(np.clip(-surface.normal[opposite] @ along, -1.0, 1.0)))
    if abs(angle) < _FLAT_RAD:
        offset = pitch * along
    else:
        radius = pitch / angle
        offset = radius * (np.sin(angle) * along - (1.0 - np.cos(angle)) * normal)
    tangent = np.cos(angle) * along - np.sin(angle) * normal
    direction = -step[0] * tangent if step[0] else distal
    return np.concatenate([position + offset, np.cos(angle) * normal + np.sin(angle) * along, direction])
