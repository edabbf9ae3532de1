"""Equilibrium of an object on a compliant mount against the simulator's layer of springs.

The spring of the mount along its line carries a given force; its other springs and the layer deform. The root of the
six equations of force and moment is found with MINPACK's hybrid method (Powell 1970) and the stiffness of the layer.
"""

from bisect import bisect_left
from typing import Literal, NamedTuple

import numpy as np
from scipy.interpolate import PchipInterpolator
from scipy.optimize import root

from taxel.campaign.indentation.errors import EquilibriumError
from taxel.campaign.indentation.fixed_layer import FixedSkinLayer
from taxel.campaign.indentation.plan import IndenterMount
from taxel.grasp.shapes import Shape
from taxel.hand.transforms import from_rotation_vector
from taxel.types import FloatArray

LEVELS = (0.02, 0.07, 0.17, 0.33, 0.6, 1.0)
"""Shares of the force at which the equilibrium is solved; between them the motion is interpolated over the travel."""

TOLERANCE, FALLBACK_TOLERANCE = 1e-3, 1e-2
"""Residual force as a share of the mount's force. The fallback holds for objects at the rim of the skin, where the
discrete springs permit no better balance."""

LENGTH_M = 1e-4
"""Unit of the unknowns: typical deflection of the skin."""

ARM_M = 0.025
"""Lever arm that converts rotations into lengths and moments into forces."""

FIRST_DEPTHS_M = np.geomspace(1e-5, 4e-3, 40).tolist()
"""Depths of a rigid object that are tried for the first guess."""


class SimulatedPath(NamedTuple):
    """Equilibria of an object from first contact to hold.

    travel_m: travel of the mount in the hold. motion: f64[6] of the object in the hold: translation, metres, and
    rotation vector, radians, about the point at which the mount holds it. curve: this motion as a function of the
    mount's travel, from first contact to hold.
    """

    travel_m: float
    motion: FloatArray
    curve: PchipInterpolator

    def motions(self, travel_m: FloatArray, direction: FloatArray) -> FloatArray:
        """Interpolate the motion f64[k, 6] of the object between the solved equilibria, at k travels of its mount.

        travel_m: f64[k]. Before first contact the object moves with the mount along `direction` f64[3], without
        deflection.
        """
        loaded = np.asarray(self.curve(np.clip(travel_m, self.curve.x[0], self.travel_m)))
        loaded[:, :3] += np.minimum(travel_m - self.curve.x[0], 0.0)[:, None] * direction
        return loaded


