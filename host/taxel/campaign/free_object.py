"""The object of the emulated hand: a free rigid body under gravity that stands on a plane with dry friction."""

from typing import Final

import numpy as np

from taxel.grasp.objects import (
    GRAVITY_M_PER_S2,
    STAND_FRICTION,
    STAND_N_PER_M,
    STEADYING_N_PER_M,
    STEADYING_N_S_PER_M,
    STEADYING_NM_PER_RAD,
    STEADYING_NM_S_PER_RAD,
    compute_mass_properties,
)
from taxel.grasp.shapes import Shape
from taxel.hand.transforms import from_rotation_vector, to_rotation_vector
from taxel.types import FloatArray

MESH_RESOLUTION: Final = 20
"""Points on the edges of a cylinder (chosen)."""


class FreeObject:
    """Pose, inertia and support of a free object. Coordinates: motion of the centre of mass and rotation, world.

    The points of the object that touch the stand are its vertices. Each vertex is a spring across the plane, sticks
    to the plane, and slides where the force along the plane exceeds the friction coefficient times the force across.

    Attributes:
        pose: f64[4, 4], object frame in the world.
    """

    def __init__(self, shape: Shape, pose: FloatArray) -> None:
        """Place an object at rest on its stand, whose surface is the plane z = 0 of the object's first pose."""
        self.pose = pose.copy()
        mass = compute_mass_properties(shape)
        self._mass_kg, self._centre, self._inertia = mass.mass_kg, mass.centre_m, mass.inertia_kg_m2
        self._vertices = np.unique(shape.mesh(MESH_RESOLUTION)[0].round(9), axis=0)
        self._up, self._level = pose[:3, 2].copy(), float(pose[:3, 2] @ pose[:3, 3])
        bottom = self._vertices[:, 2] < self._vertices[:, 2].min() + 1e-6
        self._rate = STAND_N_PER_M / bottom.sum()
        self._stuck = np.full_like(self._vertices, np.nan)
        self._steadied_pose, self._steadying = pose.copy(), 1.0

    def steady(self, firmness: float) -> None:
        """Set how firmly the experimenter steadies the object, 0 to 1; a new hold is at the present pose."""
        if self._steadying == 0.0 and firmness > 0.0:
            self._steadied_pose = self.pose.copy()
        self._steadying = firmness

    def compute_steadying(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Force f64[6] of the experimenter's hand (N, Nm about the centre of mass), stiffness and damping f64[6]."""
        firmness = self._steadying
        motion = np.zeros(6)
        if firmness == 0.0:
            return motion, motion, motion
        motion[:3] = self.pose[:3, 3] - self._steadied_pose[:3, 3]
        motion[3:] = to_rotation_vector(self.pose @ np.linalg.inv(self._steadied_pose))
        arm = self.pose[:3, 3] - self.centre
        motion[:3] -= np.cross(motion[3:], arm)  # of the centre of mass
        stiffness = firmness * np.repeat([STEADYING_N_PER_M, STEADYING_NM_PER_RAD], 3)
        return -stiffness * motion, stiffness, firmness * np.repeat([STEADYING_N_S_PER_M, STEADYING_NM_S_PER_RAD], 3)

    @property
    def centre(self) -> FloatArray:
        """Centre of mass in the world, f64[3], metres."""
        return np.asarray(self.pose[:3, :3] @ self._centre + self.pose[:3, 3])

    def compute_mass_matrix(self) -> FloatArray:
        """Mass matrix f64[6, 6] for the velocity of the centre of mass and the angular velocity, world."""
        matrix = np.diag(np.repeat([self._mass_kg, 0.0], 3))
        matrix[3:, 3:] = self.pose[:3, :3] @ self._inertia @ self.pose[:3, :3].T
        return matrix

    def compute_support(self) -> tuple[FloatArray, FloatArray]:
        """Weight and force of the stand, f64[6] (N, Nm about the centre of mass), and its stiffness f64[6, 6].

        The points where the object sticks to the stand follow. Call it once per time step.
        """
        load, stiffness = np.zeros(6), np.zeros((6, 6))
        load[2] = -self._mass_kg * GRAVITY_M_PER_S2
        points = self._vertices @ self.pose[:3, :3].T + self.pose[:3, 3]
        depth = self._level - points @ self._up
        is_touching = depth > 0.0
        self._stuck[~is_touching] = np.nan
        if not is_touching.any():
            return load, stiffness
        points, depth = points[is_touching], depth[is_touching]
        stuck = np.where(np.isnan(self._stuck[is_touching]), points, self._stuck[is_touching])
        slip = points - stuck
        slip -= (slip @ self._up)[:, None] * self._up
        distance = np.linalg.norm(slip, axis=1)
        share = np.minimum(1.0, STAND_FRICTION * depth / np.maximum(distance, 1e-12))
        self._stuck[is_touching] = points - share[:, None] * slip
        across = np.outer(self._up, self._up)
        springs = across + share[:, None, None] * (np.eye(3) - across)
        direction = slip / np.maximum(distance, 1e-12)[:, None]
        springs -= np.where(share < 1.0, share, 0.0)[:, None, None] * direction[:, :, None] * direction[:, None, :]
        arms = points - self.centre
        motion = np.zeros((len(points), 6, 3))
        motion[:, :3] = np.eye(3)
        x, y, z = arms.T
        motion[:, 3, 1], motion[:, 3, 2], motion[:, 4, 2] = -z, y, -x
        motion[:, 4, 0], motion[:, 5, 0], motion[:, 5, 1] = z, -y, x
        force = self._rate * (depth[:, None] * self._up - share[:, None] * slip)
        load += np.einsum("kij,kj->i", motion, force)
        stiffness += self._rate * np.einsum("kij,kjl,kml->im", motion, springs, motion)
        return load, stiffness

    def move(self, velocity: FloatArray, dt: float) -> None:
        """Move the object for `dt` seconds. velocity: f64[6], of the centre of mass (m/s), and angular (rad/s)."""
        centre = self.centre + dt * velocity[:3]
        rotation = from_rotation_vector(dt * velocity[3:])[:3, :3] @ self.pose[:3, :3]
        self.pose[:3, :3], self.pose[:3, 3] = rotation, centre - rotation @ self._centre
