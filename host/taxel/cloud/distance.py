"""Unsigned distances from a cloud's points to a mesh or to another cloud, and what they add up to."""

from __future__ import annotations

from dataclasses import asdict, dataclass

import numpy as np
from scipy.spatial import cKDTree

from taxel.cloud.contact_cloud import check_points, require_points
from taxel.cloud.mesh import TriangleMesh
from taxel.types import FloatArray


@dataclass(frozen=True)
class DistanceStats:
    """Of N distances, metres: mean, standard deviation (of the population), largest, root of the mean square."""

    points: int
    mean_m: float
    std_m: float
    max_m: float
    rms_m: float

    @classmethod
    def of(cls, distances: FloatArray) -> DistanceStats:
        """distances: f64[N], one or more, unsigned."""
        return cls(
            len(distances),
            float(distances.mean()),
            float(distances.std()),
            float(distances.max()),
            float(np.sqrt(np.mean(distances**2))),
        )

    def to_json(self) -> dict[str, float]:
        """As plain numbers."""
        return asdict(self)


def distances_to_mesh(points: FloatArray, mesh: TriangleMesh, name: str = "cloud") -> FloatArray:
    """Of each point to the mesh's surface, exact, f64[N]. Raises CloudError for points that are not finite, or none."""
    _check(points, name)
    return mesh.closest(points).distance


def distances_to_cloud(
    points: FloatArray, target: FloatArray, name: str = "cloud", target_name: str = "target"
) -> FloatArray:
    """Of each point to the nearest point of another cloud, f64[N]. Raises CloudError as `distances_to_mesh`."""
    _check(points, name)
    _check(target, target_name)
    return np.asarray(cKDTree(target).query(points)[0])


def _check(points: FloatArray, name: str) -> None:
    check_points(points, name)
    require_points(points, name)
