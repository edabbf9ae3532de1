"""Rigid alignment of a cloud to a mesh or to another cloud: iterative closest points (Besl and McKay 1992).

All points take part (100 % overlap, no sampling), as in the thesis (5.6): the result is where the sum of the squared
distances to the nearest points of the target has a minimum, reached from a first guess by steps that lower it.

To a mesh, the target is the surface itself (`surface_steps`). To a cloud, or to points on a mesh, the steps are those
of small_gicp's point-to-point ICP. One thread: the same input gives the same result to the last bit.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
import small_gicp

from taxel.cloud.contact_cloud import check_points
from taxel.cloud.errors import RegistrationError
from taxel.cloud.mesh import TriangleMesh
from taxel.cloud.surface_steps import SurfaceSteps
from taxel.types import FloatArray

ITERATIONS: Final = 1000
"""At most, as in the thesis (5.6)."""

SAMPLES: Final = 20_000
"""Points on a mesh that is sampled."""

STILL: Final = 1e-5
"""Share of the sum of squares; a step to a surface that gains less is the last. Going on to 1e-8 lowers the RMS of the
thesis's clouds by at most 0.04 %, where a cylinder of 64 facets may turn."""

STEP_TURN_RAD: Final = 1e-6
STEP_SHIFT_M: Final = 1e-7
"""Between clouds: a step that turns and moves less is the last; far below what a taxel of 3 mm can show."""

FARTHEST_M: Final = 1e3
"""Points farther from the target than this have no partner there: none, for anything that a hand holds."""

ON_A_LINE: Final = 1e-6
"""Share of a cloud's largest extent; clouds thinner than this in two directions lie on a line."""

LOOK: Final = 100
"""Points that are looked at first."""


@dataclass(frozen=True, eq=False)
class Alignment:
    """How a cloud was moved.

    transform: f64[4, 4], from where the cloud was to where it fits. rms_m: root of the mean square of all distances
    there. iterations: steps taken. converged: False where they were not enough.
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
    iterations: int = ITERATIONS,
    still: float = STILL,
    name: str = "cloud",
) -> Alignment:
    """Align points f64[N, 3] to the surface of a mesh, from the transform `start` (None: where they are).

    iterations, still: the last step is the one after so many, or that gains less than this share of the sum of squares.
    Raises RegistrationError for fewer than three points, points on a line, or no result.
    """
    check_alignable(points, name)
    steps = SurfaceSteps.begin(points, mesh, _first(start), still)
    taken = 0
    while taken < iterations and not steps.done:
        steps.step()
        taken += 1
    return _checked(steps.transform, float(np.sqrt(steps.cost / len(points))), taken, steps.done, name)


class PointTarget:
    """Points that clouds are aligned to, made ready once for many alignments. points: f64[K, 3].

    Raises RegistrationError for fewer than three points, or points on a line.
    """

    def __init__(self, points: FloatArray, name: str = "target") -> None:
        check_alignable(points, name)
        self.points = points
        self.cloud = small_gicp.PointCloud(np.ascontiguousarray(points, dtype=np.float64))
        self.tree = small_gicp.KdTree(self.cloud)

    @classmethod
    def on_mesh(cls, mesh: TriangleMesh, samples: int = SAMPLES) -> PointTarget:
        """Points spread over a mesh."""
        return cls(mesh.sample(samples), mesh.name)


def align_to_points(
    points: FloatArray,
    target: PointTarget,
    start: FloatArray | None = None,
    *,
    iterations: int = ITERATIONS,
    name: str = "cloud",
) -> Alignment:
    """Align points f64[N, 3] to the points of a target; otherwise as `align_to_mesh`."""
    check_alignable(points, name)
    found = small_gicp.align(
        target.cloud,
        small_gicp.PointCloud(np.ascontiguousarray(points, dtype=np.float64)),
        target.tree,
        init_T_target_source=_first(start),
        registration_type="ICP",
        max_correspondence_distance=FARTHEST_M,
        num_threads=1,
        max_iterations=iterations,
        rotation_epsilon=STEP_TURN_RAD,
        translation_epsilon=STEP_SHIFT_M,
    )
    # Its error is half the sum of squares, over the points that have a partner: all, if none has run away.
    paired = int(found.num_inliers)
    rms = float(np.sqrt(2.0 * found.error / paired)) if paired == len(points) else float("nan")
    return _checked(np.array(found.T_target_source), rms, int(found.iterations), bool(found.converged), name)


def check_alignable(points: FloatArray, name: str) -> None:
    """Refuse points that fix no turn: fewer than three, or on a line. Raises RegistrationError, CloudError for NaN."""
    check_points(points, name)
    expected = "three or more that do not lie on one line"
    if len(points) < 3:
        raise RegistrationError(name, "points", expected, str(len(points)), "use a cloud with more points")
    # Where some of the points lie on no line, all of them do not: most clouds need no look at every point.
    if _on_a_line(points[:: max(1, len(points) // LOOK)]) and _on_a_line(points):
        raise RegistrationError(name, "points", expected, f"{len(points)} on one line", "use points of a surface")


def _on_a_line(points: FloatArray) -> bool:
    arms = points - points.mean(axis=0)
    extent = np.sqrt(np.maximum(np.linalg.eigvalsh(arms.T @ arms), 0.0))
    return bool(extent[1] <= ON_A_LINE * extent[2])


def _first(start: FloatArray | None) -> FloatArray:
    return np.eye(4) if start is None else np.array(start, dtype=np.float64)


def _checked(transform: FloatArray, rms: float, iterations: int, converged: bool, name: str) -> Alignment:
    if not (np.isfinite(transform).all() and np.isfinite(rms)):
        expected, remedy = "one that converges", "give a better first guess"
        raise RegistrationError(name, "alignment", expected, "one that runs away", remedy)
    # Many small turns in a row leave the rotation a little off; the nearest rotation is taken.
    u, _, v = np.linalg.svd(transform[:3, :3])
    transform[:3, :3] = u @ v
    return Alignment(transform, rms, iterations, converged)
