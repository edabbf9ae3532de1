"""Interface of convex solids with exact geometry (no mesh approximation).

Lengths are metres, in the object frame: origin in the centre of the bottom face, z up. All methods are vectorised over
leading axes.
"""

from typing import Protocol

import numpy as np
import numpy.typing as npt

from taxel.errors import TaxelError
from taxel.types import FloatArray, Int32Array


class ShapeError(TaxelError, ValueError):
    """Values that do not bound a solid. Attributes: shape, expected, found."""

    def __init__(self, shape: str, expected: str, found: str) -> None:
        """Create the error of a solid with wrong sizes. shape: its kind. expected, found: description of the sizes."""
        super().__init__(shape, expected, found)
        self.shape = shape
        self.expected = expected
        self.found = found

    def _format_message(self) -> str:
        """Format the error as one line with the kind of shape, expected and found values, and the remedy."""
        return (
            f"{self.shape}: expected {self.expected}, found {self.found}; correct the sizes or the mesh of the object"
        )


class Shape(Protocol):
    """Protocol of a convex solid with the distances and rays that contact models need."""

    @property
    def height(self) -> float:
        """Extent of the solid along z, metres."""
        ...

    @property
    def bounds(self) -> FloatArray:
        """Smallest and largest coordinates of the solid, f64[2, 3], metres."""
        ...

    def mesh(self, resolution: int = 64) -> tuple[FloatArray, Int32Array]:
        """Triangulate the solid's surface: vertices f64[v, 3] and triangles i32[f, 3] with outward orientation.

        resolution: number of vertices on a circle.
        """
        ...

    def ray_separation(self, points: npt.ArrayLike, directions: npt.ArrayLike) -> FloatArray:
        """Compute the distance from each point to the solid along a direction, f64[...].

        points: f64[..., 3]. directions: unit vectors f64[..., 3]; both broadcast. The result is the signed distance
        from the point to the entry point of the line: negative if the point is inside the solid, +inf if the line
        misses the solid or the solid is entirely behind the point.
        """
        ...

    def ray_entry(self, points: npt.ArrayLike, directions: npt.ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Compute where rays enter the solid: distance f64[...], metres, and outward unit normal f64[..., 3].

        points, directions: f64[..., 3]. The distance is that of `ray_separation`. A miss has the distance +inf and the
        normal 0.
        """
        ...

    def view_faces(self, tops: FloatArray, axes: FloatArray, min_slope: float) -> tuple[FloatArray, FloatArray]:
        """Compute how deep m columns are below the k faces: depths f64[m, k], metres, and outward normals f64[m, k, 3].

        The columns are those of a soft layer. tops: upper ends of the columns f64[m, 3]. axes: their outward unit
        directions f64[m, 3]. The depth is the distance from the top to the plane of the face, measured against the
        axis; below 0 if the top is outside. The smallest depth is the indentation. A face whose inward normal has a
        smaller cosine with the axis than `min_slope` is treated as if it had this cosine, so that a column that enters
        the solid sideways is loaded gradually. A curved surface is replaced by its tangent plane where the axis meets
        it.
        """
        ...

    def signed_distance(self, points: npt.ArrayLike) -> FloatArray:
        """Compute the Euclidean distance of points f64[..., 3] to the solid's surface, f64[...]; negative inside."""
        ...

    def distance_bound(self, points: npt.ArrayLike) -> FloatArray:
        """Compute a lower bound of `signed_distance` for points f64[..., 3], f64[...]; faster."""
        ...


def check_sizes(shape: str, **sizes: float) -> None:
    """Raise ShapeError for a size that is not finite and above 0. shape: kind of solid. sizes: metres by name."""
    for name, value in sizes.items():
        if not (np.isfinite(value) and value > 0):
            raise ShapeError(shape, f"a {name} above 0 metres", str(value))


def as_points(points: npt.ArrayLike) -> FloatArray:
    """Convert points to an array f64[..., 3]. Raises ValueError for another last axis."""
    array = np.asarray(points, dtype=np.float64)
    if array.shape[-1:] != (3,):
        raise ValueError(f"points: expected 3 numbers in the last axis, found shape {array.shape}")
    return array


def make_read_only(array: FloatArray) -> FloatArray:
    """Set the array read-only and return it."""
    array.setflags(write=False)
    return array
