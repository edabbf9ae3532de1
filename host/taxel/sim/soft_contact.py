"""The elastic layer as contact during the simulation: columns of the sheet load the bodies while MuJoCo moves them.

Every square of the dielectric sheet is divided into pieces. Each piece is a column, which the object indents along its
axis and shears. Without friction the force on a column has the direction of the object's normal; its part along the
axis follows from the force law of the layer. The surface of the layer sticks to the object until the force of the shear
reaches the friction coefficient times the normal force (Coulomb), and slides beyond.

This NumPy implementation is the reference of the tests; grasps use the C implementation (`taxel.sim.native_contact`).
"""

from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np

from taxel.grasp.objects import SKIN_FRICTION
from taxel.grasp.shapes import Shape
from taxel.hand import Hand
from taxel.hand.sheet import Sheet, build_sheet
from taxel.hand.transforms import cross, inverse
from taxel.types import FloatArray, IndexArray

SPRINGS_PER_SIDE = 3
"""Columns along each side of a taxel (chosen): an edge that passes between the centres of two taxels loads both. More
columns cost time in proportion to their number squared.
"""

NEAR_M = 0.003
"""Search distance, metres: pieces farther from the object are ignored until a board has moved by this distance relative
to the object. The value changes the computing time, not the result.
"""

MAX_DEPTH_M = 0.004
"""Largest indentation, metres, for which the search considers all faces of an object (chosen)."""

MIN_SLOPE = 0.5
"""Smallest cosine between the axis of a column and the object's normal for which the column is compressed in full
(chosen: surfaces tilted by up to 60 degrees). A column that the object enters from the side is loaded gradually: the
depth counts as at most the distance to the side divided by this number.
"""


@dataclass(frozen=True)
class LayerFriction:
    """Friction between the layer's surface and an object.

    coefficient: friction coefficient; 0: no friction. stiffness_n_per_m:
    shear stiffness of 25 mm2 of the layer, G A / t with G = 23 kPa, a third of the data sheet's modulus of Ecoflex
    00-30, and a thickness t of 1 mm.
    """

    coefficient: float = SKIN_FRICTION
    stiffness_n_per_m: float = 575.0


@dataclass(frozen=True)
class LayerLaw:
    """Force law of the layer on 25 mm2, the area of one taxel at a pitch of 5 mm: F(d) = stiffness_n_per_m d exp(d /
    stiffening_m + (d / closing_m)^4).

    d is the compression in metres. The function is an empirical fit to indentations of the emulated skin; source of the
    parameters: tools/sim/fit_stiffness.py. Beyond `straight_m`, which no taxel reaches in a grasp, the force continues
    along the tangent, so that a finger that meets an edge sideways receives no impulse.
    """

    stiffness_n_per_m: float = 604.0
    stiffening_m: float = 0.579e-3
    closing_m: float = 1.46e-3
    straight_m: float = 1.5e-3

    def compute_force(self, depth_m: FloatArray) -> FloatArray:
        """Compute the force on a taxel, newtons, f64[...], for compressions of the layer f64[...] of at least 0 metres.

        Beyond the compression `straight_m` the force increases linearly.
        """
        curved = np.minimum(depth_m, self.straight_m)
        force = self.stiffness_n_per_m * curved * self._compute_growth(curved)
        return np.asarray(force + (depth_m - curved) * self.compute_stiffness(curved))

    def compute_stiffness(self, depth_m: FloatArray) -> FloatArray:
        """Compute the derivative of a taxel's force with respect to the compression of the layer, N/m, f64[...]."""
        curved = np.minimum(depth_m, self.straight_m)
        factor = 1.0 + curved / self.stiffening_m + 4.0 * (curved / self.closing_m) ** 4
        return np.asarray(self.stiffness_n_per_m * factor * self._compute_growth(curved))

    def _compute_growth(self, depth_m: FloatArray) -> FloatArray:
        """Compute the exponential factor of the layer's force law at compressions f64[...], metres."""
        return np.asarray(np.exp(depth_m / self.stiffening_m + (depth_m / self.closing_m) ** 4))


class SoftLoad(NamedTuple):
    """Load of the contact on the boards, about each bracket's origin, in the world.

    wrench: f64[s, 6], force (N) and moment (Nm). stiffness: f64[s, 6, 6], negative derivative of the wrench with
    respect to a small motion of the board relative to the object (translation, rotation): symmetric, positive
    semidefinite.
    """

    wrench: FloatArray
    stiffness: FloatArray


