"""The elastic layer as contact inside the simulation: springs on the sheet push while MuJoCo moves the bodies.

Every square of the dielectric sheet, cut into pieces, is a spring along its normal. Board and object come to rest where
the springs' net forces and moments are those that MuJoCo's bodies need: each link's approach and tilts follow from its
joints.

Here in NumPy, as the reference; a grasp runs on the same in C (`taxel.sim.native_contact`).
"""

from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np
import numpy.typing as npt

from taxel.grasp.shapes import Shape
from taxel.hand import Hand
from taxel.hand.sheet import Sheet, build_sheet
from taxel.hand.transforms import cross, inverse
from taxel.types import FloatArray

PARTS = 3
"""Springs along each side of a taxel: an edge that passes between two taxels' centres presses both."""

NEAR_M = 0.003
"""Pieces whose layer is farther from the object are left out until a board has moved by as much against it."""

DEEPEST_M = 0.004
"""A line that enters the object farther below the electrode comes in through another side."""


@dataclass(frozen=True)
class LayerLaw:
    """Force on a taxel of a layer compressed by d: stiffness_n_per_m d exp(d / stiffening_m + (d / closing_m)^4).

    The form is chosen for its fit to presses of the emulated skin; source of the figures: tools/sim/fit_stiffness.py.
    Beyond `straight_m`, where a taxel bears more than any presses it with, the force goes on along its tangent: a
    finger that runs onto an edge sideways is pushed back, not thrown.
    """

    stiffness_n_per_m: float = 604.0
    stiffening_m: float = 0.579e-3
    closing_m: float = 1.46e-3
    straight_m: float = 1.5e-3

    def force(self, depth_m: FloatArray) -> FloatArray:
        """Newtons, f64[...], for depths f64[...] of at least 0."""
        bent = np.minimum(depth_m, self.straight_m)
        return np.asarray(self.stiffness_n_per_m * bent * self._growth(bent) + (depth_m - bent) * self.stiffness(bent))

    def stiffness(self, depth_m: FloatArray) -> FloatArray:
        """Its rise, newtons a metre."""
        bent = np.minimum(depth_m, self.straight_m)
        steeper = 1.0 + bent / self.stiffening_m + 4.0 * (bent / self.closing_m) ** 4
        return np.asarray(self.stiffness_n_per_m * steeper * self._growth(bent))

    def _growth(self, depth_m: FloatArray) -> FloatArray:
        return np.asarray(np.exp(depth_m / self.stiffening_m + (depth_m / self.closing_m) ** 4))

    def secant(self, force_n: float) -> float:
        """Force over depth at a force, newtons a metre."""
        low, high = 0.0, 0.01
        for _ in range(60):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if float(self.force(np.array(middle))) < force_n else (low, middle)
        return force_n / high


class SoftLoad(NamedTuple):
    """What contact does to the boards, about each bracket's origin, in the world.

    wrench: f64[s, 6], force and moment, N and Nm. stiffness: f64[s, 6, 6], how the wrench falls with a small motion of
    the board against the object (translation, rotation): symmetric, positive semidefinite.
    """

    wrench: FloatArray
    stiffness: FloatArray


class LayerContact(Protocol):
    """Contact of a hand's sheet with one shape."""

    def load(self, sensor_poses: FloatArray, object_pose: FloatArray) -> SoftLoad:
        """Contact of brackets at `sensor_poses` f64[s, 4, 4] with the object at `object_pose` f64[4, 4]."""
        ...

    def taxel_forces(self, sensor_poses: FloatArray, object_pose: FloatArray) -> FloatArray:
        """Normal force on every taxel, newtons, f64[n]; the bare margin's part is nobody's."""
        ...


class SoftContact:
    """See `LayerContact`. `law`: of the layer under one taxel."""

    def __init__(self, hand: Hand, shape: Shape, law: LayerLaw) -> None:
        self.hand = hand
        self.sheet: Sheet = build_sheet(hand, PARTS)
        self._shape, self._law = shape, law
        self._layer = hand.layer_m or 0.0
        self._near = np.arange(self.sheet.n_taxels)
        self._looked: FloatArray | None = None  # where the boards were when `_near` was found
        away = np.linalg.norm(self.sheet.position, axis=1)
        self._size = np.array([away[self.sheet.board_index == board].max() for board in range(len(hand.boards))])

    def load(self, sensor_poses: FloatArray, object_pose: FloatArray) -> SoftLoad:
        """See `LayerContact`."""
        square, depth = self._pressed(inverse(object_pose) @ sensor_poses)
        board = self.sheet.board_index[square]
        rotation = sensor_poses[board, :3, :3]
        normal = np.einsum("mij,mj->mi", rotation, self.sheet.normal[square])
        arm = np.einsum("mij,mj->mi", rotation, self.sheet.position[square])
        line = np.hstack([normal, cross(arm, normal)])
        force, rate = self._law.force(depth) / PARTS**2, self._law.stiffness(depth) / PARTS**2
        wrench, stiffness = np.zeros((len(sensor_poses), 6)), np.zeros((len(sensor_poses), 6, 6))
        for index in np.unique(board):
            own = board == index
            wrench[index] = -force[own] @ line[own]
            stiffness[index] = (rate[own, None] * line[own]).T @ line[own]
        return SoftLoad(wrench, stiffness)

    def taxel_forces(self, sensor_poses: FloatArray, object_pose: FloatArray) -> FloatArray:
        """See `LayerContact`."""
        square, depth = self._pressed(inverse(object_pose) @ sensor_poses)
        share = self._law.force(depth) / PARTS**2
        count = self.hand.n_taxels
        return np.asarray(np.bincount(square // PARTS**2, share, count)[:count], dtype=np.float64)

    def _pressed(self, in_object: FloatArray) -> tuple[npt.NDArray[np.intp], FloatArray]:
        """The pieces that bear, [m], and how far each is compressed, metres, f64[m]."""
        if self._looked is None or self._motion(in_object - self._looked) > NEAR_M:
            self._look(in_object)
        points, normals = self._lines(in_object, self._near)
        depth = self._layer - self._shape.ray_separation(points, normals)
        pressed = (depth > 0.0) & (depth < self._layer + DEEPEST_M)
        return self._near[pressed], depth[pressed]

    def _lines(self, in_object: FloatArray, squares: npt.NDArray[np.intp]) -> tuple[FloatArray, FloatArray]:
        pose = in_object[self.sheet.board_index[squares]]
        points = np.einsum("mij,mj->mi", pose[:, :3, :3], self.sheet.position[squares]) + pose[:, :3, 3]
        return points, np.einsum("mij,mj->mi", pose[:, :3, :3], self.sheet.normal[squares])

    def _motion(self, change: FloatArray) -> float:
        """The most that a piece has moved, metres, if the boards' poses have changed so, f64[s, 4, 4]."""
        turned = np.sqrt(np.einsum("sij,sij->s", change[:, :3, :3], change[:, :3, :3]))
        moved = np.sqrt(np.einsum("si,si->s", change[:, :3, 3], change[:, :3, 3]))
        return float(np.max(moved + turned * self._size))

    def _look(self, in_object: FloatArray) -> None:
        reach = self._layer + NEAR_M
        near = self._shape.distance_bound(in_object[:, :3, 3]) < reach + self._size
        maybe = np.flatnonzero(near[self.sheet.board_index])
        points, _ = self._lines(in_object, maybe)
        self._near = maybe[self._shape.distance_bound(points) < reach]
        self._looked = in_object
