"""A dataset of any sensor in equivalent counts that contact lowers."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from taxel.gap.data.boards import compute_pitch_m
from taxel.gap.data.missing_inputs import GEOMETRY
from taxel.gap.errors import GapInputError
from taxel.hand.errors import format_path
from taxel.recording.general.dataset import GeneralDataset
from taxel.recording.general.format import AXES, Contact, TaxelPlaces
from taxel.recording.grasp_format import Phase
from taxel.recording.grasp_sensor_model import SensorModel
from taxel.recording.grasp_tables import ObjectMesh, SensorTable, TaxelTable
from taxel.types import BoolArray, ByteArray, FloatArray, IntArray

BASELINE_COUNTS: Final = 30_000.0
"""Equivalent count without contact (chosen). Only differences from this value are used."""

APART_M: Final = 1.0
"""Distance in metres between taxels without positions (chosen): larger than the range of every effect, so that no taxel
is a neighbour of another."""

AXIS_NAMES: Final = ("x", "y", "z")
"""Suffixes of the names of the sensors that contain the components of vector taxels."""

MAX_NUMBER: Final = 256
"""Largest number of sensors, and of lines of a sensor: the tables of a dataset store these numbers in 8 bits."""

PLACEHOLDER_MESH: Final = ObjectMesh(
    np.array([[0.0, 0.0, 0.0], [1e-3, 0.0, 0.0], [0.0, 1e-3, 0.0], [0.0, 0.0, 1e-3]]),
    np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]], np.int32),
)
"""Mesh of an object without a mesh; effects that need a mesh are then unavailable."""


@dataclass(eq=False)
class CountsGrasp:
    """One contact in equivalent counts, with the fields of `taxel.gap.data.readable.ReadableGrasp`."""

    id: str
    object: str
    approach: str
    iteration: int
    session: int
    timestamp: FloatArray
    phase: ByteArray
    raw_counts: FloatArray
    valid: BoolArray
    sensor_pose: FloatArray
    object_pose: FloatArray
    contact_force: FloatArray | None = None
    separation: FloatArray | None = None


@dataclass(eq=False)
class CountsDataset:
    """A dataset in equivalent counts, with the fields of `taxel.gap.data.readable.ReadableDataset`."""

    path: Path
    source: str
    taxels: TaxelTable
    sensors: SensorTable
    objects: Mapping[str, ObjectMesh]
    grasps: tuple[CountsGrasp, ...]
    sensor_model: SensorModel | None = None

    def __iter__(self) -> Iterator[CountsGrasp]:
        return iter(self.grasps)

    def __len__(self) -> int:
        return len(self.grasps)

    def close(self) -> None:
        """Do nothing: no file is open."""


def make_tables(data: GeneralDataset, missing_inputs: frozenset[str]) -> tuple[TaxelTable, SensorTable, IntArray]:
    """Return the tables of taxels and sensors of the real file, and the sensor of each taxel, i64[n] (n taxels).

    Each component (x, y or z) of a vector taxel becomes a taxel. The components of the same axis form a sensor, so an x
    component, for example, has only x components as neighbours. missing_inputs: optional data that the files lack;
    without positions the taxels get positions far from each other. Raises GapInputError for too many sensors or lines
    (`MAX_NUMBER`).
    """
    places, n = data.header.places, data.n
    axes = AXES if data.is_vector else 1
    sensor = np.zeros(n, np.int64) if places.sensor is None else np.unique(places.sensor, return_inverse=True)[1]
    numbers = np.repeat(sensor * axes, axes) + np.tile(np.arange(axes), n)
    address = np.arange(int(numbers.max()) + 1)
    tx, rx = _make_lines(places, sensor)
    if max(len(address), int(tx.max()) + 1, int(rx.max()) + 1) > MAX_NUMBER:
        expected = f"at most {MAX_NUMBER // axes} sensors of at most {MAX_NUMBER**2} taxels"
        remedy = "divide the dataset, or combine sensors in /taxels/sensor"
        raise GapInputError(f"{format_path(str(data.path))}: /taxels", expected, "more", remedy)
    position = np.zeros((n, 3)) if places.position is None else places.position
    if GEOMETRY in missing_inputs:
        position = np.column_stack([np.arange(n) * APART_M, np.zeros((n, 2))])
    normal = np.tile([0.0, 0.0, 1.0], (n, 1)) if places.normal is None else places.normal
    size = np.full(n, compute_pitch_m(position, np.full(n, APART_M))) if places.size is None else places.size
    table = TaxelTable(
        numbers.astype(np.uint8),
        np.repeat(tx, axes).astype(np.uint8),
        np.repeat(rx, axes).astype(np.uint8),
        np.repeat(position, axes, axis=0),
        np.repeat(normal, axes, axis=0),
        np.repeat(size, axes),
    )
    sensor_names = data.header.sensor_names or tuple(f"sensor {k}" for k in range(int(sensor.max()) + 1))
    names = [f"{sensor_names[k // axes]}{'' if axes == 1 else ' ' + AXIS_NAMES[k % axes]}" for k in address]
    rate = np.full(len(address), 1.0)
    return table, SensorTable(address.astype(np.uint8), tuple(names), tuple(names), rate), numbers


def _make_lines(places: TaxelPlaces, sensor: IntArray) -> tuple[IntArray, IntArray]:
    """Return the TX and RX line of each taxel; without lines, rows and columns of a square arrangement in the order of
    the taxels.

    The square arrangement serves only for pictures. sensor: sensor of each taxel.
    """
    if places.tx is not None and places.rx is not None:
        return places.tx, places.rx
    tx, rx = np.zeros_like(sensor), np.zeros_like(sensor)
    for number in np.unique(sensor):
        taxels = np.flatnonzero(sensor == number)
        width = max(int(np.ceil(np.sqrt(len(taxels)))), 1)
        tx[taxels], rx[taxels] = np.divmod(np.arange(len(taxels)), width)
    return tx, rx


def convert_contacts(
    data: GeneralDataset,
    contacts: Sequence[Contact],
    factor: float,
    tables: tuple[TaxelTable, SensorTable, IntArray],
) -> CountsDataset:
    """Return the contacts of a file as a dataset in equivalent counts.

    contacts: contacts with phases. factor: equivalent counts per unit, positive if contact lowers the values. tables:
    the result of `make_tables`.
    """
    taxels, sensors, numbers = tables
    grasps = tuple(_convert_contact(one, factor, (numbers, sensors.s)) for one in contacts)
    objects = {name: data.header.objects.get(name, PLACEHOLDER_MESH) for name in {one.object for one in grasps}}
    return CountsDataset(data.path, data.header.source, taxels, sensors, objects, grasps)


def _convert_contact(contact: Contact, factor: float, index: tuple[IntArray, int]) -> CountsGrasp:
    """Return one contact in equivalent counts that contact lowers.

    factor: equivalent counts per unit, positive if contact lowers the values. index: sensor of each taxel, i64[n] (n
    taxels), and number of sensors. A frame of a sensor is valid unless all its taxels are missing.
    """
    column, sensors = index
    assert contact.phase is not None
    values = contact.values.reshape(len(contact.values), -1)
    missing = np.isnan(values) | contact.is_missing()[:, None]
    rest = np.nanmedian(np.where(missing, np.nan, values)[contact.phase == Phase.BASELINE], axis=0)
    counts = BASELINE_COUNTS + factor * (values - np.nan_to_num(rest))
    valid = np.ones((len(values), sensors), bool)
    for number in range(sensors):
        is_on_sensor = column == number
        valid[:, number] = ~missing[:, is_on_sensor].all(axis=1)
    poses = np.tile(np.eye(4), (sensors, 1, 1))
    if contact.sensor_pose is not None:
        # The component sensors (x, y, z) of a vector sensor have the same pose.
        axes = sensors // len(contact.sensor_pose)
        poses = np.repeat(contact.sensor_pose, max(axes, 1), axis=0)
    return CountsGrasp(
        id=contact.id,
        object=contact.object,
        approach=contact.approach,
        iteration=contact.iteration,
        session=contact.session,
        timestamp=contact.time,
        phase=contact.phase,
        raw_counts=np.where(missing, BASELINE_COUNTS, counts),
        valid=valid,
        sensor_pose=poses,
        object_pose=np.eye(4) if contact.object_pose is None else contact.object_pose,
    )
