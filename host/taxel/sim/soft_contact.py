"""The elastic layer as contact during the simulation: columns of the sheet load the bodies while MuJoCo moves them.

Every square of the dielectric sheet is divided into pieces. Each piece is a column, which the object indents along its
axis and shears. A column that an edge of the object crosses is divided along the edge, so that its load is a continuous
function of the position of the edge. Without friction the force on each part has the direction of the object's normal;
its part along the axis follows from the force law of the layer. The surface of the layer sticks to the object until the
force of the shear reaches the friction coefficient times the normal force (Coulomb), and slides beyond.

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
from taxel.sim.column_division import divide_squares
from taxel.types import FloatArray, IndexArray

SPRINGS_PER_SIDE = 3
"""Columns along each side of a taxel (chosen). With 6 instead of 3, the signals of nominal grasps change by 40 to 70
counts RMS at the sides of the rectangular prism and by 160 at its side edge, where fingertips catch or slip past a
sharp edge. More columns cost time in proportion to their number squared.
"""

NEAR_M = 0.003
"""Search distance, metres: pieces farther from the object are ignored until a board has moved by this distance relative
to the object. The value changes the computing time, not the result.
"""

MAX_DEPTH_M = 0.004
"""Largest indentation, metres, for which the search considers all faces of an object (chosen)."""

MIN_SLOPE = 0.5
"""Smallest cosine between the axis of a column and the object's normal for which the column is compressed in full
(chosen: surfaces tilted by up to 60 degrees). A column that the object enters from the side is loaded gradually: its
depth is limited to the distance from that side of the object divided by this number.
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
    stiffening_m + (d / closing_m)^4 + (d / solid_m)^16).

    d is the compression in metres; near `solid_m` no air is left between the pillars. The function is an empirical fit
    to indentations of the emulated skin; source of the parameters: tools/sim/fit_stiffness.py. An edge of an object
    compresses columns that far, although the mean over a taxel is much less. Beyond `straight_m` the force continues
    along the tangent, so that a finger that meets an edge sideways receives no impulse.
    """

    stiffness_n_per_m: float = 597.0
    stiffening_m: float = 0.568e-3
    closing_m: float = 1.51e-3
    solid_m: float = 1.59e-3
    straight_m: float = 1.62e-3

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
        factor += 16.0 * (curved / self.solid_m) ** 16
        return np.asarray(self.stiffness_n_per_m * factor * self._compute_growth(curved))

    def _compute_growth(self, depth_m: FloatArray) -> FloatArray:
        """Compute the exponential factor of the layer's force law at compressions f64[...], metres."""
        closing, solid = (depth_m / self.closing_m) ** 4, (depth_m / self.solid_m) ** 16
        return np.asarray(np.exp(depth_m / self.stiffening_m + closing + solid))


class SoftLoad(NamedTuple):
    """Load of the contact on the boards, about each bracket's origin, in the world.

    wrench: f64[s, 6], force (N) and moment (Nm). stiffness: f64[s, 6, 6], negative derivative of the wrench with
    respect to a small motion of the board relative to the object (translation, rotation): symmetric, positive
    semidefinite.
    """

    wrench: FloatArray
    stiffness: FloatArray


class _Columns(NamedTuple):
    """The m parts of indented columns of a sheet, each below one face of the object, in the object's frame.

    piece: int[m], index of the column in the sheet. top: f64[m, 3], of the column. point: f64[m, 3], where the face
    loads the part. area: f64[m], of the part, relative to the area of the column. depth, deviation: f64[m], mean and
    standard deviation of the depth, metres. normal: f64[m, 3], of the object's surface. slope: f64[m], cosine between
    the inward normal and the axis of the column.
    """

    piece: IndexArray
    top: FloatArray
    point: FloatArray
    area: FloatArray
    depth: FloatArray
    deviation: FloatArray
    normal: FloatArray
    slope: FloatArray


