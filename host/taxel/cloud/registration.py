"""Rigid alignment of a cloud to a mesh or to another cloud: iterative closest points (Besl and McKay 1992).

All points are used (100 % overlap, no sampling), as in the thesis (5.6). The result is a local minimum of the sum of
the squared distances to the nearest points of the target, reached from a first guess by steps that decrease this sum.

The target of an alignment to a mesh is the surface itself (`surface_alignment`). An alignment to a cloud, or to points
on a mesh, uses small_gicp's point-to-point ICP. Both use one thread: the same input gives the same result to the last
bit.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
import small_gicp

from taxel.cloud.contact_cloud import check_points
from taxel.cloud.errors import RegistrationError
from taxel.cloud.mesh import TriangleMesh
from taxel.cloud.surface_alignment import SurfaceAlignment
from taxel.types import FloatArray

MAX_ITERATIONS: Final = 1000
"""Largest number of steps of an alignment, as in the thesis (5.6)."""

MESH_SAMPLES: Final = 20_000
"""Number of random points on a mesh that replace its surface as a target."""

COST_TOLERANCE: Final = 1e-5
"""Relative decrease of the sum of squares below which an alignment to a surface ends. With 1e-8 the RMS of the clouds
of the thesis decreases by 0.04 % more at most, for a cylinder of 64 facets that rotates about its axis."""

ROTATION_TOLERANCE_RAD: Final = 1e-6
TRANSLATION_TOLERANCE_M: Final = 1e-7
"""An alignment between clouds ends after a step that is smaller than both tolerances. They are far below the resolution
of taxels of 3 mm."""

MAX_PAIR_DISTANCE_M: Final = 1e3
"""Largest distance between a point and its nearest target point; larger than any object that a hand grasps."""

LINE_TOLERANCE: Final = 1e-6
"""A cloud is treated as a line if its second largest extent is at most this share of its largest extent."""

QUICK_CHECK_POINTS: Final = 100
"""Number of points of the subset that is checked first."""


@dataclass(frozen=True, eq=False)
class Alignment:
    """Result of an alignment.

    transform: f64[4, 4], maps the cloud to its aligned pose. rms_m: root mean square of all distances in that pose.
    iterations: number of steps. converged: False if the maximum number of steps was reached first.
    """

    transform: FloatArray
    rms_m: float
    iterations: int
    converged: bool


def align_to_mesh(
    points: FloatArray,
    mesh: TriangleMesh,
    start: FloatArray | None = None,
    *,
    max_iterations: int = MAX_ITERATIONS,
    tolerance: float = COST_TOLERANCE,
    name: str = "cloud",
) -> Alignment:
    """Align points f64[N, 3] rigidly to the surface of a mesh by least squares of the distances.

    start: transform f64[4, 4] of the first guess; None: identity. tolerance: relative decrease of the sum of squares
    below which the alignment ends. name: of the cloud, for messages. Raises RegistrationError for fewer than three
    points, for points on a line, and for an alignment that does not converge.
    """
    check_alignable(points, name)
    alignment = SurfaceAlignment.start(points, mesh, _copy_or_identity(start), tolerance)
    iterations = 0
    while iterations < max_iterations and not alignment.is_finished:
        alignment.step()
        iterations += 1
    rms = float(np.sqrt(alignment.cost / len(points)))
    return _check_result(alignment.transform, rms, iterations, alignment.is_finished, name)


class PointTarget:
    """Target points f64[K, 3], prepared once for many alignments.

    Raises RegistrationError for fewer than three points and for points on a line.
    """

    def __init__(self, points: FloatArray, name: str = "target") -> None:
        """Create the target of an alignment from points f64[N, 3], with a search tree. name: for messages."""
        check_alignable(points, name)
        self.points = points
        self.cloud = small_gicp.PointCloud(np.ascontiguousarray(points, dtype=np.float64))
        self.tree = small_gicp.KdTree(self.cloud)

    @classmethod
    def from_mesh(cls, mesh: TriangleMesh, samples: int = MESH_SAMPLES) -> PointTarget:
        """Create the target of an alignment from random points of a mesh's surface. samples: number of points."""
        return cls(mesh.sample(samples), mesh.name)


