"""Boards that touch an object: which taxels may bear the load, and how separations change when the board moves."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from taxel.grasp.shapes import Shape
from taxel.hand import Hand
from taxel.hand.sheet import Sheet
from taxel.hand.transforms import apply, from_rotation_vector, inverse, rotate
from taxel.sim.separation import DEEPEST_M, layer_thickness
from taxel.types import FloatArray, IndexArray

__all__ = ["TILT_ARM_M", "Touching", "touching_boards"]


REACH_M = 0.010
"""Farthest separation of a taxel that may come to bear: more than any press or tilt closes."""

LEAST_COSINE = 0.25
"""Of the angle between a bearing taxel's normal and the load, and the object's normal; steeper ones bear nothing."""

TILT_ARM_M = 0.010
"""Tilts are counted as the travel of a point so far from the axis, so that all three coordinates are metres."""

MISS_GAP_M = 1.0
"""Separation of a taxel whose normal has left the object: it bears nothing."""


@dataclass(frozen=True, eq=False)
class Touching:
    """G boards in contact, with m taxels that may bear the load.

    frame, board: [G]. force_n: f64[G], net contact force. pose: bracket frames in the object's frame, f64[G, 4, 4].
    centre: centre of pressure, f64[G, 3], and axes: approach and the two tilts' axes in rows, f64[G, 3, 3], both in the
    object's frame. group: [m], rising; taxel: [m]. rows: f64[m, 3], the load's approach and moments (over `TILT_ARM_M`)
    that a newton on the taxel makes.
    """

    frame: IndexArray
    board: IndexArray
    force_n: FloatArray
    pose: FloatArray
    centre: FloatArray
    axes: FloatArray
    group: IndexArray
    taxel: IndexArray
    rows: FloatArray

    def take(self, wanted: npt.NDArray[np.bool_]) -> Touching:
        """Some of the boards, bool[G]."""
        own = wanted[self.group]
        group = (np.cumsum(wanted) - 1)[self.group[own]]
        frame, board, force_n = self.frame[wanted], self.board[wanted], self.force_n[wanted]
        pose, centre, axes = self.pose[wanted], self.centre[wanted], self.axes[wanted]
        return Touching(frame, board, force_n, pose, centre, axes, group, self.taxel[own], self.rows[own])

    def with_all_taxels(self, hand: Hand | Sheet) -> Touching:
        """The same boards with every taxel of theirs; only before they have moved."""
        group, taxel = _all_taxels(hand, self.board)
        back = inverse(self.pose)
        centre, axes = apply(back, self.centre[:, None])[:, 0], rotate(back, self.axes)
        return replace(self, group=group, taxel=taxel, rows=_rows(hand, centre[group], axes[group], taxel))

    def moved(self, x: FloatArray) -> Touching:
        """The boards after a small motion x, f64[G, 3]: the approach and the two tilts, metres."""
        turn = from_rotation_vector(np.einsum("gk,gki->gi", x[:, 1:] / TILT_ARM_M, self.axes[:, 1:]))
        shift = x[:, :1] * self.axes[:, 0]
        # Turned about the centre, then moved: p -> R (p - c) + c + shift.
        turn[:, :3, 3] = self.centre - apply(turn, self.centre[:, None])[:, 0] + shift
        return replace(self, pose=turn @ self.pose, centre=self.centre + shift)

    def cast(self, hand: Hand | Sheet, shape: Shape) -> tuple[FloatArray, FloatArray]:
        """Exact separations f64[m] and their change with a small motion, f64[m, 3]."""
        pose, axes = self.pose[self.group], self.axes[self.group]
        points = apply(pose, hand.position[self.taxel][:, None])[:, 0]
        normals = rotate(pose, hand.normal[self.taxel][:, None])[:, 0]
        entry, surface = shape.ray_entry(points, normals)
        hit = np.isfinite(entry)
        arm = points + np.where(hit, entry, 0.0)[:, None] * normals - self.centre[self.group]
        across = np.cross(arm, surface)  # (axis x arm) . normal = axis . (arm x normal)
        travel = np.einsum("mki,mi->mk", axes[:, 1:], across) / TILT_ARM_M
        travel = np.column_stack([np.sum(axes[:, 0] * surface, axis=1), travel])
        cosine = np.where(hit, np.sum(normals * surface, axis=1), -1.0)
        return np.where(hit, entry - layer_thickness(hand), MISS_GAP_M), -travel / cosine[:, None]


def touching_boards(
    hand: Hand | Sheet, shape: Shape, sensor_poses: FloatArray, object_poses: FloatArray, wrench: FloatArray
) -> Touching:
    """The boards on which a force acts and that have a taxel to bear it.

    sensor_poses: f64[T, s, 4, 4]. object_poses: f64[T, 4, 4]. wrench: f64[T, s, 6], on the board, bracket frame.
    """
    magnitude = np.linalg.norm(wrench[..., :3], axis=-1)
    frame, board = np.nonzero(magnitude > 0)
    force_n, moment = magnitude[frame, board], wrench[frame, board, 3:]
    approach = -wrench[frame, board, :3] / force_n[:, None]
    pose = inverse(object_poses)[frame] @ sensor_poses[frame, board]
    group, taxel = _bearing(hand, shape, pose, board, approach)
    kept = np.bincount(group, minlength=len(frame)) > 0
    group = (np.cumsum(kept) - 1)[group]
    frame, board, force_n = frame[kept], board[kept], force_n[kept]
    moment, approach, pose = moment[kept], approach[kept], pose[kept]
    surface = _surface(hand, taxel)
    # The wrench's axis passes F x M / F^2; on it, the point level with the taxels is the centre of pressure.
    centre = np.cross(-approach, moment) / force_n[:, None]
    sums = np.stack([np.bincount(group, surface[:, i], len(frame)) for i in range(3)], axis=1)
    middle = sums / np.bincount(group, minlength=len(frame))[:, None]
    centre += np.sum((middle - centre) * approach, axis=1, keepdims=True) * approach
    axes = np.stack([approach, *_across(approach)], axis=1)
    rows = _rows(hand, centre[group], axes[group], taxel)
    centre = apply(pose, centre[:, None])[:, 0]
    return Touching(frame, board, force_n, pose, centre, rotate(pose, axes), group, taxel, rows)


def _bearing(
    hand: Hand | Sheet, shape: Shape, pose: FloatArray, board: IndexArray, approach: FloatArray
) -> tuple[IndexArray, IndexArray]:
    """Board and taxel of every taxel that faces the load and the object and is near, [m] each."""
    group, taxel = _all_taxels(hand, board)
    facing = np.sum(hand.normal[taxel] * approach[group], axis=1) >= LEAST_COSINE
    group, taxel = group[facing], taxel[facing]
    points = apply(pose[group], hand.position[taxel][:, None])[:, 0]
    normals = rotate(pose[group], hand.normal[taxel][:, None])[:, 0]
    entry, surface = shape.ray_entry(points, normals)
    separation = entry - layer_thickness(hand)
    bears = (separation >= -DEEPEST_M) & (separation <= REACH_M) & (np.sum(normals * surface, axis=1) <= -LEAST_COSINE)
    return group[bears], taxel[bears]


def _all_taxels(hand: Hand | Sheet, board: IndexArray) -> tuple[IndexArray, IndexArray]:
    """Every taxel of the boards [G], one board after the other: index in [G] and taxel, [m] each."""
    order = np.argsort(hand.board_index, kind="stable")  # a sheet's bare squares come after all taxels
    first = np.searchsorted(hand.board_index[order], np.arange(len(hand.boards) + 1))
    size = np.diff(first)[board]
    group = np.repeat(np.arange(len(board)), size)
    return group, order[np.arange(len(group)) - np.repeat(np.cumsum(size) - size - first[board], size)]


def _rows(hand: Hand | Sheet, centre: FloatArray, axes: FloatArray, taxel: IndexArray) -> FloatArray:
    """`Touching.rows` of taxels [m], from the centre f64[m, 3] and the axes f64[m, 3, 3] in the bracket's frame."""
    normal = hand.normal[taxel]
    moment = np.cross(_surface(hand, taxel) - centre, normal)
    tilts = np.einsum("mki,mi->mk", axes[:, 1:], moment) / TILT_ARM_M
    return np.column_stack([np.sum(axes[:, 0] * normal, axis=1), tilts])


def _surface(hand: Hand | Sheet, taxel: IndexArray) -> FloatArray:
    return hand.position[taxel] + layer_thickness(hand) * hand.normal[taxel]


def _across(directions: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Two unit vectors across each direction f64[G, 3] and each other."""
    least = np.eye(3)[np.argmin(np.abs(directions), axis=1)]
    one = np.cross(directions, least)
    one /= np.linalg.norm(one, axis=1, keepdims=True)
    return one, np.cross(directions, one)
