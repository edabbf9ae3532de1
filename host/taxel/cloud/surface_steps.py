"""Steps that bring a cloud to a surface: those of iterative closest points, made faster by the surface's own shape.

Besl and McKay (1992) hold each point's nearest point fixed and solve for the motion. That is a step of Newton's method
in which every nearest point counts as a corner: the second derivative of half a squared distance is taken as the
identity, more than it can be. For a triangle mesh it is known exactly: n n^T where the nearest point lies inside a face
of normal n, I - e e^T on an edge of direction e, I on a corner. A step here uses share * (theirs) + (1 - share) *
(exact). With share 1 it lowers the sum of squares always; the share falls with every step that does, and rises with one
that does not, so the minimum is the one that theirs ends in, usually, after some 6 steps for 100 to 300.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from taxel.cloud.mesh import Closest, TriangleMesh
from taxel.hand.transforms import apply, cross, from_rotation_vector
from taxel.types import FloatArray

LEAST_SHARE: Final = 1e-4
FALL, RISE = 0.25, 5.0
"""Factors on the share after a step that lowers the sum of squares, and after one that does not."""

CREEP: Final = 1.4
"""A small step that gains this many times what was predicted creeps along a slope: the next one is twice as long."""

SMALL: Final = 1e-3
"""Share of the sum of squares; a step that gains less is small."""


@dataclass
class SurfaceSteps:
    """A cloud on its way to a surface.

    transform: f64[4, 4], the way so far. points: f64[N, 3], where the cloud is. near: of these. cost: sum of squared
    distances, m^2. done: nothing is left to gain.
    """

    mesh: TriangleMesh
    transform: FloatArray
    points: FloatArray
    near: Closest
    cost: float
    still: float
    done: bool = False
    share: float = 1.0
    stretch: float = 1.0
    gained: float = 0.0

    @classmethod
    def begin(cls, points: FloatArray, mesh: TriangleMesh, start: FloatArray, still: float) -> SurfaceSteps:
        """From the transform `start`. still: share of the cost; a step that gains less is the last."""
        moved = apply(start, points)
        near = mesh.closest(moved)
        steps = cls(mesh, start, moved, near, _cost(near), still)
        steps._model()
        return steps

    def step(self) -> None:
        """One step, taken if it lowers the cost."""
        blend = self.share * self._fixed + (1.0 - self.share) * self._exact
        # Solved in units of the cloud's size, with a grain on the diagonal: what the surface leaves free stays.
        whole = blend + 1e-12 * self._fixed
        motion: FloatArray = np.asarray(-np.linalg.solve(whole, self._slope), dtype=np.float64)
        predicted = -float(self._slope @ motion)
        tried = self._moved(self.stretch * motion)
        points = apply(tried, self.points)
        near = self.mesh.closest(points)
        gain = self.cost - _cost(near)
        if gain > 0.0:
            self._take(tried @ self.transform, points, near, gain, predicted)
        elif self.stretch > 1.0:
            self.stretch = 1.0
        elif self.share >= 1.0:
            self.done = True
        else:
            self.share = min(self.share * RISE, 1.0)

    def _take(self, transform: FloatArray, points: FloatArray, near: Closest, gain: float, predicted: float) -> None:
        small = gain < SMALL * self.cost
        self.done = gain < self.still * self.cost and self.stretch <= 1.0 and self.share < 0.5
        if self.stretch > 1.0:
            self.stretch = 2.0 * self.stretch if gain > self.gained else 1.0
        elif small and self.share < 0.1 and gain > CREEP * predicted:
            self.stretch = 2.0
        self.transform, self.points, self.near, self.gained = transform, points, near, gain
        self.cost -= gain
        self.share = max(self.share * FALL, LEAST_SHARE)
        if not self.done:
            self._model()

    def _model(self) -> None:
        """First and second derivatives of half the cost by a turn about the cloud's centre and a shift."""
        self._centre = self.points.mean(axis=0)
        arms = self.points - self._centre
        near, normal = self.near, self.near.normal
        rows = [_rows(arms, normal)]
        edge, along, corner = self.mesh.on_edges(near)
        rows.append(_rows(arms[edge], cross(along, normal[edge])))
        for axis in np.eye(3):
            beside = axis - (normal[corner] @ axis)[:, None] * normal[corner]
            rows.append(_rows(arms[corner], beside))
        spread = arms.T @ arms
        self._slope = rows[0].T @ near.distance
        every = np.concatenate(rows)
        self._exact = every.T @ every
        self._fixed = np.zeros((6, 6))
        self._fixed[:3, :3] = np.trace(spread) * np.eye(3) - spread
        self._fixed[3:, 3:] = len(arms) * np.eye(3)

    def _moved(self, motion: FloatArray) -> FloatArray:
        """The transform of a turn about the cloud's centre, and a shift."""
        transform = from_rotation_vector(motion[:3])
        transform[:3, 3] = self._centre + motion[3:] - transform[:3, :3] @ self._centre
        return transform


def _rows(arms: FloatArray, directions: FloatArray) -> FloatArray:
    """How far points move along directions, by each turn and shift, f64[N, 6]."""
    return np.concatenate([cross(arms, directions), directions], axis=1)


def _cost(near: Closest) -> float:
    return float(near.distance @ near.distance)
