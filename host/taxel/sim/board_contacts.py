"""Boards in contact with an object: the taxels that can bear the load, and the change of separations with motion."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from taxel.grasp.shapes import Shape
from taxel.hand import Hand
from taxel.hand.sheet import Sheet
from taxel.hand.transforms import apply, from_rotation_vector, inverse, rotate
from taxel.sim.separation import MAX_INDENTATION_M, get_layer_thickness
from taxel.types import BoolArray, FloatArray, IndexArray

__all__ = ["TILT_ARM_M", "BoardContacts", "find_board_contacts"]


MAX_SEPARATION_M = 0.010
"""Largest separation of a taxel that can come to bear load, metres; no indentation or tilt closes a wider gap. A larger
value costs time and does not change the result.
"""

MIN_FACING_COSINE = 0.25
"""Smallest cosine between the normal of a bearing taxel and the direction of the load, and between that normal and the
reversed normal of the object (chosen). Steeper taxels bear no load.
"""

TILT_ARM_M = 0.010
"""A tilt is expressed as the travel of a point at this distance from the axis, metres, so that all three coordinates of
a motion have one unit.
"""

MISS_GAP_M = 1.0
"""Gap of a taxel whose normal misses the object, metres: larger than any motion, so that the taxel bears no load."""


@dataclass(frozen=True, eq=False)
class BoardContacts:
    """G loaded boards, one for each pair of time frame and board with a force, and the m taxels that can bear the load.

    frame, board: int[G], indices of time frame and board. force_n: f64[G], magnitude of the contact force. pose:
    f64[G, 4, 4], bracket in the object's frame. centre: f64[G, 3], centre of pressure, and axes: f64[G, 3, 3], approach
    direction and the two tilt axes in rows, both in the object's frame. group: int[m], ascending, index of each taxel's
    loaded board (0 to G - 1). taxel: int[m], taxel number. rows: f64[m, 3], effect of one newton on the taxel: force
    along the approach, and moments about the tilt axes divided by `TILT_ARM_M`.
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

    def select(self, selection: BoolArray) -> BoardContacts:
        """Return the loaded boards for which `selection` bool[G] is true, with their taxels."""
        in_selection = selection[self.group]
        group = (np.cumsum(selection) - 1)[self.group[in_selection]]
        frame, board, force_n = self.frame[selection], self.board[selection], self.force_n[selection]
        pose, centre, axes = self.pose[selection], self.centre[selection], self.axes[selection]
        taxel, rows = self.taxel[in_selection], self.rows[in_selection]
        return BoardContacts(frame, board, force_n, pose, centre, axes, group, taxel, rows)

    def with_all_taxels(self, hand: Hand | Sheet) -> BoardContacts:
        """Return the same loaded boards with all their taxels instead of only those that can bear load.

        Call it before `move`, which does not rotate `axes` with the boards.
        """
        group, taxel = _list_taxels(hand, self.board)
        to_bracket = inverse(self.pose)
        centre, axes = apply(to_bracket, self.centre[:, None])[:, 0], rotate(to_bracket, self.axes)
        return replace(self, group=group, taxel=taxel, rows=_compute_rows(hand, centre[group], axes[group], taxel))

    def move(self, x: FloatArray) -> BoardContacts:
        """Return the boards after a small rigid motion x, f64[G, 3]: travel along the approach and two tilts, metres.

        A tilt in metres is the travel of a point at the distance `TILT_ARM_M` from the tilt axis.
        """
        motion = from_rotation_vector(np.einsum("gk,gki->gi", x[:, 1:] / TILT_ARM_M, self.axes[:, 1:]))
        shift = x[:, :1] * self.axes[:, 0]
        # Rotation about the centre of pressure c, then translation: p -> R (p - c) + c + shift.
        motion[:, :3, 3] = self.centre - apply(motion, self.centre[:, None])[:, 0] + shift
        return replace(self, pose=motion @ self.pose, centre=self.centre + shift)

    def cast_rays(self, hand: Hand | Sheet, shape: Shape) -> tuple[FloatArray, FloatArray]:
        """Compute exact separations between taxels and object, f64[m], metres, and their derivatives, f64[m, 3].

        The derivatives refer to the motion x of the boards (see `move`). The separation is measured along the normal of
        the taxel from the surface of the layer; `MISS_GAP_M` where this ray misses the object.
        """
        pose, axes = self.pose[self.group], self.axes[self.group]
        points = apply(pose, hand.position[self.taxel][:, None])[:, 0]
        normals = rotate(pose, hand.normal[self.taxel][:, None])[:, 0]
        entry, surface_normal = shape.ray_entry(points, normals)
        hit = np.isfinite(entry)
        arm = points + np.where(hit, entry, 0.0)[:, None] * normals - self.centre[self.group]
        # (axis x arm) . normal = axis . (arm x normal)
        tilt_travel = np.einsum("mki,mi->mk", axes[:, 1:], np.cross(arm, surface_normal)) / TILT_ARM_M
        travel = np.column_stack([np.sum(axes[:, 0] * surface_normal, axis=1), tilt_travel])
        cosine = np.where(hit, np.sum(normals * surface_normal, axis=1), -1.0)
        return np.where(hit, entry - get_layer_thickness(hand), MISS_GAP_M), -travel / cosine[:, None]


