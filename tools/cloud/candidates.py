"""Libraries for alignment and for distances to a mesh, behind one interface.

An operation that a library does not offer is None. Every library converges as far as its parameters allow, on one
thread.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from taxel.types import FloatArray, IntArray

Align = Callable[[FloatArray, FloatArray], FloatArray]
"""Function of points f64[N, 3] and target points f64[K, 3] that returns the transform f64[4, 4] of the points."""
AlignToSurface = Callable[[FloatArray, FloatArray, IntArray], FloatArray]
"""Function of points, vertices and faces that returns the transform f64[4, 4] of the points."""
Measure = Callable[[FloatArray, FloatArray, IntArray], FloatArray]
"""Function of points f64[N, 3], vertices and faces that returns unsigned distances f64[N]."""

REFERENCE = "reference: SciPy and NumPy"
"""Candidate that computes the distance of every point to every triangle; the others are compared with it."""

MAX_ITERATIONS = 1000
TOLERANCE = 1e-9


@dataclass(frozen=True)
class Operations:
    """Operations that a library offers."""

    align: Align | None = None
    measure: Measure | None = None
    align_to_surface: AlignToSurface | None = None


@dataclass(frozen=True)
class Candidate:
    """A library to be compared.

    name: name in the tables. package: its distribution; "" if taxel needs it anyway. load: imports the library and
    returns its operations.
    """

    name: str
    package: str
    load: Callable[[], Operations]


def _load_taxel() -> Operations:
    """Load the operations of this project's own package taxel.cloud, for the comparison with other libraries."""
    from taxel.cloud.mesh import TriangleMesh
    from taxel.cloud.registration import PointTarget, align_to_mesh, align_to_points

    def align(points: FloatArray, target: FloatArray) -> FloatArray:
        return align_to_points(points, PointTarget(target)).transform

    def measure(points: FloatArray, vertices: FloatArray, faces: IntArray) -> FloatArray:
        return TriangleMesh("mesh", vertices, faces).find_closest(points).distance

    def align_to_surface(points: FloatArray, vertices: FloatArray, faces: IntArray) -> FloatArray:
        return align_to_mesh(points, TriangleMesh("mesh", vertices, faces)).transform

    return Operations(align, measure, align_to_surface)


def _load_reference() -> Operations:
    """Return the operations of the reference, in SciPy and NumPy."""
    return Operations(_align_by_kd_tree, compute_exact_distances)


def _align_by_kd_tree(points: FloatArray, target: FloatArray) -> FloatArray:
    """Align points with target points, both f64[n, 3], by ICP in SciPy and NumPy; return the transform f64[4, 4].

    Algorithm of Besl and McKay: nearest points by a k-d tree, and the best rotation by Kabsch's method.
    """
    from scipy.spatial import cKDTree

    tree, centre = cKDTree(target), points.mean(axis=0)
    transform: FloatArray = np.eye(4)
    previous_cost = np.inf
    for _ in range(MAX_ITERATIONS):
        moved = points @ transform[:3, :3].T + transform[:3, 3]
        distances, nearest = tree.query(moved)
        distance = np.asarray(distances)
        cost = float(distance @ distance)
        if previous_cost - cost < TOLERANCE * cost:
            break
        previous_cost = cost
        partner = target[nearest]
        partner_centre = partner.mean(axis=0)
        u, _, v = np.linalg.svd((points - centre).T @ (partner - partner_centre))
        rotation: FloatArray = (u @ np.diag([1.0, 1.0, float(np.sign(np.linalg.det(u @ v)))]) @ v).T
        transform[:3, :3], transform[:3, 3] = rotation, partner_centre - rotation @ centre
    return transform


def compute_exact_distances(points: FloatArray, vertices: FloatArray, faces: IntArray) -> FloatArray:
    """Compute the distance of every point f64[n, 3] to the nearest triangle, f64[n].

    The distance to a triangle is the height above its plane, or the distance to its nearest edge.
    """
    best = np.full(len(points), np.inf)
    for face in faces:
        a, b, c = vertices[face]
        normal = np.cross(b - a, c - a)
        normal /= np.linalg.norm(normal)
        height = (points - a) @ normal
        is_inside = np.ones(len(points), bool)
        to_edges = np.full(len(points), np.inf)
        for start, end in ((a, b), (b, c), (c, a)):
            along, arm = end - start, points - start
            # The projection of the point is inside the triangle if it is on the inner side of all three edges.
            is_inside &= arm @ np.cross(normal, along) >= 0.0
            share = np.clip(arm @ along / (along @ along), 0.0, 1.0)
            to_edges = np.minimum(to_edges, np.linalg.norm(arm - share[:, None] * along, axis=1))
        best = np.minimum(best, np.where(is_inside, np.abs(height), to_edges))
    return best


