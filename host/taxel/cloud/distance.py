"""Unsigned distances from the points of a cloud to a mesh or to another cloud, and their statistics."""

from __future__ import annotations

from dataclasses import asdict, dataclass

import numpy as np
from scipy.spatial import cKDTree

from taxel.cloud.contact_cloud import check_points, require_points
from taxel.cloud.mesh import TriangleMesh
from taxel.types import FloatArray


@dataclass(frozen=True)
class DistanceStats:
    """Statistics of distances, metres: mean, population standard deviation, maximum, root mean square."""

    points: int
    mean_m: float
    std_m: float
    max_m: float
    rms_m: float

    @classmethod
    def from_distances(cls, distances: FloatArray) -> DistanceStats:
        """Compute mean, standard deviation, maximum and RMS of one or more unsigned distances, f64[N] metres."""
        return cls(
            len(distances),
            float(distances.mean()),
            float(distances.std()),
            float(distances.max()),
            float(np.sqrt(np.mean(distances**2))),
        )

    def to_json(self) -> dict[str, float]:
        """Return the distance statistics as a dictionary of numbers."""
        return asdict(self)


def compute_distances_to_mesh(points: FloatArray, mesh: TriangleMesh, name: str = "cloud") -> FloatArray:
    """Compute the exact distance of each point f64[N, 3] to the surface of a mesh, f64[N], metres.

    name: of the cloud, for messages. Raises CloudError for points that are not finite and for an empty cloud.
    """
    _check(points, name)
    return mesh.find_closest(points).distance


def compute_distances_to_cloud(
    points: FloatArray, target: FloatArray, name: str = "cloud", target_name: str = "target"
) -> FloatArray:
    """Compute the distance of each point f64[N, 3] to the nearest point of a target f64[K, 3], f64[N], metres.

    name, target_name: names of the two clouds in messages. Raises CloudError for points that are not finite and for an
    empty cloud.
    """
    _check(points, name)
    _check(target, target_name)
    return np.asarray(cKDTree(target).query(points)[0])


def _check(points: FloatArray, name: str) -> None:
    """Raise CloudError for points that are not f64[N, 3] of finite coordinates, and for an empty cloud."""
    check_points(points, name)
    require_points(points, name)
