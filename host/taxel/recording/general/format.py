"""Content of a dataset of version 2; docs/dataset-format.md describes the fields for users."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from enum import StrEnum
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from taxel.recording.grasp_tables import ObjectMesh
from taxel.types import BoolArray, ByteArray, FloatArray, IntArray

VERSION: Final = 2

DEFAULT_OBJECT: Final = "object"
DEFAULT_APPROACH: Final = "contact"
"""Labels of a contact without labels: all contacts are then repeats of one condition."""

MODALITIES: Final = ("capacitive", "resistive", "magnetic", "barometric", "optical", "other")

AXES: Final = 3
"""Number of components of a vector taxel."""


class Direction(StrEnum):
    """Direction in which contact changes a value."""

    RAISES = "raises"
    LOWERS = "lowers"
    SIGNED = "signed"
    """In both directions, such as the components of a vector taxel."""


@dataclass(frozen=True)
class Properties:
    """Declared properties of the values; None: not declared.

    Attributes:
        unit: unit of the values, such as "kPa".
        contact: `Direction` of the change by contact.
        full_scale: largest change of a value by contact, in the unit.
        resolution: smallest step between two values, in the unit.
        modality: one of `MODALITIES`.
    """

    unit: str | None = None
    contact: str | None = None
    full_scale: float | None = None
    resolution: float | None = None
    modality: str | None = None

    def to_attributes(self) -> dict[str, Any]:
        """Return the declared properties by name, without the properties that are None."""
        values = {item.name: getattr(self, item.name) for item in fields(self)}
        return {name: value for name, value in values.items() if value is not None}


@dataclass(frozen=True, eq=False)
class TaxelPlaces:
    """Electrodes and geometry of the n taxels; None: not known.

    Attributes:
        sensor: i64[n], number of the sensor (board, pad) of each taxel, 0 to 255.
        tx, rx: i64[n], electrode lines of each taxel on its sensor, 0 to 255.
        position: f64[n, 3], metres, in the frame of the sensor. normal: f64[n, 3], outward unit normal. size: f64[n],
            side of the taxel, metres.
    """

    sensor: IntArray | None = None
    tx: IntArray | None = None
    rx: IntArray | None = None
    position: FloatArray | None = None
    normal: FloatArray | None = None
    size: FloatArray | None = None


@dataclass(frozen=True, eq=False)
class Contact:
    """One grasp or indentation: T frames of n taxels.

    Attributes:
        id: name in the file; contacts are sorted by it.
        session: number of the day or of the mounting of the sensor.
        time: f64[T], seconds, increasing.
        values: f64[T, n], or f64[T, n, 3] for vector taxels; NaN where a value is missing.
        object, approach: labels; contacts with equal labels are repeats.
        iteration: number of the repeat.
        phase: u8[T] (`taxel.recording.grasp_format.Phase`); None: detected from the values.
        valid: bool[T], whether a frame arrived; None: all did.
        force, separation: f64[T, n], newtons and metres, only in simulation; None: not known.
        sensor_pose, object_pose: f64[s, 4, 4] and f64[4, 4], in the world; None: not known.
    """

    id: str
    session: int
    time: FloatArray
    values: FloatArray
    object: str = DEFAULT_OBJECT
    approach: str = DEFAULT_APPROACH
    iteration: int = 0
    phase: ByteArray | None = None
    valid: BoolArray | None = None
    force: FloatArray | None = None
    separation: FloatArray | None = None
    sensor_pose: FloatArray | None = None
    object_pose: FloatArray | None = None

    def is_missing(self) -> NDArray[np.bool_]:
        """Whether each frame did not arrive, or has no value at all, bool[T]."""
        empty = np.isnan(self.values).reshape(len(self.values), -1).all(axis=1)
        return np.asarray(empty if self.valid is None else empty | ~self.valid)


@dataclass(frozen=True, eq=False)
class GeneralHeader:
    """All content of a dataset except its contacts.

    source: "real" or "sim". sensor: name of the sensor or hand. generator: program that wrote the dataset.
    sensor_names: name of each sensor number of `places.sensor`. objects: meshes by name.
    """

    source: str
    sensor: str = "sensor"
    generator: str = "unknown"
    properties: Properties = field(default_factory=Properties)
    places: TaxelPlaces = field(default_factory=TaxelPlaces)
    sensor_names: tuple[str, ...] = ()
    objects: dict[str, ObjectMesh] = field(default_factory=dict)