def _load_small_gicp() -> Operations:
    """Load the operations of the library small_gicp: alignment only."""
    import small_gicp

    def align(points: FloatArray, target: FloatArray) -> FloatArray:
        """Align `points` with `target`, both f64[n, 3], by the ICP of small_gicp; return the transform f64[4, 4]."""
        cloud = small_gicp.PointCloud(target)
        result = small_gicp.align(
            cloud,
            small_gicp.PointCloud(points),
            small_gicp.KdTree(cloud),
            registration_type="ICP",
            max_correspondence_distance=1e3,
            num_threads=1,
            max_iterations=MAX_ITERATIONS,
            rotation_epsilon=1e-6,
            translation_epsilon=1e-7,
        )
        return np.array(result.T_target_source)

    return Operations(align)


def _load_open3d() -> Operations:
    """Load the operations of the library Open3D: alignment and distances to a mesh."""
    import open3d  # type: ignore[import-not-found,unused-ignore]

    registration = open3d.pipelines.registration

    def build_cloud(points: FloatArray) -> Any:
        return open3d.geometry.PointCloud(open3d.utility.Vector3dVector(points))

    def align(points: FloatArray, target: FloatArray) -> FloatArray:
        """Align `points` with `target`, both f64[n, 3], by the ICP of Open3D; return the transform f64[4, 4]."""
        criteria = registration.ICPConvergenceCriteria(TOLERANCE, TOLERANCE, MAX_ITERATIONS)
        method = registration.TransformationEstimationPointToPoint()
        result = registration.registration_icp(
            build_cloud(points), build_cloud(target), 1e3, np.eye(4), method, criteria
        )
        return np.array(result.transformation)

    def measure(points: FloatArray, vertices: FloatArray, faces: IntArray) -> FloatArray:
        """Measure the distances f64[n] of `points` f64[n, 3] to a triangle mesh, by the ray casting scene of Open3D."""
        scene = open3d.t.geometry.RaycastingScene(nthreads=1)
        scene.add_triangles(vertices.astype(np.float32), faces.astype(np.uint32))
        return np.asarray(scene.compute_distance(points.astype(np.float32), nthreads=1).numpy(), dtype=np.float64)

    return Operations(align, measure)


def _load_trimesh() -> Operations:
    """Load the operations of the library trimesh: alignment and distances to a mesh."""
    import trimesh  # type: ignore[import-not-found,unused-ignore]

    def align(points: FloatArray, target: FloatArray) -> FloatArray:
        """Align `points` with `target`, both f64[n, 3], by the ICP of trimesh; return the transform f64[4, 4]."""
        return np.asarray(
            trimesh.registration.icp(
                points, target, threshold=TOLERANCE, max_iterations=MAX_ITERATIONS, reflection=False, scale=False
            )[0]
        )

    def measure(points: FloatArray, vertices: FloatArray, faces: IntArray) -> FloatArray:
        """Measure the distances f64[n] of `points` f64[n, 3] to a triangle mesh, by trimesh."""
        mesh = trimesh.Trimesh(vertices, faces, process=False)
        return np.asarray(trimesh.proximity.closest_point(mesh, points)[1])

    return Operations(align, measure)


def _load_igl() -> Operations:
    """Load the operations of libigl: distances of points to a triangle mesh."""
    import igl

    def measure(points: FloatArray, vertices: FloatArray, faces: IntArray) -> FloatArray:
        """Measure the distances f64[n] of `points` f64[n, 3] to a triangle mesh, by libigl."""
        return np.asarray(np.sqrt(igl.point_mesh_squared_distance(points, vertices, faces)[0]))

    return Operations(measure=measure)


def _load_point_cloud_utils() -> Operations:
    """Load the operations of point_cloud_utils: distances of points to a triangle mesh."""
    import point_cloud_utils  # type: ignore[import-not-found,unused-ignore]

    def measure(points: FloatArray, vertices: FloatArray, faces: IntArray) -> FloatArray:
        """Measure the distances f64[n] of `points` f64[n, 3] to a triangle mesh, by point_cloud_utils."""
        return np.asarray(point_cloud_utils.closest_points_on_mesh(points, vertices, faces)[0], dtype=np.float64)

    return Operations(measure=measure)


CANDIDATES = (
    Candidate("taxel.cloud", "", _load_taxel),
    Candidate(REFERENCE, "", _load_reference),
    Candidate("small_gicp", "small_gicp", _load_small_gicp),
    Candidate("open3d", "open3d", _load_open3d),
    Candidate("trimesh", "trimesh", _load_trimesh),
    Candidate("libigl", "libigl", _load_igl),
    Candidate("point-cloud-utils", "point-cloud-utils", _load_point_cloud_utils),
)