def align_to_points(
    points: FloatArray,
    target: PointTarget,
    start: FloatArray | None = None,
    *,
    max_iterations: int = MAX_ITERATIONS,
    name: str = "cloud",
) -> Alignment:
    """Align points f64[N, 3] rigidly to the points of a target by iterative closest points.

    start: transform f64[4, 4] of the first guess; None: identity. name: of the cloud, for messages. Raises
    RegistrationError for fewer than three points, for points on a line, and for an alignment that does not converge.
    """
    check_alignable(points, name)
    result = small_gicp.align(
        target.cloud,
        small_gicp.PointCloud(np.ascontiguousarray(points, dtype=np.float64)),
        target.tree,
        init_T_target_source=_copy_or_identity(start),
        registration_type="ICP",
        max_correspondence_distance=MAX_PAIR_DISTANCE_M,
        num_threads=1,
        max_iterations=max_iterations,
        rotation_epsilon=ROTATION_TOLERANCE_RAD,
        translation_epsilon=TRANSLATION_TOLERANCE_M,
    )
    # small_gicp reports half the sum of squares over the points with a target point in reach. Unless the alignment
    # diverged, these are all points.
    pairs = int(result.num_inliers)
    rms = float(np.sqrt(2.0 * result.error / pairs)) if pairs == len(points) else float("nan")
    return _check_result(np.array(result.T_target_source), rms, int(result.iterations), bool(result.converged), name)


def check_alignable(points: FloatArray, name: str) -> None:
    """Raise RegistrationError for fewer than three points or points on a line, CloudError for coordinates not finite.

    points: f64[N, 3]. name: of the cloud, for the message.
    """
    check_points(points, name)
    expected = "three or more that do not lie on one line"
    if len(points) < 3:
        raise RegistrationError(name, "points", expected, str(len(points)), "use a cloud with more points")
    # If a subset does not lie on a line, the whole cloud does not: most clouds need no check of every point.
    if _are_on_a_line(points[:: max(1, len(points) // QUICK_CHECK_POINTS)]) and _are_on_a_line(points):
        raise RegistrationError(name, "points", expected, f"{len(points)} on one line", "use points of a surface")


def _are_on_a_line(points: FloatArray) -> bool:
    """Whether points f64[n, 3] lie on a line, within `LINE_TOLERANCE` of their extent."""
    arms = points - points.mean(axis=0)
    # Extents along the principal axes, in ascending order: points on a line have only the last one.
    extent = np.sqrt(np.maximum(np.linalg.eigvalsh(arms.T @ arms), 0.0))
    return bool(extent[1] <= LINE_TOLERANCE * extent[2])


def _copy_or_identity(start: FloatArray | None) -> FloatArray:
    """Return a copy of the first guess f64[4, 4], or the identity for None."""
    return np.eye(4) if start is None else np.array(start, dtype=np.float64)


def _check_result(transform: FloatArray, rms: float, iterations: int, converged: bool, name: str) -> Alignment:
    """Return the result as an `Alignment` with an exact rotation. Raises RegistrationError for NaN and infinity.

    transform: f64[4, 4]. rms: root mean square of the distances, metres. name: of the cloud, for messages.
    """
    if not (np.isfinite(transform).all() and np.isfinite(rms)):
        expected, remedy = "convergence", "give a better first guess"
        raise RegistrationError(name, "alignment", expected, "divergence", remedy)
    # The product of many small rotations is not exactly a rotation; the nearest rotation replaces it.
    u, _, v = np.linalg.svd(transform[:3, :3])
    transform[:3, :3] = u @ v
    return Alignment(transform, rms, iterations, converged)
