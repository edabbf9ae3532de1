"""The elastic layer as contact during the simulation: springs on the sheet load the bodies while MuJoCo moves them.

Every square of the dielectric sheet is divided into pieces, and each piece is a spring along its normal. The position
of each board on the object follows from the joints of the hand, so that forces and moments of springs and joints
balance.

This NumPy implementation is the reference of the tests; grasps use the C implementation (`taxel.sim.native_contact`).
"""

from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np

from taxel.grasp.shapes import Shape
from taxel.hand import Hand
from taxel.hand.sheet import Sheet, build_sheet
from taxel.hand.transforms import cross, inverse
from taxel.types import FloatArray, IndexArray

SPRINGS_PER_SIDE = 3
"""Springs along each side of a taxel (chosen): an edge that passes between the centres of two taxels loads both. More
springs cost time in proportion to their number squared.
"""

NEAR_M = 0.003
"""Search distance, metres: pieces farther from the object are ignored until a board has moved by this distance relative
to the object. The value changes the computing time, not the result.
"""

MAX_DEPTH_M = 0.004
"""Largest depth of the object's surface below the electrode that counts as contact, metres (chosen). A line that enters
the object deeper enters through another side.
"""


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


class LayerContact(Protocol):
    """Interface of the contact between the soft sheet of a hand and one solid shape."""

    def compute_load(self, sensor_poses: FloatArray, object_pose: FloatArray) -> SoftLoad:
        """Load on the boards; brackets at `sensor_poses` f64[s, 4, 4], object at `object_pose` f64[4, 4], world."""
        ...

    def compute_taxel_forces(self, sensor_poses: FloatArray, object_pose: FloatArray) -> FloatArray:
        """Normal force on every taxel, newtons, f64[n]. The load on the margin without electrodes is not included."""
        ...


class SoftContact:
    """Contact of the soft layer with a solid (`LayerContact`), computed with NumPy.

    law: force law of the layer on one taxel.
    """

    def __init__(self, hand: Hand, shape: Shape, law: LayerLaw) -> None:
        """Prepare the contact of the hand's dielectric layer with a solid, computed with NumPy.

        hand: the skin, whose taxels are divided into square springs. shape: the touching solid. law: force law of the
        layer on one taxel.
        """
        self.hand = hand
        self.sheet: Sheet = build_sheet(hand, SPRINGS_PER_SIDE)
        self._shape, self._law = shape, law
        self._layer_m = hand.layer_m or 0.0
        self._near_pieces = np.arange(self.sheet.n_taxels)
        self._search_poses: FloatArray | None = None  # poses of the boards when `_near_pieces` was computed
        radius = np.linalg.norm(self.sheet.position, axis=1)
        boards = range(len(hand.boards))
        self._board_radius_m = np.array([radius[self.sheet.board_index == board].max() for board in boards])

    def compute_load(self, sensor_poses: FloatArray, object_pose: FloatArray) -> SoftLoad:
        """Compute the contact load on every board: wrench and stiffness, world frame, about each bracket's origin.

        sensor_poses: f64[s, 4, 4], brackets in the world. object_pose: f64[4, 4], world.
        """
        piece, depth = self._find_compressed(inverse(object_pose) @ sensor_poses)
        board = self.sheet.board_index[piece]
        rotation = sensor_poses[board, :3, :3]
        normal = np.einsum("mij,mj->mi", rotation, self.sheet.normal[piece])
        arm = np.einsum("mij,mj->mi", rotation, self.sheet.position[piece])
        line = np.hstack([normal, cross(arm, normal)])
        share = self.sheet.area_share[piece]
        force = self._law.compute_force(depth) * share
        rate = self._law.compute_stiffness(depth) * share
        wrench, stiffness = np.zeros((len(sensor_poses), 6)), np.zeros((len(sensor_poses), 6, 6))
        for index in np.unique(board):
            on_board = board == index
            wrench[index] = -force[on_board] @ line[on_board]
            stiffness[index] = (rate[on_board, None] * line[on_board]).T @ line[on_board]
        return SoftLoad(wrench, stiffness)

    def compute_taxel_forces(self, sensor_poses: FloatArray, object_pose: FloatArray) -> FloatArray:
        """Compute the contact force on each taxel, f64[n], newtons.

        sensor_poses: f64[s, 4, 4], brackets in the world. object_pose: f64[4, 4], world.
        """
        piece, depth = self._find_compressed(inverse(object_pose) @ sensor_poses)
        force = self._law.compute_force(depth) * self.sheet.area_share[piece]
        count = self.hand.n_taxels
        return np.asarray(np.bincount(piece // SPRINGS_PER_SIDE**2, force, count)[:count], dtype=np.float64)

    def _find_compressed(self, board_poses: FloatArray) -> tuple[IndexArray, FloatArray]:
        """Find the m compressed pieces of the sheet: their indices, int[m], and compressions, metres, f64[m].

        board_poses: f64[s, 4, 4], brackets in the object's frame.
        """
        if self._search_poses is None or self._bound_motion(board_poses - self._search_poses) > NEAR_M:
            self._find_near_pieces(board_poses)
        points, normals = self._compute_lines(board_poses, self._near_pieces)
        depth = self._layer_m - self._shape.ray_separation(points, normals)
        compressed = (depth > 0.0) & (depth < self._layer_m + MAX_DEPTH_M)
        return self._near_pieces[compressed], depth[compressed]

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