class _Grip(NamedTuple):
    """The n columns in contact, each with the sum of the normal forces of its parts, in the object's frame.

    piece: int[n]. top, point: f64[n, 3], point: where the sum acts. normal: f64[n, 3], direction of the sum. pressing:
    f64[n], magnitude of the sum, newtons. touched: f64[n], share of the area of the column.
    """

    piece: IndexArray
    top: FloatArray
    point: FloatArray
    normal: FloatArray
    pressing: FloatArray
    touched: FloatArray


def _make_cross(vectors: FloatArray) -> FloatArray:
    """Build the matrices f64[m, 3, 3] that compute the cross product with vectors f64[m, 3]."""
    return cross(vectors[:, None, :], np.eye(3)[None]).transpose(0, 2, 1)


class LayerContact(Protocol):
    """Interface of the contact between the soft sheet of a hand and one solid shape."""

    def compute_load(self, sensor_poses: FloatArray, object_pose: FloatArray, advance: bool = False) -> SoftLoad:
        """Compute the load on the boards; poses in the world: `sensor_poses` f64[s, 4, 4], `object_pose` f64[4, 4].

        advance: store where the columns stick to the object; call it once per time step, with the poses of the step.
        """
        ...

    def get_clearances(self) -> FloatArray:
        """Return a lower bound of the distance of each board's layer from the solid at the last load, f64[s], m."""
        ...

    def compute_taxel_forces(self, sensor_poses: FloatArray, object_pose: FloatArray) -> FloatArray:
        """Compute the normal force on each taxel, f64[n], newtons. The load on the margin is not included."""
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
        self._touched = np.zeros(self.sheet.n_taxels)  # share of the area of each piece at the last advance
        self._piece_size_m = float(np.linalg.norm(self.sheet.size, axis=1).max()) / 2
        self._search_poses: FloatArray | None = None  # poses of the boards when `_near_pieces` was computed
        self._motion_m = np.zeros(len(hand.boards))  # largest possible motion of a piece of each board since then
        radius = np.linalg.norm(self.sheet.position, axis=1) + self._piece_size_m
        boards = range(len(hand.boards))
        self._board_radius_m = np.array([radius[self.sheet.board_index == board].max() for board in boards])

    def compute_load(self, sensor_poses: FloatArray, object_pose: FloatArray, advance: bool = False) -> SoftLoad:
        """Compute the contact load on every board: wrench and stiffness, world frame, about each bracket's origin.

        sensor_poses: f64[s, 4, 4], brackets in the world. object_pose: f64[4, 4], world. advance: store where the
        columns stick to the object.
        """
        board_poses = inverse(object_pose) @ sensor_poses
        columns = self._find_columns(board_poses)
        pressing, rate = self._press_parts(columns)
        grip = self._join_parts(columns, pressing)
        shear_force, shear_stiffness = self._shear_columns(grip, advance)
        across = columns.normal[:, :, None] * columns.normal[:, None, :]
        force = np.concatenate([pressing[:, None] * columns.normal, shear_force])
        stiffness = np.concatenate([rate[:, None, None] * across, shear_stiffness])
        board = self.sheet.board_index[np.concatenate([columns.piece, grip.piece])]
        arm = np.concatenate([columns.point, grip.point]) - board_poses[board, :3, 3]
        rotation = object_pose[:3, :3]
        wrench, total = np.zeros((len(sensor_poses), 6)), np.zeros((len(sensor_poses), 6, 6))
        for index in np.unique(board):
            on_board = board == index
            # [m, 6, 3]: converts a force on each column to force and moment about the bracket's origin in the world.
            motion = np.concatenate([np.tile(np.eye(3), (on_board.sum(), 1, 1)), _make_cross(arm[on_board])], axis=1)
            motion = np.kron(np.eye(2), rotation) @ motion
            wrench[index] = np.einsum("mij,mj->i", motion, force[on_board])
            total[index] = np.einsum("mij,mjk,mlk->il", motion, stiffness[on_board], motion)
        return SoftLoad(wrench, total)

    def get_clearances(self) -> FloatArray:
        """Return a lower bound of the distance of each board's layer from the solid at the last load, f64[s], m."""
        boards = np.arange(len(self.hand.boards))
        is_near = np.isin(boards, self.sheet.board_index[self._near_pieces])
        return np.where(is_near, 0.0, NEAR_M - self._motion_m)

    def compute_taxel_forces(self, sensor_poses: FloatArray, object_pose: FloatArray) -> FloatArray:
        """Compute the contact force on each taxel along its normal, f64[n], newtons.

        sensor_poses: f64[s, 4, 4], brackets in the world. object_pose: f64[4, 4], world.
        """
        columns = self._find_columns(inverse(object_pose) @ sensor_poses)
        force = self._press_parts(columns)[0] * np.maximum(columns.slope, 0.0)
        count = self.hand.n_taxels
        # Pieces are numbered by taxel; those of the margin, which has no taxel, follow after the last taxel.
        return np.asarray(np.bincount(columns.piece // SPRINGS_PER_SIDE**2, force, count)[:count], dtype=np.float64)

    def _press_parts(self, columns: _Columns) -> tuple[FloatArray, FloatArray]:
        """Compute the normal force f64[m], newtons, and its stiffness f64[m], N/m, of m parts of columns.

        The mean force over a part follows from two depths that have the part's mean and standard deviation of the
        depth. The force law gives the component along the axis of a column: the normal force is larger by 1 / slope. A
        motion along the normal changes the depth by 1 / slope as well.
        """
        area = self.sheet.area_share[columns.piece] * columns.area
        limited = np.maximum(columns.slope, MIN_SLOPE)
        depths = np.maximum(columns.depth + np.array([[-1.0], [1.0]]) * columns.deviation, 0.0)
        force = self._law.compute_force(depths).mean(axis=0) * area / limited
        return force, self._law.compute_stiffness(depths).mean(axis=0) * area / limited**2

    def _join_parts(self, columns: _Columns, pressing: FloatArray) -> _Grip:
        """Combine the m parts of columns into one contact per column; pressing: f64[m], normal forces, newtons."""
        piece, first, column = np.unique(columns.piece, return_index=True, return_inverse=True)
        normal, point = np.zeros((2, len(piece), 3))
        np.add.at(normal, column, pressing[:, None] * columns.normal)
        np.add.at(point, column, pressing[:, None] * columns.point)
        total = np.bincount(column, pressing, len(piece))
        magnitude = np.linalg.norm(normal, axis=1)
        normal /= np.where(magnitude > 0.0, magnitude, 1.0)[:, None]
        point /= np.where(total > 0.0, total, 1.0)[:, None]
        touched = np.asarray(np.bincount(column, columns.area, len(piece)), dtype=np.float64)
        return _Grip(piece, columns.top[first], point, normal, magnitude, touched)

    def _shear_columns(self, grip: _Grip, advance: bool) -> tuple[FloatArray, FloatArray]:
        """Compute force f64[n, 3] and stiffness f64[n, 3, 3] of the shear of n columns, in the object's frame.

        A part of a column that touches the object anew is not sheared: while the touched share grows, the mean shear
        decreases. advance: store where these columns stick to the object, and discard the points of all other columns.
        Without friction, force and stiffness are 0.
        """
        across = np.eye(3) - grip.normal[:, :, None] * grip.normal[:, None, :]
        shear = np.nan_to_num(grip.top - self._anchors[grip.piece])  # the anchor of a column without contact is NaN
        shear *= np.minimum(self._touched[grip.piece] / grip.touched, 1.0)[:, None]
        shear -= (shear * grip.normal).sum(axis=1)[:, None] * grip.normal
        length = np.linalg.norm(shear, axis=1)
        spring = self.sheet.area_share[grip.piece] * grip.touched * self._friction.stiffness_n_per_m
        limit = self._friction.coefficient * grip.pressing
        slides = spring * length > limit
        stiffness_across = np.divide(limit, length, out=spring.copy(), where=slides)
        along = np.divide(shear, length[:, None], out=np.zeros_like(shear), where=slides[:, None])
        if advance:
            self._anchors[:], self._touched[:] = np.nan, 0.0
            self._anchors[grip.piece] = grip.top - shear * (stiffness_across / spring)[:, None]
            self._touched[grip.piece] = grip.touched
        if self._friction.coefficient == 0.0:
            return np.zeros_like(shear), np.zeros_like(across)
        stiffness = stiffness_across[:, None, None] * (across - along[:, :, None] * along[:, None, :])
        return -stiffness_across[:, None] * shear, stiffness

    def _find_columns(self, board_poses: FloatArray) -> _Columns:
        """Find the indented columns of the sheet and divide them along the edges of the object.

        board_poses: f64[s, 4, 4], brackets in the object's frame.
        """
        if self._search_poses is not None:
            self._motion_m = self._bound_motions(board_poses - self._search_poses)
        if self._search_poses is None or self._motion_m.max() > NEAR_M:
            self._find_near_pieces(board_poses)
            self._motion_m = np.zeros(len(board_poses))
        pieces = self._near_pieces
        points, axes = self._compute_lines(board_poses, pieces)
        tops = points + self._layer_m * axes
        rotation = board_poses[self.sheet.board_index[pieces], :3, :3]
        half_sides = np.einsum("mij,msj->msi", rotation, self.sheet.half_sides[pieces])
        depth, normals = self._shape.view_faces(tops, axes, MIN_SLOPE)
        slopes = -(normals * axes[:, None]).sum(axis=2)
        # Change of the depth below each face along each half side of a column's square.
        depth_change = -np.einsum("mkj,msj->mks", normals, half_sides) / np.maximum(slopes, MIN_SLOPE)[..., None]
        parts = divide_squares(depth, depth_change)
        column, face = parts.column, parts.face
        point = tops[column] + np.einsum("ms,msi->mi", parts.centre, half_sides[column])
        point -= parts.depth[:, None] * axes[column]
        geometry = pieces[column], tops[column], point, parts.share, parts.depth, parts.deviation
        return _Columns(*geometry, normals[column, face], slopes[column, face])

    def _compute_lines(self, board_poses: FloatArray, pieces: IndexArray) -> tuple[FloatArray, FloatArray]:
        """Compute centres and normals of the pieces [m] of the sheet in the object's frame, f64[m, 3] each."""
        pose = board_poses[self.sheet.board_index[pieces]]
        points = np.einsum("mij,mj->mi", pose[:, :3, :3], self.sheet.position[pieces]) + pose[:, :3, 3]
        return points, np.einsum("mij,mj->mi", pose[:, :3, :3], self.sheet.normal[pieces])

    def _bound_motions(self, pose_change: FloatArray) -> FloatArray:
        """Compute an upper bound of the motion of any piece of each board, f64[s], metres.

        The Frobenius norm of the change of a rotation matrix is an upper bound of its effect on a unit vector.
        pose_change: f64[s, 4, 4], change of the poses of the boards since the last search for pieces near the object.
        """
        rotation = np.sqrt(np.einsum("sij,sij->s", pose_change[:, :3, :3], pose_change[:, :3, :3]))
        translation = np.sqrt(np.einsum("si,si->s", pose_change[:, :3, 3], pose_change[:, :3, 3]))
        return np.asarray(translation + rotation * self._board_radius_m)

    def _find_near_pieces(self, board_poses: FloatArray) -> None:
        """Find and store the pieces of the sheet that can touch the object before a board has moved by `NEAR_M`."""
        reach = self._layer_m + NEAR_M + self._piece_size_m
        is_near = self._shape.distance_bound(board_poses[:, :3, 3]) < reach + self._board_radius_m
        on_near_boards = np.flatnonzero(is_near[self.sheet.board_index])
        points, _ = self._compute_lines(board_poses, on_near_boards)
        self._near_pieces = on_near_boards[self._shape.distance_bound(points) < reach]
        self._search_poses = board_poses