def find_board_contacts(
    hand: Hand | Sheet, shape: Shape, sensor_poses: FloatArray, object_poses: FloatArray, wrench: FloatArray
) -> BoardContacts:
    """Find the boards with a contact force and at least one taxel that can bear the force, in all T frames.

    sensor_poses: f64[T, s, 4, 4], brackets in the world. object_poses: f64[T, 4, 4]. wrench: f64[T, s, 6], force (N)
    and moment (Nm) on each board, bracket frame.
    """
    magnitude = np.linalg.norm(wrench[..., :3], axis=-1)
    frame, board = np.nonzero(magnitude > 0)
    force_n, moment = magnitude[frame, board], wrench[frame, board, 3:]
    approach = -wrench[frame, board, :3] / force_n[:, None]
    pose = inverse(object_poses)[frame] @ sensor_poses[frame, board]
    group, taxel = _find_load_bearing_taxels(hand, shape, pose, board, approach)
    has_taxels = np.bincount(group, minlength=len(frame)) > 0
    group = (np.cumsum(has_taxels) - 1)[group]  # boards without such taxels are removed, the others renumbered
    frame, board, force_n = frame[has_taxels], board[has_taxels], force_n[has_taxels]
    moment, approach, pose = moment[has_taxels], approach[has_taxels], pose[has_taxels]
    surface = _compute_surface_points(hand, taxel)
    # The axis of the wrench passes through F x M / F^2. The centre of pressure is its point level with the taxels.
    centre = np.cross(-approach, moment) / force_n[:, None]
    sums = np.stack([np.bincount(group, surface[:, i], len(frame)) for i in range(3)], axis=1)
    mean_surface = sums / np.bincount(group, minlength=len(frame))[:, None]
    centre += np.sum((mean_surface - centre) * approach, axis=1, keepdims=True) * approach
    axes = np.stack([approach, *_make_tilt_axes(approach)], axis=1)
    rows = _compute_rows(hand, centre[group], axes[group], taxel)
    centre = apply(pose, centre[:, None])[:, 0]
    return BoardContacts(frame, board, force_n, pose, centre, rotate(pose, axes), group, taxel, rows)


def _find_load_bearing_taxels(
    hand: Hand | Sheet, shape: Shape, pose: FloatArray, board: IndexArray, approach: FloatArray
) -> tuple[IndexArray, IndexArray]:
    """Find the m taxels that can bear the load of their board: index of the board in [G], and taxel number, i64[m].

    pose: f64[G, 4, 4] of the G boards `board` [G] in the object's frame. approach: f64[G, 3], unit vector opposite to
    the contact force, bracket frame. Each of the m taxels is near the object; its normal is within the angle of
    `MIN_FACING_COSINE` of the approach direction and of the reversed normal of the object.
    """
    group, taxel = _list_taxels(hand, board)
    facing = np.sum(hand.normal[taxel] * approach[group], axis=1) >= MIN_FACING_COSINE
    group, taxel = group[facing], taxel[facing]
    points = apply(pose[group], hand.position[taxel][:, None])[:, 0]
    normals = rotate(pose[group], hand.normal[taxel][:, None])[:, 0]
    entry, surface_normal = shape.ray_entry(points, normals)
    separation = entry - get_layer_thickness(hand)
    is_near = (separation >= -MAX_INDENTATION_M) & (separation <= MAX_SEPARATION_M)
    bears = is_near & (np.sum(normals * surface_normal, axis=1) <= -MIN_FACING_COSINE)
    return group[bears], taxel[bears]


def _list_taxels(hand: Hand | Sheet, board: IndexArray) -> tuple[IndexArray, IndexArray]:
    """List all m taxels of the boards `board` [G]: index of the board in [G], ascending, and taxel number, int[m]."""
    order = np.argsort(hand.board_index, kind="stable")  # a sheet numbers squares without an electrode after all taxels
    first = np.searchsorted(hand.board_index[order], np.arange(len(hand.boards) + 1))
    size = np.diff(first)[board]
    group = np.repeat(np.arange(len(board)), size)
    # Position in `order`: first taxel of the board, plus rank of the taxel among those of the same entry of `board`.
    return group, order[np.arange(len(group)) - np.repeat(np.cumsum(size) - size - first[board], size)]


def _compute_rows(hand: Hand | Sheet, centre: FloatArray, axes: FloatArray, taxel: IndexArray) -> FloatArray:
    """Compute the effect of one newton on each taxel `taxel` [m]: force along the approach and two moments, f64[m, 3].

    The moments are about the tilt axes through the centre of pressure, divided by `TILT_ARM_M`. centre: f64[m, 3],
    centre of pressure, and axes: f64[m, 3, 3], approach and tilt axes in rows, both in the bracket's frame.
    """
    normal = hand.normal[taxel]
    moment = np.cross(_compute_surface_points(hand, taxel) - centre, normal)
    tilts = np.einsum("mki,mi->mk", axes[:, 1:], moment) / TILT_ARM_M
    return np.column_stack([np.sum(axes[:, 0] * normal, axis=1), tilts])


def _compute_surface_points(hand: Hand | Sheet, taxel: IndexArray) -> FloatArray:
    """Compute the points of the soft layer's surface above the electrode centres, f64[m, 3], bracket frame, metres."""
    return hand.position[taxel] + get_layer_thickness(hand) * hand.normal[taxel]


def _make_tilt_axes(directions: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return for each of G directions f64[G, 3] two unit vectors, perpendicular to the direction and to each other."""
    most_perpendicular = np.eye(3)[np.argmin(np.abs(directions), axis=1)]
    first = np.cross(directions, most_perpendicular)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    return first, np.cross(directions, first)
