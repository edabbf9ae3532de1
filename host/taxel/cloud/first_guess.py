"""Alignments without a first guess: many are tried, the best few are finished.

Each guess puts the cloud's centre on the target's, and its principal axes on the target's, in one of the 24 ways that
keep it from being mirrored. They are tried with few steps on some of the points.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import permutations, product
from typing import Final

import numpy as np

from taxel.cloud.mesh import TriangleMesh
from taxel.cloud.registration import (
    ITERATIONS,
    Alignment,
    PointTarget,
    align_to_mesh,
    align_to_points,
    check_alignable,
)
from taxel.types import FloatArray

TRIAL_POINTS: Final = 400
TRIAL_STEPS: Final = 12
FINISHED: Final = 4
"""Guesses that go on with all points to the end."""

SAMPLES: Final = 2000
"""Points on a mesh, for its centre and axes."""


def principal_guesses(points: FloatArray, target: FloatArray) -> list[FloatArray]:
    """The unmoved cloud, then 24 transforms that lay its principal axes on the target's, each f64[4, 4]."""
    here, there = points.mean(axis=0), target.mean(axis=0)
    own, other = _axes(points - here), _axes(target - there)
    guesses = [np.eye(4)]
    for order in permutations(range(3)):
        for signs in product((1.0, -1.0), repeat=3):
            turn = other[:, order] * signs @ own.T
            if np.linalg.det(turn) > 0.0:
                guess = np.eye(4)
                guess[:3, :3], guess[:3, 3] = turn, there - turn @ here
                guesses.append(guess)
    return guesses


def align_to_mesh_from_anywhere(points: FloatArray, mesh: TriangleMesh, name: str = "cloud") -> Alignment:
    """The best alignment of points f64[N, 3] to a mesh over all guesses. Raises RegistrationError."""
    check_alignable(points, name)

    def align(some: FloatArray, start: FloatArray, iterations: int) -> Alignment:
        return align_to_mesh(some, mesh, start, iterations=iterations, name=name)

    return _best(points, principal_guesses(points, mesh.sample(SAMPLES)), align)


def align_to_points_from_anywhere(points: FloatArray, target: PointTarget, name: str = "cloud") -> Alignment:
    """The best alignment of points f64[N, 3] to the points of a target over all guesses. Raises RegistrationError."""
    check_alignable(points, name)

    def align(some: FloatArray, start: FloatArray, iterations: int) -> Alignment:
        return align_to_points(some, target, start, iterations=iterations, name=name)

    return _best(points, principal_guesses(points, target.points), align)


def _best(
    points: FloatArray, guesses: list[FloatArray], align: Callable[[FloatArray, FloatArray, int], Alignment]
) -> Alignment:
    some = points[:: max(1, len(points) // TRIAL_POINTS)]
    tried = sorted((align(some, guess, TRIAL_STEPS) for guess in guesses), key=lambda one: one.rms_m)
    return min((align(points, one.transform, ITERATIONS) for one in tried[:FINISHED]), key=lambda one: one.rms_m)


def _axes(arms: FloatArray) -> FloatArray:
    """Principal axes as columns, the longest first, f64[3, 3]."""
    return np.linalg.eigh(arms.T @ arms)[1][:, ::-1]
