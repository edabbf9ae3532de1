"""A cloud of contact points, and which grasp and taxel each came from."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np
import numpy.typing as npt

from taxel.cloud.errors import CloudError
from taxel.hand.transforms import apply
from taxel.types import BoolArray, FloatArray, IntArray


def _no_points() -> FloatArray:
    return np.empty((0, 3))


def _no_index() -> IntArray:
    return np.empty(0, np.int64)


@dataclass(frozen=True, eq=False)
class ContactCloud:
    """N contact points, metres, of G grasps in A approaches.

    Attributes:
        name: for messages, such as a file.
        points: f64[N, 3]. Of a dataset: taxel centres in the frame of the object as it was placed.
        counts: f64[N], signal (baseline minus raw count), mean over hold; NaN where unknown.
        grasp: i64[N], row in `grasps`. taxel: i64[N], row in the dataset's taxel table; -1 where unknown.
        grasps: ids. grasp_approach: i64[G], row in `approaches`. approaches: names.
        quiet: f64[M, 3], the taxels that were read and not active; quiet_grasp: i64[M]. Empty where unknown.

    Raises CloudError for arrays that do not fit together, or points that are not finite.
    """

    name: str
    points: FloatArray
    counts: FloatArray
    grasp: IntArray
    taxel: IntArray
    grasps: tuple[str, ...]
    grasp_approach: IntArray
    approaches: tuple[str, ...]
    quiet: FloatArray = field(default_factory=_no_points)
    quiet_grasp: IntArray = field(default_factory=_no_index)

    def __post_init__(self) -> None:
        check_points(self.points, self.name)
        check_points(self.quiet, self.name, "quiet")
        n = len(self.points)
        for name, array in (("counts", self.counts), ("grasp", self.grasp), ("taxel", self.taxel)):
            if array.shape != (n,):
                raise CloudError(self.name, name, f"one for each of {n} points", f"shape {array.shape}", "correct it")
        grasps, approaches = len(self.grasps), len(self.approaches)
        rows = (
            ("grasp", self.grasp, grasps, "grasps"),
            ("quiet_grasp", self.quiet_grasp, grasps, "grasps"),
            ("grasp_approach", self.grasp_approach, approaches, "approaches"),
        )
        for name, index, count, table in rows:
            if len(index) and (index.min() < 0 or index.max() >= count):
                found = f"{index.min()} to {index.max()}"
                raise CloudError(self.name, name, f"rows of the {count} {table}", found, "correct it")

    def __len__(self) -> int:
        return len(self.points)

    @property
    def approach(self) -> IntArray:
        """i64[N], row in `approaches` of each point."""
        return np.asarray(self.grasp_approach[self.grasp])

    @classmethod
    def of_points(cls, points: npt.ArrayLike, counts: npt.ArrayLike | None = None, name: str = "cloud") -> ContactCloud:
        """A cloud of which nothing else is known: one grasp, one approach. points: f64[N, 3]; counts: f64[N]."""
        places = np.ascontiguousarray(points, dtype=np.float64)
        n = len(places)
        values = np.full(n, np.nan) if counts is None else np.asarray(counts, dtype=np.float64)
        return cls(name, places, values, np.zeros(n, np.int64), np.full(n, -1), ("",), np.zeros(1, np.int64), ("",))

    def take(self, chosen: BoolArray | IntArray) -> ContactCloud:
        """The same cloud with some of its points. chosen: bool[N] or rows."""
        return replace(
            self,
            points=self.points[chosen],
            counts=self.counts[chosen],
            grasp=self.grasp[chosen],
            taxel=self.taxel[chosen],
        )

    def of_approach(self, name: str) -> ContactCloud:
        """What the grasps of one approach told. Raises CloudError for an unknown approach."""
        if name not in self.approaches:
            known = ", ".join(self.approaches)
            raise CloudError(self.name, "approach", f"one of {known}", name, "correct it")
        row = self.approaches.index(name)
        quiet = self.grasp_approach[self.quiet_grasp] == row
        part = replace(self, quiet=self.quiet[quiet], quiet_grasp=self.quiet_grasp[quiet], name=f"{self.name}, {name}")
        return part.take(self.approach == row)

    def moved(self, transform: npt.ArrayLike) -> ContactCloud:
        """The cloud mapped by a rigid transform, f64[4, 4]."""
        return replace(self, points=apply(transform, self.points), quiet=apply(transform, self.quiet))


LARGEST_M: Final = 1e6
"""Largest coordinate: squares and volumes of larger ones lose all meaning, or overflow."""


def usable(points: FloatArray) -> BoolArray:
    """Which points have coordinates that can be reckoned with, bool[N]. points: f64[N, 3]."""
    return np.asarray((np.abs(points) <= LARGEST_M).all(axis=1))


def check_points(points: FloatArray, name: str, what: str = "points") -> None:
    """Refuse an array that is not f64[N, 3] of finite numbers, none above LARGEST_M."""
    if points.ndim != 2 or points.shape[1] != 3:
        raise CloudError(name, what, "shape [N, 3]", str(list(points.shape)), "correct it")
    wrong = ~usable(points)
    if wrong.any():
        raise CloudError(name, what, "finite coordinates", unusable(points[wrong]), "remove them")


def unusable(points: FloatArray) -> str:
    """What is wrong with points that cannot be used."""
    if np.isfinite(points).all():
        return f"{len(points)} beyond {LARGEST_M:g} m"
    return f"{int((~np.isfinite(points)).any(axis=1).sum())} with NaN or infinity"


def require_points(points: FloatArray, name: str, least: int = 1, why: str = "") -> None:
    """Refuse a cloud with too few points. why: such as ``, N of the filter``."""
    if len(points) < least:
        found = f"{len(points)}" if len(points) else "none: the cloud is empty"
        raise CloudError(name, "points", f"{least} or more{why}", found, "lower the threshold, or use another cloud")
