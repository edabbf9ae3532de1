"""Protocols of the datasets that the comparison reads: grasp datasets, and datasets in equivalent counts."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Protocol

from numpy.typing import NDArray

from taxel.recording.grasp_sensor_model import SensorModel
from taxel.recording.grasp_tables import ObjectMesh, SensorTable, TaxelTable
from taxel.types import BoolArray, ByteArray, FloatArray


class ReadableGrasp(Protocol):
    """One grasp of T frames, n taxels and s sensors, with fields of `taxel.recording.grasp.Grasp`.

    Raw counts may be fractions.
    """

    id: str
    object: str
    approach: str
    iteration: int
    session: int

    @property
    def timestamp(self) -> FloatArray:
        """Times of the frames, f64[T] (T frames), seconds."""
        ...

    @property
    def phase(self) -> ByteArray:
        """Phase of each frame, u8[T] (T frames)."""
        ...

    @property
    def raw_counts(self) -> NDArray[Any]:
        """Raw counts, [T, n] (T frames, n taxels); contact lowers the raw count."""
        ...

    @property
    def valid(self) -> BoolArray:
        """True for the frames of a sensor that arrived, bool[T, s] (T frames, s boards)."""
        ...

    @property
    def contact_force(self) -> FloatArray | None:
        """Contact force on each taxel, f64[T, n] (T frames, n taxels), newtons; None if the dataset contains none."""
        ...

    @property
    def separation(self) -> FloatArray | None:
        """Separation of object and taxel, f64[T, n] (T frames, n taxels), metres; None if the dataset contains none."""
        ...

    @property
    def sensor_pose(self) -> FloatArray:
        """Poses of the sensors, f64[s, 4, 4] (s boards)."""
        ...

    @property
    def object_pose(self) -> FloatArray:
        """Pose of the object, f64[4, 4]."""
        ...


class ReadableDataset(Protocol):
    """A dataset of grasps, with fields of `taxel.recording.grasp_dataset.GraspDataset`."""

    path: Path
    source: str
    taxels: TaxelTable
    sensors: SensorTable
    objects: Mapping[str, ObjectMesh]
    sensor_model: SensorModel | None

    def __iter__(self) -> Iterator[ReadableGrasp]: ...

    def __len__(self) -> int: ...

    def close(self) -> None:
        """Close the file."""
        ...
