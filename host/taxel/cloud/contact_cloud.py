"""A cloud of contact points, with the grasp and the taxel of each point."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np
import numpy.typing as npt

from taxel.cloud.errors import CloudError
from taxel.hand.transforms import apply
from taxel.types import BoolArray, FloatArray, IntArray


def _no_points() -> FloatArray:
    """Make an empty array of points, f64[0, 3]."""
    return np.empty((0, 3))


def _no_index() -> IntArray:
    """Make an empty array of row numbers, i64[0]."""
    return np.empty(0, np.int64)


@dataclass(frozen=True, eq=False)
class ContactCloud:
    """N contact points, metres, of G grasps in A approaches.

    Attributes:
        name: name in messages, for example a file name.
        points: f64[N, 3]; in a cloud of a dataset, taxel centres in the nominal frame of the object.
        counts: f64[N], signal (baseline minus raw count), mean over hold; NaN where unknown.
        grasp: i64[N], row in `grasps`.
        taxel: i64[N], row in the taxel table of the dataset; -1 where unknown.
        grasps: ids of the grasps.
        grasp_approach: i64[G], row in `approaches`.
        approaches: names of the approaches.
        inactive_points: f64[M, 3], positions of taxels that were read and were not active; empty if unknown.
        inactive_grasp: i64[M], row in `grasps` of each inactive point.

    Raises CloudError for arrays of inconsistent shapes and for points that are not finite.
    """

    name: str
    points: FloatArray
    counts: FloatArray
    grasp: IntArray
    taxel: IntArray
    grasps: tuple[str, ...]
    grasp_approach: IntArray
    approaches: tuple[str, ...]
    inactive_points: FloatArray = field(default_factory=_no_points)
    inactive_grasp: IntArray = field(default_factory=_no_index)

    def __post_init__(self) -> None:
        """Check the shapes and row numbers of the arrays of a contact cloud. Raises CloudError."""
        check_points(self.points, self.name)
        check_points(self.inactive_points, self.name, "inactive points")
        n = len(self.points)
        for name, array in (("counts", self.counts), ("grasp", self.grasp), ("taxel", self.taxel)):
            if array.shape != (n,):
                raise CloudError(
                    self.name, name, f"one value for each of {n} points", f"shape {array.shape}", "correct it"
                )
        grasps, approaches = len(self.grasps), len(self.approaches)
        rows = (
            ("grasp", self.grasp, grasps, "grasps"),
            ("grasp of inactive points", self.inactive_grasp, grasps, "grasps"),
            ("grasp_approach", self.grasp_approach, approaches, "approaches"),
        )
        for name, index, count, table in rows:
            if len(index) and (index.min() < 0 or index.max() >= count):
                found = f"{index.min()} to {index.max()}"
                raise CloudError(self.name, name, f"rows of the {count} {table}", found, "correct it")

    def __len__(self) -> int:
        """Return the number of active points."""
        return len(self.points)

    @property
    def approach(self) -> IntArray:
        """Approach of each point, as a row in `approaches`, i64[N]."""
        return np.asarray(self.grasp_approach[self.grasp])

    @classmethod
    def from_points(
        cls, points: npt.ArrayLike, counts: npt.ArrayLike | None = None, name: str = "cloud"
    ) -> ContactCloud:
        """Create a contact cloud from points without known grasps: all belong to one unnamed grasp and approach.

        points: f64[N, 3], metres. counts: signal of each point f64[N]; None: unknown.
        """
        positions = np.ascontiguousarray(points, dtype=np.float64)
        n = len(positions)
        values = np.full(n, np.nan) if counts is None else np.asarray(counts, dtype=np.float64)
        return cls(name, positions, values, np.zeros(n, np.int64), np.full(n, -1), ("",), np.zeros(1, np.int64), ("",))

    def select(self, selection: BoolArray | IntArray) -> ContactCloud:
        """Return the contact cloud with some of its points. selection: bool[N], or rows i64[k]."""
        return replace(
            self,
            points=self.points[selection],
            counts=self.counts[selection],
            grasp=self.grasp[selection],
            taxel=self.taxel[selection],
        )

    def select_approach(self, name: str) -> ContactCloud:
        """Return the active and inactive points of the grasps of one approach.

        Raises CloudError for an unknown name.
        """
        if name not in self.approaches:
            names = ", ".join(self.approaches)
            raise CloudError(self.name, "approach", f"one of {names}", name, "correct it")
        row = self.approaches.index(name)
        inactive = self.grasp_approach[self.inactive_grasp] == row
        cloud = replace(
            self,
            name=f"{self.name}, {name}",
            inactive_points=self.inactive_points[inactive],
            inactive_grasp=self.inactive_grasp[inactive],
        )
        return cloud.select(self.approach == row)

    def transform(self, matrix: npt.ArrayLike) -> ContactCloud:
        """Return the contact cloud mapped by a rigid transform, f64[4, 4]."""
        return replace(self, points=apply(matrix, self.points), inactive_points=apply(matrix, self.inactive_points))


MAX_COORDINATE_M: Final = 1e6
"""Largest accepted coordinate, metres: squares and volumes of larger coordinates lose their precision or overflow."""


def has_usable_coordinates(points: FloatArray) -> BoolArray:
    """Test which points f64[N, 3] have finite coordinates up to MAX_COORDINATE_M, bool[N]."""
    return np.asarray((np.abs(points) <= MAX_COORDINATE_M).all(axis=1))


def check_points(points: FloatArray, name: str, field_name: str = "points") -> None:
    """Raise CloudError unless an array is f64[N, 3] with finite coordinates up to MAX_COORDINATE_M.

    name, field_name: names of the cloud and of the array in the message.
    """
    if points.ndim != 2 or points.shape[1] != 3:
        raise CloudError(name, field_name, "shape [N, 3]", str(list(points.shape)), "correct it")
    wrong = ~has_usable_coordinates(points)
    if wrong.any():
        raise CloudError(name, field_name, "finite coordinates", describe_unusable(points[wrong]), "remove them")


def describe_unusable(points: FloatArray) -> str:
    """Describe points with unusable coordinates for an error message: number and reason.

    points: f64[N, 3], all of them unusable.
    """
    if np.isfinite(points).all():
        return f"{len(points)} beyond {MAX_COORDINATE_M:g} m"
    return f"{int((~np.isfinite(points)).any(axis=1).sum())} with NaN or infinity"


def require_points(points: FloatArray, name: str, minimum: int = 1, reason: str = "") -> None:
    """Raise CloudError for a cloud with fewer than `minimum` points.

    name: name of the cloud in the message. reason: text that follows the minimum in the message, for example
    ``, the N of the outlier filter``.
    """
    if len(points) < minimum:
        found = f"{len(points)}" if len(points) else "none: the cloud is empty"
        raise CloudError(
            name, "points", f"{minimum} or more{reason}", found, "lower the threshold, or use another cloud"
        )
