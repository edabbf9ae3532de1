"""What the comparison reads of a dataset and of a grasp: a grasp dataset, or a dataset in equivalent counts."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Protocol

from numpy.typing import NDArray

from taxel.recording.grasp_sensor_model import SensorModel
from taxel.recording.grasp_tables import ObjectMesh, SensorTable, TaxelTable
from taxel.types import BoolArray, ByteArray, FloatArray


class ReadableGrasp(Protocol):
    """One grasp; the fields are those of `taxel.recording.grasp.Grasp`, raw counts may be fractions."""

    id: str
    object: str
    approach: str
    iteration: int
    session: int

    @property
    def timestamp(self) -> FloatArray:
        """f64[T], seconds."""
        ...

    @property
    def phase(self) -> ByteArray:
        """u8[T]."""
        ...

    @property
    def raw_counts(self) -> NDArray[Any]:
        """Numbers [T, n]; contact lowers them."""
        ...

    @property
    def valid(self) -> BoolArray:
        """bool[T, s]."""
        ...

    @property
    def contact_force(self) -> FloatArray | None:
        """f64[T, n], newtons."""
        ...

    @property
    def separation(self) -> FloatArray | None:
        """f64[T, n], metres."""
        ...

    @property
    def sensor_pose(self) -> FloatArray:
        """f64[s, 4, 4]."""
        ...

    @property
    def object_pose(self) -> FloatArray:
        """f64[4, 4]."""
        ...


class ReadableDataset(Protocol):
    """A dataset; the fields are those of `taxel.recording.grasp_dataset.GraspDataset`."""

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
