"""The libraries that were compared, each behind the same questions: align to points or a surface, measure to a mesh.

A question that a library does not answer is None. Convergence is asked for as tightly as each allows, one thread each.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from taxel.types import FloatArray, IntArray

Align = Callable[[FloatArray, FloatArray], FloatArray]
"""Points f64[N, 3] and target points f64[K, 3] to the transform f64[4, 4] that lays the first on the second."""
Measure = Callable[[FloatArray, FloatArray, IntArray], FloatArray]
"""Points f64[N, 3], vertices and faces to unsigned distances f64[N]; or to the transform f64[4, 4] onto the surface."""

REFERENCE = "own: SciPy and NumPy"
"""Its distances are of every point to every triangle: what the others are judged by."""

ITERATIONS = 1000
STILL = 1e-9


@dataclass(frozen=True)
class Answers:
    """What a library can do."""

    align: Align | None = None
    measure: Measure | None = None
    align_to_surface: Measure | None = None


@dataclass(frozen=True)
class Candidate:
    """load: imports the library, and gives what it can do. package: its distribution; "" for what taxel has anyway."""

    name: str
    package: str
    load: Callable[[], Answers]


def _taxel() -> Answers:
    from taxel.cloud.mesh import TriangleMesh
    from taxel.cloud.registration import PointTarget, align_to_mesh, align_to_points

    def align(points: FloatArray, target: FloatArray) -> FloatArray:
        return align_to_points(points, PointTarget(target)).transform

    def measure(points: FloatArray, vertices: FloatArray, faces: IntArray) -> FloatArray:
        return TriangleMesh("mesh", vertices, faces).closest(points).distance

    def align_to_surface(points: FloatArray, vertices: FloatArray, faces: IntArray) -> FloatArray:
        return align_to_mesh(points, TriangleMesh("mesh", vertices, faces)).transform

    return Answers(align, measure, align_to_surface)


def _own() -> Answers:
    return Answers(_own_align, exact_distances)


def _own_align(points: FloatArray, target: FloatArray) -> FloatArray:
    """Besl and McKay's loop: a KD-tree's nearest points, and Kabsch's fit to them."""
    from scipy.spatial import cKDTree

    tree, centre = cKDTree(target), points.mean(axis=0)
    transform: FloatArray = np.eye(4)
    last = np.inf
    for _ in range(ITERATIONS):
        moved = points @ transform[:3, :3].T + transform[:3, 3]
        found, nearest = tree.query(moved)
        distance = np.asarray(found)
        cost = float(distance @ distance)
        if last - cost < STILL * cost:
            break
        last = cost
        partner = target[nearest]
        middle = partner.mean(axis=0)
        u, _, v = np.linalg.svd((points - centre).T @ (partner - middle))
        turn: FloatArray = (u @ np.diag([1.0, 1.0, float(np.sign(np.linalg.det(u @ v)))]) @ v).T
        transform[:3, :3], transform[:3, 3] = turn, middle - turn @ centre
    return transform


def exact_distances(points: FloatArray, vertices: FloatArray, faces: IntArray) -> FloatArray:
    """Every point against every triangle, vectorised: the nearest of the plane's foot and the three edges."""
    best = np.full(len(points), np.inf)
    for face in faces:
        a, b, c = vertices[face]
        normal = np.cross(b - a, c - a)
        normal /= np.linalg.norm(normal)
        height = (points - a) @ normal
        inside = np.ones(len(points), bool)
        edges = np.full(len(points), np.inf)
        for start, end in ((a, b), (b, c), (c, a)):
            along, arm = end - start, points - start
            inside &= arm @ np.cross(normal, along) >= 0.0
            part = np.clip(arm @ along / (along @ along), 0.0, 1.0)
            edges = np.minimum(edges, np.linalg.norm(arm - part[:, None] * along, axis=1))
        best = np.minimum(best, np.where(inside, np.abs(height), edges))
    return best


def _small_gicp() -> Answers:
    import small_gicp

    def align(points: FloatArray, target: FloatArray) -> FloatArray:
        cloud = small_gicp.PointCloud(target)
        found = small_gicp.align(
            cloud,
            small_gicp.PointCloud(points),
            small_gicp.KdTree(cloud),
            registration_type="ICP",
            max_correspondence_distance=1e3,
            num_threads=1,
            max_iterations=ITERATIONS,
            rotation_epsilon=1e-6,
            translation_epsilon=1e-7,
        )
        return np.array(found.T_target_source)

    return Answers(align)


def _open3d() -> Answers:
    import open3d  # type: ignore[import-not-found,unused-ignore]

    registration = open3d.pipelines.registration

    def cloud_of(points: FloatArray) -> Any:
        return open3d.geometry.PointCloud(open3d.utility.Vector3dVector(points))

    def align(points: FloatArray, target: FloatArray) -> FloatArray:
        criteria = registration.ICPConvergenceCriteria(STILL, STILL, ITERATIONS)
        plain = registration.TransformationEstimationPointToPoint()
        found = registration.registration_icp(cloud_of(points), cloud_of(target), 1e3, np.eye(4), plain, criteria)
        return np.array(found.transformation)

    def measure(points: FloatArray, vertices: FloatArray, faces: IntArray) -> FloatArray:
        scene = open3d.t.geometry.RaycastingScene(nthreads=1)
        scene.add_triangles(vertices.astype(np.float32), faces.astype(np.uint32))
        return np.asarray(scene.compute_distance(points.astype(np.float32), nthreads=1).numpy(), dtype=np.float64)

    return Answers(align, measure)


def _trimesh() -> Answers:
    import trimesh  # type: ignore[import-not-found,unused-ignore]

    def align(points: FloatArray, target: FloatArray) -> FloatArray:
        return np.asarray(
            trimesh.registration.icp(
                points, target, threshold=STILL, max_iterations=ITERATIONS, reflection=False, scale=False
            )[0]
        )

    def measure(points: FloatArray, vertices: FloatArray, faces: IntArray) -> FloatArray:
        mesh = trimesh.Trimesh(vertices, faces, process=False)
        return np.asarray(trimesh.proximity.closest_point(mesh, points)[1])

    return Answers(align, measure)


def _igl() -> Answers:
    import igl

    def measure(points: FloatArray, vertices: FloatArray, faces: IntArray) -> FloatArray:
        return np.asarray(np.sqrt(igl.point_mesh_squared_distance(points, vertices, faces)[0]))

    return Answers(measure=measure)


def _point_cloud_utils() -> Answers:
    import point_cloud_utils  # type: ignore[import-not-found,unused-ignore]

    def measure(points: FloatArray, vertices: FloatArray, faces: IntArray) -> FloatArray:
        return np.asarray(point_cloud_utils.closest_points_on_mesh(points, vertices, faces)[0], dtype=np.float64)

    return Answers(measure=measure)


CANDIDATES = (
    Candidate("taxel.cloud", "", _taxel),
    Candidate(REFERENCE, "", _own),
    Candidate("small_gicp", "small_gicp", _small_gicp),
    Candidate("open3d", "open3d", _open3d),
    Candidate("trimesh", "trimesh", _trimesh),
    Candidate("libigl", "libigl", _igl),
    Candidate("point-cloud-utils", "point-cloud-utils", _point_cloud_utils),
)