class _Columns(NamedTuple):
    """The m indented columns of a sheet, in the object's frame.

    piece: int[m], index in the sheet. top, axis: f64[m, 3]. depth: f64[m], metres. normal: f64[m, 3], of the object's
    surface. slope: f64[m], cosine between the inward normal and the axis.
    """

    piece: IndexArray
    top: FloatArray
    axis: FloatArray
    depth: FloatArray
    normal: FloatArray
    slope: FloatArray


def _make_cross(vectors: FloatArray) -> FloatArray:
    """Matrices f64[m, 3, 3] that compute the cross product with vectors f64[m, 3]."""
    return cross(vectors[:, None, :], np.eye(3)[None]).transpose(0, 2, 1)


class LayerContact(Protocol):
    """Interface of the contact between the soft sheet of a hand and one solid shape."""

    def compute_load(self, sensor_poses: FloatArray, object_pose: FloatArray, advance: bool = False) -> SoftLoad:
        """Load on the boards; brackets at `sensor_poses` f64[s, 4, 4], object at `object_pose` f64[4, 4], world.

        advance: store where the columns stick to the object; call it once per time step, with the poses of the step.
        """
        ...

    def get_clearances(self) -> FloatArray:
        """Lower bound of the distance from the layer of each board to the solid at the last load, f64[s], metres."""
        ...

    def compute_taxel_forces(self, sensor_poses: FloatArray, object_pose: FloatArray) -> FloatArray:
        """Normal force on every taxel, newtons, f64[n]. The load on the margin without electrodes is not included."""
        ...


