"""Alignment of a cloud in an unknown pose: many first guesses are tried, and the best few are refined.

Each guess moves the centre of the cloud to the centre of the target and its principal axes to those of the target, in
one of the 24 ways that are rotations. The guesses are compared after a few iterations on a subset of the points.
"""

from collections.abc import Callable
from itertools import permutations, product
from typing import Final

import numpy as np

from taxel.cloud.mesh import TriangleMesh
from taxel.cloud.registration import (
    MAX_ITERATIONS,
    Alignment,
    PointTarget,
    align_to_mesh,
    align_to_points,
    check_alignable,
)
from taxel.types import FloatArray

COARSE_POINTS: Final = 400
COARSE_ITERATIONS: Final = 12
"""Approximate number of points and largest number of iterations with which the guesses are compared."""

REFINED_GUESSES: Final = 4
"""Number of best guesses that are refined with all points until convergence."""

MESH_SAMPLES: Final = 2000
"""Number of random points on a mesh from which its centre and axes are computed."""


def compute_guesses(points: FloatArray, target: FloatArray) -> list[FloatArray]:
    """Compute first guesses of an alignment: the identity, and 24 transforms f64[4, 4] that align principal axes.

    points, target: f64[N, 3].
    """
    centre, target_centre = points.mean(axis=0), target.mean(axis=0)
    axes, target_axes = _principal_axes(points - centre), _principal_axes(target - target_centre)
    guesses = [np.eye(4)]
    for order in permutations(range(3)):
        for signs in product((1.0, -1.0), repeat=3):
            # Half of the 48 combinations of order and signs have the determinant 1; the others are reflections.
            rotation = target_axes[:, order] * signs @ axes.T
            if np.linalg.det(rotation) > 0.0:
                guess = np.eye(4)
                guess[:3, :3], guess[:3, 3] = rotation, target_centre - rotation @ centre
                guesses.append(guess)
    return guesses


def align_to_mesh_globally(points: FloatArray, mesh: TriangleMesh, name: str = "cloud") -> Alignment:
    """Align points f64[N, 3] to a mesh without a first guess: the best result from 25 guesses.

    name: of the cloud, for messages. Raises RegistrationError.
    """
    check_alignable(points, name)

    def align(subset: FloatArray, start: FloatArray, max_iterations: int) -> Alignment:
        """Align a part of the points to the mesh from a first guess f64[4, 4]."""
        return align_to_mesh(subset, mesh, start, max_iterations=max_iterations, name=name)

    return _refine_best(points, compute_guesses(points, mesh.sample(MESH_SAMPLES)), align)


def align_to_points_globally(points: FloatArray, target: PointTarget, name: str = "cloud") -> Alignment:
    """Align points f64[N, 3] to the points of a target without a first guess: the best result from 25 guesses.

    name: of the cloud, for messages. Raises RegistrationError.
    """
    check_alignable(points, name)

    def align(subset: FloatArray, start: FloatArray, max_iterations: int) -> Alignment:
        """Align a part of the points to the target from a first guess f64[4, 4]."""
        return align_to_points(subset, target, start, max_iterations=max_iterations, name=name)

    return _refine_best(points, compute_guesses(points, target.points), align)


def _refine_best(
    points: FloatArray, guesses: list[FloatArray], align: Callable[[FloatArray, FloatArray, int], Alignment]
) -> Alignment:
    """Return the best alignment over all guesses.

    Each guess is refined coarsely with a part of the points; the best few are refined with all points. align: function
    of points, first guess and largest number of iterations.
    """
    subset = points[:: max(1, len(points) // COARSE_POINTS)]
    coarse = sorted(
        (align(subset, guess, COARSE_ITERATIONS) for guess in guesses), key=lambda alignment: alignment.rms_m
    )
    refined = (align(points, alignment.transform, MAX_ITERATIONS) for alignment in coarse[:REFINED_GUESSES])
    return min(refined, key=lambda alignment: alignment.rms_m)


def _principal_axes(arms: FloatArray) -> FloatArray:
    """Compute the principal axes of points as columns, the longest first, f64[3, 3].

    arms: f64[N, 3], coordinates relative to the centre.
    """
    return np.linalg.eigh(arms.T @ arms)[1][:, ::-1]
