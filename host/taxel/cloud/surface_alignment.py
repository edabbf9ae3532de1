"""Alignment of a cloud to a surface with second derivatives of the squared distances.

Besl and McKay (1992) keep the nearest point of each point fixed and solve for the motion. This is a step of Newton's
method in which the second derivative of half the squared distance is the identity, its largest possible value (that of
a corner). For a triangle mesh the exact second derivative is known: n n^T if the nearest point lies inside a face of
normal n, I - e e^T if it lies on an edge of direction e, I if it is a corner. A step of `SurfaceAlignment` uses the
mean damping * (second derivative for fixed points) + (1 - damping) * (exact second derivative). With a damping of 1,
every step decreases the sum of squares. The damping is lowered after each step that decreases the sum, and raised after
each step that does not. The method usually converges to the same minimum as that of Besl and McKay, in some 6 steps
instead of 100 to 300.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from taxel.cloud.mesh import ClosestPoints, TriangleMesh
from taxel.hand.transforms import apply, cross, from_rotation_vector
from taxel.types import FloatArray

MIN_DAMPING: Final = 1e-4
"""Smallest damping."""

DAMPING_DECREASE, DAMPING_INCREASE = 0.25, 5.0
"""Factors by which the damping is multiplied after a step that decreases the sum of squares, and after one that does
not."""

SLOW_PROGRESS: Final = 1.4
"""Ratio of achieved to predicted decrease of the sum of squares above which the next step is twice as long: the last
step was too short for the slope."""

SMALL_DECREASE: Final = 1e-3
"""Relative decrease of the sum of squares below which a step is treated as small."""


@dataclass
class SurfaceAlignment:
    """State of the alignment of a cloud to a surface.

    transform: f64[4, 4], from the original to the current pose. points: f64[N, 3], points in the current pose. closest:
    nearest points of the surface. cost: sum of squared distances, m^2. tolerance: relative decrease of the cost below
    which the alignment ends. damping: weight of the second derivative for fixed nearest points, 0 to 1. step_factor:
    factor on the length of the next step. last_decrease: decrease of the cost in the last step, m^2.
    """

    mesh: TriangleMesh
    transform: FloatArray
    points: FloatArray
    closest: ClosestPoints
    cost: float
    tolerance: float
    is_finished: bool = False
    damping: float = 1.0
    step_factor: float = 1.0
    last_decrease: float = 0.0

    @classmethod
    def start(cls, points: FloatArray, mesh: TriangleMesh, start: FloatArray, tolerance: float) -> SurfaceAlignment:
        """Create the state of an iterative alignment of points to a mesh at its first guess, the transform `start`.

        tolerance: relative decrease of the cost below which the alignment ends.
        """
        moved = apply(start, points)
        closest = mesh.find_closest(moved)
        alignment = cls(mesh, start, moved, closest, _cost(closest), tolerance)
        alignment._update_derivatives()
        return alignment

    def step(self) -> None:
        """Compute one damped Newton step of the alignment; accept it if it decreases the sum of squared distances.

        The step uses a weighted mean of two second derivatives (Hessians): the Hessian for fixed nearest points has
        the weight `damping`, the exact Hessian has the weight 1 - `damping`. A step that does not decrease the sum is
        discarded. If the discarded step was lengthened (`step_factor` above 1), the next step has its computed length.
        Otherwise the damping is raised; if it is already 1, the alignment is finished.
        """
        hessian = self.damping * self._fixed_hessian + (1.0 - self.damping) * self._exact_hessian
        # A small multiple of the identity (scaled to the size of the cloud) keeps the pose in directions in which the
        # surface does not determine it.
        regularised = hessian + 1e-12 * self._fixed_hessian
        motion: FloatArray = np.asarray(-np.linalg.solve(regularised, self._gradient), dtype=np.float64)
        # The gradient and the Hessian belong to half the cost, so the full step decreases the cost by this product.
        predicted = -float(self._gradient @ motion)
        candidate = self._motion_transform(self.step_factor * motion)
        points = apply(candidate, self.points)
        closest = self.mesh.find_closest(points)
        decrease = self.cost - _cost(closest)
        if decrease > 0.0:
            self._accept(candidate @ self.transform, points, closest, decrease, predicted)
        elif self.step_factor > 1.0:
            self.step_factor = 1.0
        elif self.damping >= 1.0:
            self.is_finished = True
        else:
            self.damping = min(self.damping * DAMPING_INCREASE, 1.0)

    def _accept(
        self, transform: FloatArray, points: FloatArray, closest: ClosestPoints, decrease: float, predicted: float
    ) -> None:
        """Accept a step that decreased the sum of squared distances, and adapt damping and step factor.

        The next step is lengthened if small steps decrease the sum by more than predicted, and further as long as the
        decreases grow. decrease, predicted: actual and predicted decrease of the sum.
        """
        is_small = decrease < SMALL_DECREASE * self.cost
        # A high damping shortens the step, so a small decrease does not yet indicate convergence.
        self.is_finished = decrease < self.tolerance * self.cost and self.step_factor <= 1.0 and self.damping < 0.5
        if self.step_factor > 1.0:
            self.step_factor = 2.0 * self.step_factor if decrease > self.last_decrease else 1.0
        elif is_small and self.damping < 0.1 and decrease > SLOW_PROGRESS * predicted:
            self.step_factor = 2.0
        self.transform, self.points, self.closest, self.last_decrease = transform, points, closest, decrease
        self.cost -= decrease
        self.damping = max(self.damping * DAMPING_DECREASE, MIN_DAMPING)
        if not self.is_finished:
            self._update_derivatives()

    def _update_derivatives(self) -> None:
        """Compute the derivatives of half the sum of squared distances with respect to a small motion of the cloud.

        The motion is a rotation about the centre of the cloud and a shift. The method stores the gradient and two
        second derivatives: the Hessian for fixed nearest points, and the exact Hessian. The exact Hessian depends on
        where the nearest point of a cloud point lies. Inside a face, only a motion along the normal changes the squared
        distance. On an edge, a motion perpendicular to the edge changes it too. On a corner, a motion in any direction
        does. Each of these directions is a row of the Jacobian.
        """
        self._centre = self.points.mean(axis=0)
        arms = self.points - self._centre
        normal = self.closest.normal
        rows = [_jacobian(arms, normal)]
        edge, edge_direction, corner = self.mesh.find_edges_and_corners(self.closest)
        rows.append(_jacobian(arms[edge], cross(edge_direction, normal[edge])))
        for axis in np.eye(3):
            tangent = axis - (normal[corner] @ axis)[:, None] * normal[corner]
            rows.append(_jacobian(arms[corner], tangent))
        inertia = arms.T @ arms
        self._gradient = rows[0].T @ self.closest.distance
        jacobian = np.concatenate(rows)
        self._exact_hessian = jacobian.T @ jacobian
        # A motion of a point in any direction counts. Rotation and shift are not coupled, because the rotation is about
        # the centre of the points.
        self._fixed_hessian = np.zeros((6, 6))
        self._fixed_hessian[:3, :3] = np.trace(inertia) * np.eye(3) - inertia
        self._fixed_hessian[3:, 3:] = len(arms) * np.eye(3)

    def _motion_transform(self, motion: FloatArray) -> FloatArray:
        """Convert a motion f64[6] to a transform f64[4, 4].

        motion: rotation vector about the centre of the cloud, radians, then shift, metres.
        """
        transform = from_rotation_vector(motion[:3])
        transform[:3, 3] = self._centre + motion[3:] - transform[:3, :3] @ self._centre
        return transform


def _jacobian(arms: FloatArray, directions: FloatArray) -> FloatArray:
    """Return the derivatives f64[N, 6] of the displacement of each point along its direction.

    Columns 0 to 2 are derivatives with respect to a rotation vector, columns 3 to 5 with respect to a shift. arms:
    points relative to the centre of rotation, f64[N, 3]. directions: f64[N, 3].
    """
    return np.concatenate([cross(arms, directions), directions], axis=1)


def _cost(closest: ClosestPoints) -> float:
    """Compute the sum of squared distances to the nearest points."""
    return float(closest.distance @ closest.distance)