class SimulatedEquilibrium:
    """Solver for the equilibrium of one object that a mount with springs presses into the simulated layer."""

    def __init__(
        self, layer: FixedSkinLayer, shape: Shape, mount: IndenterMount, touch_pose: FloatArray, direction: FloatArray
    ) -> None:
        """Create the solver of one object, which the mount holds at the centre of its bounding box.

        touch_pose: f64[4, 4], pose of the object at travel 0, the nominal first contact. direction: unit vector f64[3]
        of the travel.
        """
        self._layer, self._shape, self._mount = layer, shape, mount
        self._touch, self._direction = touch_pose, direction
        self._near = layer.near(shape, touch_pose)
        self._arm = -touch_pose[:3, :3] @ shape.bounds.mean(axis=0)
        self._pivot = touch_pose[:3, 3] - self._arm
        lateral = np.eye(3) - np.outer(direction, direction)
        self._mount_stiffness = np.zeros((6, 6))
        self._mount_stiffness[:3, :3] = mount.n_per_m * lateral
        self._mount_stiffness[3:, 3:] = mount.nm_per_rad * np.eye(3)
        # Units of the three translations and the three rotations among the unknowns.
        self._unit = LENGTH_M * np.array([1.0] * 3 + [1.0 / ARM_M] * 3)

    def solve_path(self, force_n: float, levels: tuple[float, ...] = LEVELS) -> SimulatedPath:
        """Solve for the equilibrium of the object at increasing forces from first contact to `force_n` newtons.

        levels: increasing shares of the force, the last of which is 1. Raises `EquilibriumError` if there is no
        equilibrium.
        """
        touch_m = self._compute_touch_travel()
        motion = self._first_guess(levels[0] * force_n, touch_m)
        # The first contact with the layer may precede the contact with the centre of any of its squares.
        touch_m = min(touch_m, float(motion[:3] @ self._direction) - FIRST_DEPTHS_M[0])
        travels, motions = [touch_m], [np.concatenate([touch_m * self._direction, np.zeros(3)])]
        previous, slope = 0.0, np.zeros(6)
        for level in levels:
            step = np.log(level / previous) if previous else 1.0  # the motion is nearly linear in the log of the force
            start, motion = motion, self._solve(motion + step * slope, motion, level * force_n)
            slope, previous = ((motion - start) / step if previous else slope), level
            travels.append(float(motion[:3] @ self._direction) + level * force_n / self._mount.n_per_m)
            motions.append(motion)
        # At a snap-through the travel of the mount does not increase; the curve skips these levels.
        rising = [index for index, travel in enumerate(travels) if travel < min(travels[index + 1 :], default=np.inf)]
        curve = PchipInterpolator(np.array(travels)[rising], np.stack(motions)[rising], axis=0)
        return SimulatedPath(travels[-1], motion, curve)

    def pose(self, motion: FloatArray) -> FloatArray:
        """Compute the pose f64[4, 4] of the object, world, after a motion f64[6] from its pose at travel 0.

        The motion is a translation, metres, and a rotation vector, radians, about the point of the mount.
        """
        rotation = from_rotation_vector(motion[3:])
        pose = rotation @ self._touch
        pose[:3, 3] = motion[:3] + self._pivot + rotation[:3, :3] @ self._arm
        return np.asarray(pose)

    def taxel_forces(self, motion: FloatArray) -> FloatArray:
        """Compute the normal force on every taxel after a motion f64[6] of the object, newtons, f64[n]."""
        return self._layer.taxel_forces(self._near, self._shape, self.pose(motion))

    def _compute_touch_travel(self) -> float:
        """Compute the travel of the undeflected mount at which the object first touches the upper end of a spring.

        Unit: metres. Raises EquilibriumError if the object meets no skin.
        """
        surface = self._near.point + self._layer.thickness_m * self._near.normal
        points = (surface - self._touch[:3, 3]) @ self._touch[:3, :3]
        travel = self._shape.ray_separation(points, -self._touch[:3, :3].T @ self._direction)
        first = float(travel.min(initial=np.inf))
        if not np.isfinite(first):
            raise EquilibriumError("meets no skin")
        return first

    def _first_guess(self, force: float, touch_m: float) -> FloatArray:
        """Find the translation f64[6] to the smallest of `FIRST_DEPTHS_M` at which the layer carries `force` newtons.

        touch_m: travel to first contact, metres. Raises EquilibriumError if the layer carries less force at any of
        these depths.
        """

        def motion(depth: float) -> FloatArray:
            """Return the motion f64[6] of the object to a depth in metres, without rotation."""
            return np.concatenate([(touch_m + depth) * self._direction, np.zeros(3)])

        def layer_force(depth: float) -> float:
            """Compute the force of the layer against the motion, newtons, at a depth in metres."""
            forces = self._layer.force(self._near, self._layer.depth(self._near, self._shape, self.pose(motion(depth))))
            return -float(forces @ (self._near.normal @ self._direction))

        index = bisect_left(FIRST_DEPTHS_M, force, key=layer_force)
        if index == len(FIRST_DEPTHS_M):
            raise EquilibriumError("meets no skin that carries the force")
        return motion(FIRST_DEPTHS_M[index])

    def _residual(self, scaled: FloatArray, force: float) -> tuple[FloatArray, FloatArray]:
        """Compute the sum of forces and moments on the object, f64[6], and its Jacobian f64[6, 6], both dimensionless.

        The sum, the residual, is 0 in equilibrium. It is given in units of `force`, the spring force of the mount along
        its line, newtons; moments are about the point of the mount and are divided by `ARM_M`. scaled: motion of the
        object in units of `LENGTH_M`.
        """
        motion = scaled * self._unit
        depth = self._layer.depth(self._near, self._shape, self.pose(motion))
        is_loaded = depth > 0.0
        springs, depth = self._near.select(is_loaded), depth[is_loaded]
        x, y, z = (self._pivot + motion[:3]).tolist()
        cross_matrix = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        lines = np.hstack([springs.normal, springs.moment - springs.normal @ cross_matrix.T])
        residual = self._layer.force(springs, depth) @ lines - self._mount_stiffness @ motion
        residual[:3] += force * self._direction
        jacobian = -(lines * self._layer.stiffness(springs, depth)[:, None]).T @ lines - self._mount_stiffness
        weight = np.array([1.0] * 3 + [1.0 / ARM_M] * 3) / force
        return weight * residual, weight[:, None] * jacobian * self._unit

    def _solve(self, guess: FloatArray, previous: FloatArray, force: float) -> FloatArray:
        """Solve for the motion f64[6] of the object in equilibrium under `force` newtons of the mount.

        guess: start of the first attempt. previous: equilibrium under a smaller force, the start of the next two. The
        Levenberg-Marquardt method, which is tried last, is slower but converges where Powell's method stops at a kink.
        Raises EquilibriumError if all attempts fail.
        """
        attempts: tuple[tuple[FloatArray, Literal["hybr", "lm"]], ...] = (
            (guess, "hybr"),
            (previous, "hybr"),
            (previous, "lm"),
        )
        results = []
        for start, method in attempts:
            solution = root(
                self._residual, start / self._unit, args=(force,), method=method, jac=True, options={"xtol": 1e-5}
            )
            results.append((float(np.linalg.norm(solution.fun)), np.asarray(solution.x * self._unit)))
            if results[-1][0] < TOLERANCE:
                return results[-1][1]
        residual, motion = min(results, key=lambda result: result[0])
        if residual < FALLBACK_TOLERANCE:
            return motion
        raise EquilibriumError(f"has no equilibrium under {force:.1f} N")
