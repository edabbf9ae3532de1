"""What a convex solid is to those who press against it; its methods are exact, never those of a mesh.

Lengths are metres, in the object's own frame: origin in the middle of the bottom face, z up. All methods take any
leading axes and are vectorised over them.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np
import numpy.typing as npt

from taxel.errors import TaxelError
from taxel.types import FloatArray, Int32Array


class ShapeError(TaxelError, ValueError):
    """Numbers that bound no solid. Attributes: shape, expected, found."""

    def __init__(self, shape: str, expected: str, found: str) -> None:
        super().__init__(shape, expected, found)
        self.shape = shape
        self.expected = expected
        self.found = found

    def __str__(self) -> str:
        return f"{self.shape}: expected {self.expected}, found {self.found}; correct the object's sizes or its mesh"


class Shape(Protocol):
    """A convex solid."""

    @property
    def height(self) -> float:
        """Extent along z, metres."""
        ...

    @property
    def bounds(self) -> FloatArray:
        """Smallest and largest coordinates, f64[2, 3]."""
        ...

    def mesh(self, resolution: int = 64) -> tuple[FloatArray, Int32Array]:
        """Vertices f64[v, 3] and triangles i32[f, 3], wound so that normals point outward."""
        ...

    def ray_separation(self, points: npt.ArrayLike, directions: npt.ArrayLike) -> FloatArray:
        """How far each point is from the solid along a direction, f64[...].

        points: f64[..., 3]. directions: unit vectors f64[..., 3]; the two broadcast. The result is the signed distance
        from the point to where the line enters the solid: negative where the point is inside (it entered behind the
        point), +inf where the line misses or the solid lies wholly behind the point.
        """
        ...

    def ray_entry(self, points: npt.ArrayLike, directions: npt.ArrayLike) -> tuple[FloatArray, FloatArray]:
        """`ray_separation` f64[...], and the outward unit normal f64[..., 3] where the line enters; 0 for a miss."""
        ...

    def signed_distance(self, points: npt.ArrayLike) -> FloatArray:
        """Euclidean distance of points f64[..., 3] to the surface, f64[...]; negative inside."""
        ...

    def distance_bound(self, points: npt.ArrayLike) -> FloatArray:
        """What `signed_distance` is at least, f64[...], quickly."""
        ...


def check_sizes(shape: str, **sizes: float) -> None:
    """Raises ShapeError for a size that is not above 0."""
    for name, value in sizes.items():
        if not (np.isfinite(value) and value > 0):
            raise ShapeError(shape, f"a {name} above 0 metres", str(value))


def as_points(points: npt.ArrayLike) -> FloatArray:
    """Points as f64[..., 3]; raises ValueError for another last axis."""
    array = np.asarray(points, dtype=np.float64)
    if array.shape[-1:] != (3,):
        raise ValueError(f"points: expected 3 numbers in the last axis, found shape {array.shape}")
    return array


def read_only(array: FloatArray) -> FloatArray:
    """The same array, not to be written to any more."""
    array.setflags(write=False)
    return array
