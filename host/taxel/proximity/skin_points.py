"""Points of the unloaded skin over the taxels of a board, at which the distance to a target is evaluated."""

from dataclasses import dataclass

import numpy as np

from taxel.hand import Board, Hand
from taxel.hand.sheet import build_sheet
from taxel.types import FloatArray

POINTS_PER_SIDE = 3
"""Number of points per side of a taxel's square. The mean over 3 x 3 points of a response that decays over 2 mm
deviates from the mean over the square by less than 1 % for tilts up to 20 degrees."""

MIN_COSINE = 0.25
"""Cosine between the normals of taxel and target below which the taxel does not face the target (75 degrees)."""

NO_GAP_M = 1.0
"""Gap of a point whose normal misses the target, metres: so large that no target causes a signal there."""


@dataclass(frozen=True, eq=False)
class SkinPoints:
    """Points of the skin of one board in the frame of its bracket, metres.

    position, direction: f64[n, 9, 3], points and their outward unit normals; they follow the curvature of the sheet.
    normal: f64[n, 3], outward unit normal of each taxel.
    """

    position: FloatArray
    direction: FloatArray
    normal: FloatArray

    @property
    def n_taxels(self) -> int:
        """Number of taxels of the board."""
        return len(self.normal)

    @property
    def centre(self) -> FloatArray:
        """Centre of each taxel on the skin, f64[n, 3]."""
        return np.asarray(self.position.mean(axis=1))

    @property
    def mean_normal(self) -> FloatArray:
        """Unit vector along the mean of the normals, f64[3]."""
        mean = self.normal.mean(axis=0)
        return np.asarray(mean / np.linalg.norm(mean))


def compute_skin_points(hand: Hand, board: Board) -> SkinPoints:
    """Compute the skin points of a board.

    The taxels of a hand without described positions lie flat, at the pitch of the hand, in the order of TX and RX
    lines.
    """
    kind = board.kind
    if kind.surface is None:
        return _make_flat_points(hand, board)
    sheet = build_sheet(hand, POINTS_PER_SIDE)
    count = POINTS_PER_SIDE**2
    rows = slice(hand.get_slice(board.address).start * count, hand.get_slice(board.address).stop * count)
    direction = sheet.normal[rows]
    position = sheet.position[rows] + (hand.layer_m or 0.0) * direction
    shape = (kind.taxel_count, count, 3)
    return SkinPoints(position.reshape(shape), direction.reshape(shape), np.array(kind.surface.normal))


def _make_flat_points(hand: Hand, board: Board) -> SkinPoints:
    """Make the skin points of a board without described positions."""
    kind = board.kind
    steps = ((np.arange(POINTS_PER_SIDE) + 0.5) / POINTS_PER_SIDE - 0.5) * hand.pitch_m
    along, across = (axis.ravel() for axis in np.meshgrid(steps, steps, indexing="ij"))
    centre = hand.pitch_m * np.stack([kind.row, kind.column, np.zeros(kind.taxel_count)], axis=1)
    position = centre[:, None] + np.stack([along, across, np.zeros(len(along))], axis=1)
    up = np.array([0.0, 0.0, 1.0])
    return SkinPoints(position, np.broadcast_to(up, position.shape), np.broadcast_to(up, centre.shape))


def compute_plane_gaps(points: SkinPoints, distance_m: float) -> FloatArray:
    """Compute the gaps between the skin points of a board and a plane, f64[n, 9] (n taxels, 9 points), metres.

    The plane is perpendicular to the board's mean normal, `distance_m` away from the nearest skin point. A gap is
    measured along the normal of the skin, along which the field extends; it is `NO_GAP_M` if the normal misses the
    plane.
    """
    height = points.position @ points.mean_normal
    cosine = points.direction @ points.mean_normal
    gap = (height.max() - height + distance_m) / np.maximum(cosine, MIN_COSINE)
    return np.asarray(np.where(cosine > MIN_COSINE, gap, NO_GAP_M))