class SoftContact:
    """Contact of the soft layer with a solid (`LayerContact`), computed with NumPy.

    law: force law of the layer on one taxel. friction: of the layer's surface on the solid.
    """

    def __init__(self, hand: Hand, shape: Shape, law: LayerLaw, friction: LayerFriction | None = None) -> None:
        """Prepare the contact of the hand's dielectric layer with a solid, computed with NumPy.

        hand: the skin, whose taxels are divided into square columns. shape: the touching solid. law: force law of the
        layer on one taxel. friction: of the layer's surface on the solid; None: `LayerFriction()`.
        """
        self.hand = hand
        self.sheet: Sheet = build_sheet(hand, SPRINGS_PER_SIDE)
        self._shape, self._law, self._friction = shape, law, friction or LayerFriction()
        self._layer_m = hand.layer_m or 0.0
        self._near_pieces = np.arange(self.sheet.n_taxels)
        self._anchors = np.full((self.sheet.n_taxels, 3), np.nan)
        self._search_poses: FloatArray | None = None  # poses of the boards when `_near_pieces` was computed
        radius = np.linalg.norm(self.sheet.position, axis=1)
        boards = range(len(hand.boards))
        self._board_radius_m = np.array([radius[self.sheet.board_index == board].max() for board in boards])

    def compute_load(self, sensor_poses: FloatArray, object_pose: FloatArray, advance: bool = False) -> SoftLoad:
        """Compute the contact load on every board: wrench and stiffness, world frame, about each bracket's origin.

        sensor_poses: f64[s, 4, 4], brackets in the world. object_pose: f64[4, 4], world. advance: store where the
        columns stick to the object.
        """
        board_poses = inverse(object_pose) @ sensor_poses
        columns = self._find_columns(board_poses)
        force, stiffness = self._load_columns(columns, advance)
        board = self.sheet.board_index[columns.piece]
        arm = columns.top - columns.depth[:, None] * columns.axis - board_poses[board, :3, 3]
        rotation = object_pose[:3, :3]
        wrench, total = np.zeros((len(sensor_poses), 6)), np.zeros((len(sensor_poses), 6, 6))
        for index in np.unique(board):
            on_board = board == index
            motion = np.concatenate([np.tile(np.eye(3), (on_board.sum(), 1, 1)), _make_cross(arm[on_board])], axis=1)
            motion = np.kron(np.eye(2), rotation) @ motion
            wrench[index] = np.einsum("mij,mj->i", motion, force[on_board])
            total[index] = np.einsum("mij,mjk,mlk->il", motion, stiffness[on_board], motion)
        return SoftLoad(wrench, total)

    def get_clearances(self) -> FloatArray:
        """Return a lower bound of the distance of each board's layer from the solid at the last load, f64[s], m."""
        boards = np.arange(len(self.hand.boards))
        return np.where(np.isin(boards, self.sheet.board_index[self._near_pieces]), 0.0, NEAR_M)

    def compute_taxel_forces(self, sensor_poses: FloatArray, object_pose: FloatArray) -> FloatArray:
        """Compute the contact force on each taxel along its normal, f64[n], newtons.

        sensor_poses: f64[s, 4, 4], brackets in the world. object_pose: f64[4, 4], world.
        """
        columns = self._find_columns(inverse(object_pose) @ sensor_poses)
        share = self.sheet.area_share[columns.piece]
        slope = np.maximum(columns.slope, 0.0) / np.maximum(columns.slope, MIN_SLOPE)
        force = self._law.compute_force(columns.depth) * share * slope
        count = self.hand.n_taxels
        return np.asarray(np.bincount(columns.piece // SPRINGS_PER_SIDE**2, force, count)[:count], dtype=np.float64)

    def _load_columns(self, columns: _Columns, advance: bool) -> tuple[FloatArray, FloatArray]:
        """Compute force f64[m, 3] and stiffness f64[m, 3, 3] of indented columns, in the object's frame.

        advance: store where the columns stick to the object, and forget the points of all other columns.
        """
        share, normal = self.sheet.area_share[columns.piece], columns.normal
        limited = np.maximum(columns.slope, MIN_SLOPE)
        pressing = self._law.compute_force(columns.depth) * share / limited
        rate = self._law.compute_stiffness(columns.depth) * share / limited**2
        across = np.eye(3) - normal[:, :, None] * normal[:, None, :]
        force, stiffness = pressing[:, None] * normal, rate[:, None, None] * (np.eye(3) - across)
        shear = np.nan_to_num(columns.top - self._anchors[columns.piece])
        shear -= (shear * normal).sum(axis=1)[:, None] * normal
        length, spring = np.linalg.norm(shear, axis=1), share * self._friction.stiffness_n_per_m
        limit = self._friction.coefficient * pressing
        slides = spring * length > limit
        stiffness_across = np.divide(limit, length, out=spring.copy(), where=slides)
        along = np.divide(shear, length[:, None], out=np.zeros_like(shear), where=slides[:, None])
        if advance:
            self._anchors[:] = np.nan
            self._anchors[columns.piece] = columns.top - shear * (stiffness_across / spring)[:, None]
        if self._friction.coefficient == 0.0:
            return force, stiffness
        stiffness += stiffness_across[:, None, None] * (across - along[:, :, None] * along[:, None, :])
        return force - stiffness_across[:, None] * shear, stiffness

    def _find_columns(self, board_poses: FloatArray) -> _Columns:
        """Find the indented columns of the sheet. board_poses: f64[s, 4, 4], brackets in the object's frame."""
        if self._search_poses is None or self._bound_motion(board_poses - self._search_poses) > NEAR_M:
            self._find_near_pieces(board_poses)
        points, axes = self._compute_lines(board_poses, self._near_pieces)
        tops = points + self._layer_m * axes
        depth, normal = self._shape.indent(tops, axes, MIN_SLOPE)
        is_indented = depth > 0.0
        tops, axes, normal = tops[is_indented], axes[is_indented], normal[is_indented]
        slope = -(normal * axes).sum(axis=1)
        return _Columns(self._near_pieces[is_indented], tops, axes, depth[is_indented], normal, slope)

    def _compute_lines(self, board_poses: FloatArray, pieces: IndexArray) -> tuple[FloatArray, FloatArray]:
        """Compute centres and normals of the pieces [m] of the sheet in the object's frame, f64[m, 3] each."""
        pose = board_poses[self.sheet.board_index[pieces]]
        points = np.einsum("mij,mj->mi", pose[:, :3, :3], self.sheet.position[pieces]) + pose[:, :3, 3]
        return points, np.einsum("mij,mj->mi", pose[:, :3, :3], self.sheet.normal[pieces])

    def _bound_motion(self, pose_change: FloatArray) -> float:
        """Compute an upper bound of the motion of any piece of the sheet, metres.

        pose_change: f64[s, 4, 4], change of the poses of the boards since the last search for pieces near the object.
        """
        rotation = np.sqrt(np.einsum("sij,sij->s", pose_change[:, :3, :3], pose_change[:, :3, :3]))
        translation = np.sqrt(np.einsum("si,si->s", pose_change[:, :3, 3], pose_change[:, :3, 3]))
        return float(np.max(translation + rotation * self._board_radius_m))

    def _find_near_pieces(self, board_poses: FloatArray) -> None:
        """Find and store the pieces of the sheet that can touch the object before a board has moved by `NEAR_M`."""
        reach = self._layer_m + NEAR_M
        is_near = self._shape.distance_bound(board_poses[:, :3, 3]) < reach + self._board_radius_m
        on_near_boards = np.flatnonzero(is_near[self.sheet.board_index])
        points, _ = self._compute_lines(board_poses, on_near_boards)
        self._near_pieces = on_near_boards[self._shape.distance_bound(points) < reach]
        self._search_poses = board_poses
