"""The tables that all grasps of a dataset share: taxels, sensors and objects."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel.hand.errors import format_address, format_value
from taxel.recording.grasp_checks import (
    NORMAL_TOLERANCE,
    Location,
    check_array,
    check_text,
    find_first,
    format_index,
)
from taxel.recording.grasp_format import MESH, SENSORS, TAXELS
from taxel.types import ByteArray, FloatArray, Int32Array, IntArray


@dataclass(frozen=True, eq=False)
class TaxelTable:
    """Table of the n taxels of a hand, in the order of the last axis of every array of the dataset.

    sensor: u8[n], I2C address of the board of each taxel. tx, rx: u8[n], electrode line numbers on that board.
    position: f64[n, 3], centre in the sensor's bracket frame, metres. normal: f64[n, 3], outward unit normal, bracket
    frame. size: f64[n], side of the square electrode, metres.
    """

    sensor: ByteArray
    tx: ByteArray
    rx: ByteArray
    position: FloatArray
    normal: FloatArray
    size: FloatArray

    @property
    def n(self) -> int:
        """Number of taxels."""
        return len(self.sensor)

    @property
    def rx_line(self) -> IntArray:
        """Number of each taxel's RX line over all boards, i64[n]; taxels on the same electrode share a number."""
        number: IntArray = np.unique(self.sensor.astype(np.int64) * 256 + self.rx, return_inverse=True)[1]
        return number.reshape(-1)


@dataclass(frozen=True, eq=False)
class SensorTable:
    """Table of the s sensor boards of a dataset.

    address: u8[s], I2C address. name: such as "palm". kind: board kind of the hand description. rate_hz: f64[s], frames
    per second.
    """

    address: ByteArray
    name: tuple[str, ...]
    kind: tuple[str, ...]
    rate_hz: FloatArray

    @property
    def s(self) -> int:
        """Number of sensors."""
        return len(self.address)

    def index_of(self, taxels: TaxelTable) -> IntArray:
        """Return the index in this table of each taxel's sensor, i64[n]."""
        row = np.zeros(256, np.int64)  # an address has 8 bits
        row[self.address] = np.arange(self.s)
        return row[taxels.sensor]


@dataclass(frozen=True, eq=False)
class ObjectMesh:
    """Triangle mesh of an object. vertices: f64[v, 3], metres, object frame. faces: i32[f, 3], outward winding."""

    vertices: FloatArray
    faces: Int32Array


def copy_read_only(array: NDArray[Any]) -> NDArray[Any]:
    """Return a read-only array with the same values; a writeable array is copied, because other code may change it."""
    if array.flags.writeable:
        array = array.copy()
        array.flags.writeable = False
    return array


def check_taxels(arrays: Mapping[str, Any], location: Location, sizes: dict[str, int]) -> TaxelTable:
    """Build the taxel table from six arrays by name; raises DatasetError for the first error.

    sizes: length of each axis so far; the number of taxels n is added.
    """
    table = TaxelTable(
        **{
            name: copy_read_only(check_array(arrays[name], spec, sizes, location.key(name)))
            for name, spec in TAXELS.items()
        }
    )
    with np.errstate(over="ignore"):
        length = np.linalg.norm(table.normal, axis=1)
    is_not_unit = ~(np.abs(length - 1.0) <= NORMAL_TOLERANCE)
    if is_not_unit.any():
        at = find_first(is_not_unit)
        found = f"{length[at]:.6g} at {format_index(at)}"
        location.key("normal").fail("normals of length 1", found, "divide them by their length")
    if (table.size <= 0.0).any():
        at = find_first(table.size <= 0.0)
        location.key("size").fail("metres above 0", f"{table.size[at]} at {format_index(at)}", "correct it")
    # One number for each crossing of electrodes: sensor, tx and rx have 8 bits each.
    crossing = (table.sensor.astype(np.int64) * 256 + table.tx) * 256 + table.rx
    _, first_row, number = np.unique(crossing, return_index=True, return_inverse=True)
    is_repeated = first_row[number.reshape(-1)] != np.arange(table.n)
    if is_repeated.any():
        at = find_first(is_repeated)
        address = format_address(int(table.sensor[at]))
        found = f"{address} tx {table.tx[at]} rx {table.rx[at]} again at {format_index(at)}"
        location.key("sensor").fail("each (sensor, tx, rx) once", found, "remove or renumber that taxel")
    return table


def check_sensors(arrays: Mapping[str, Any], location: Location, sizes: dict[str, int]) -> SensorTable:
    """Build the sensor table from four arrays by name; raises DatasetError for the first error.

    sizes: length of each axis so far; the number of sensors s is added.
    """
    address = copy_read_only(check_array(arrays["address"], SENSORS["address"], sizes, location.key("address")))
    rate = copy_read_only(check_array(arrays["rate_hz"], SENSORS["rate_hz"], sizes, location.key("rate_hz")))
    name = _check_texts(arrays["name"], sizes["s"], location.key("name"))
    kind = _check_texts(arrays["kind"], sizes["s"], location.key("kind"))
    values, counts = np.unique(address, return_counts=True)
    if (counts > 1).any():
        found = f"{format_address(int(values[counts > 1][0]))} twice"
        location.key("address").fail("each address once", found, "give each sensor its own address")
    if (rate <= 0.0).any():
        at = find_first(rate <= 0.0)
        location.key("rate_hz").fail("rates above 0", f"{rate[at]} at {format_index(at)}", "correct it")
    return SensorTable(address, name, kind, rate)


def _check_texts(values: Any, count: int, location: Location) -> tuple[str, ...]:
    """Return a column of `count` strings as a tuple. Raises DatasetError for another shape or type."""
    if isinstance(values, str | bytes) or np.ndim(values) != 1 or len(values) != count:
        location.fail(f"{count} texts (s = {count})", f"shape {list(np.shape(values))}", "give one for each sensor")
    items = values.tolist() if isinstance(values, np.ndarray) else values
    return tuple(check_text(value, location) for value in items)


def check_addresses(taxels: TaxelTable, sensors: SensorTable, location: Location) -> None:
    """Raise DatasetError if the sensor table lacks the sensor of a taxel. location: the location of the file."""
    is_unknown = ~np.isin(taxels.sensor, sensors.address)
    if is_unknown.any():
        at = find_first(is_unknown)
        found = f"{format_address(int(taxels.sensor[at]))} at {format_index(at)}"
        location.key("taxels").key("sensor").fail("an address in /sensors/address", found, "add that sensor")


def check_mesh(arrays: Mapping[str, Any], location: Location) -> ObjectMesh:
    """Build the mesh of an object from its vertices and faces; raises DatasetError for the first error."""
    sizes: dict[str, int] = {}
    vertices, faces = (
        copy_read_only(check_array(arrays[name], spec, sizes, location.key(name))) for name, spec in MESH.items()
    )
    is_outside = (faces < 0) | (faces >= len(vertices))
    if is_outside.any():
        at = find_first(is_outside)
        found = f"{faces[at]} at {format_index(at)}"
        location.key("faces").fail(f"vertex numbers from 0 to {len(vertices) - 1}", found, "correct that face")
    return ObjectMesh(vertices, faces)


def check_name(name: Any, location: Location) -> str:
    """Return the name of an object or a grasp if it can be the name of an HDF5 group; else raise DatasetError."""
    text = check_text(name, location)
    if "/" in text or text in (".", ".."):
        location.fail("a name without a slash, other than . and ..", format_value(text), "rename it")
    return text
