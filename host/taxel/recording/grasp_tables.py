"""The tables that all grasps of a dataset share: taxels, sensors and objects."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel.hand.errors import format_address, format_value
from taxel.recording.grasp_checks import NORMAL_TOLERANCE, Place, check_text, first, given, shown_index
from taxel.recording.grasp_format import MESH, SENSORS, TAXELS


@dataclass(frozen=True, eq=False)
class TaxelTable:
    """The n taxels of a hand, in the order of every array's last axis.

    sensor: u8[n], I2C address of the board a taxel belongs to.
    tx, rx: u8[n], electrode line numbers on that board.
    position: f64[n, 3], centre, metres, in the sensor's bracket frame.
    normal: f64[n, 3], outward unit normal, bracket frame.
    size: f64[n], side of the square electrode, metres.
    """

    sensor: NDArray[np.uint8]
    tx: NDArray[np.uint8]
    rx: NDArray[np.uint8]
    position: NDArray[np.float64]
    normal: NDArray[np.float64]
    size: NDArray[np.float64]

    @property
    def n(self) -> int:
        """Number of taxels."""
        return len(self.sensor)

    @property
    def rx_line(self) -> NDArray[np.int64]:
        """i64[n], number of the RX line of each taxel; taxels that share a receive electrode share the number."""
        number: NDArray[np.int64] = np.unique(self.sensor.astype(np.int64) * 256 + self.rx, return_inverse=True)[1]
        return number.reshape(-1)

    def equal_to(self, other: TaxelTable) -> bool:
        """Whether both tables are the same to the last bit: only then are two datasets comparable."""
        return all(np.array_equal(getattr(self, f.name), getattr(other, f.name)) for f in fields(self))


@dataclass(frozen=True, eq=False)
class SensorTable:
    """The s sensor boards.

    address: u8[s], I2C address. name: such as "palm". kind: one of the hand's kinds. rate_hz: f64[s].
    """

    address: NDArray[np.uint8]
    name: tuple[str, ...]
    kind: tuple[str, ...]
    rate_hz: NDArray[np.float64]

    @property
    def s(self) -> int:
        """Number of sensors."""
        return len(self.address)

    def index_of(self, taxels: TaxelTable) -> NDArray[np.int64]:
        """i64[n], the row of each taxel's sensor in this table."""
        row = np.zeros(256, np.int64)
        row[self.address] = np.arange(self.s)
        return row[taxels.sensor]


@dataclass(frozen=True, eq=False)
class ObjectMesh:
    """An object. vertices: f64[v, 3], metres, object frame. faces: i32[f, 3], outward winding."""

    vertices: NDArray[np.float64]
    faces: NDArray[np.int32]


def frozen(array: NDArray[Any]) -> NDArray[Any]:
    """The same array, read-only; what came from elsewhere is copied first."""
    if array.flags.writeable:
        array = array.copy()
        array.flags.writeable = False
    return array


def checked_taxels(arrays: Mapping[str, Any], place: Place, sizes: dict[str, int]) -> TaxelTable:
    """The taxel table of six arrays; raises DatasetError for the first mistake. Adds n to sizes."""
    table = TaxelTable(
        **{name: frozen(given(arrays[name], spec, sizes, place.key(name))) for name, spec in TAXELS.items()}
    )
    with np.errstate(over="ignore"):
        length = np.linalg.norm(table.normal, axis=1)
    bent = ~(np.abs(length - 1.0) <= NORMAL_TOLERANCE)
    if bent.any():
        at = first(bent)
        found = f"{length[at]:.6g} at {shown_index(at)}"
        place.key("normal").fail("normals of length 1", found, "divide them by their length")
    if (table.size <= 0.0).any():
        at = first(table.size <= 0.0)
        place.key("size").fail("metres above 0", f"{table.size[at]} at {shown_index(at)}", "correct it")
    crossing = (table.sensor.astype(np.int64) * 256 + table.tx) * 256 + table.rx
    _, first_seen, number = np.unique(crossing, return_index=True, return_inverse=True)
    repeated = first_seen[number.reshape(-1)] != np.arange(table.n)
    if repeated.any():
        at = first(repeated)
        found = f"{format_address(int(table.sensor[at]))} tx {table.tx[at]} rx {table.rx[at]} again at {shown_index(at)}"
        place.key("sensor").fail("each (sensor, tx, rx) once", found, "remove or renumber that taxel")
    return table


def checked_sensors(arrays: Mapping[str, Any], place: Place, sizes: dict[str, int]) -> SensorTable:
    """The sensor table of four arrays; raises DatasetError for the first mistake. Adds s to sizes."""
    address = frozen(given(arrays["address"], SENSORS["address"], sizes, place.key("address")))
    rate = frozen(given(arrays["rate_hz"], SENSORS["rate_hz"], sizes, place.key("rate_hz")))
    name = _texts(arrays["name"], sizes["s"], place.key("name"))
    kind = _texts(arrays["kind"], sizes["s"], place.key("kind"))
    values, counts = np.unique(address, return_counts=True)
    if (counts > 1).any():
        found = f"{format_address(int(values[counts > 1][0]))} twice"
        place.key("address").fail("each address once", found, "give each sensor its own")
    if (rate <= 0.0).any():
        at = first(rate <= 0.0)
        place.key("rate_hz").fail("rates above 0", f"{rate[at]} at {shown_index(at)}", "correct it")
    return SensorTable(address, name, kind, rate)


def _texts(values: Any, count: int, place: Place) -> tuple[str, ...]:
    if isinstance(values, str | bytes) or np.ndim(values) != 1 or len(values) != count:
        place.fail(f"{count} texts (s = {count})", f"shape {list(np.shape(values))}", "give one for each sensor")
    items = values.tolist() if isinstance(values, np.ndarray) else values
    return tuple(check_text(value, place) for value in items)


def check_addresses(taxels: TaxelTable, sensors: SensorTable, place: Place) -> None:
    """Refuse a taxel whose sensor the sensor table lacks. place: that of the file."""
    unknown = ~np.isin(taxels.sensor, sensors.address)
    if unknown.any():
        at = first(unknown)
        found = f"{format_address(int(taxels.sensor[at]))} at {shown_index(at)}"
        place.key("taxels").key("sensor").fail("an address that /sensors/address has", found, "add that sensor")


def checked_mesh(arrays: Mapping[str, Any], place: Place) -> ObjectMesh:
    """The mesh of two arrays; raises DatasetError for the first mistake."""
    sizes: dict[str, int] = {}
    vertices, faces = (frozen(given(arrays[name], spec, sizes, place.key(name))) for name, spec in MESH.items())
    wrong = (faces < 0) | (faces >= len(vertices))
    if wrong.any():
        at = first(wrong)
        found = f"{faces[at]} at {shown_index(at)}"
        place.key("faces").fail(f"vertex numbers from 0 to {len(vertices) - 1}", found, "correct that face")
    return ObjectMesh(vertices, faces)


def check_name(name: Any, place: Place) -> str:
    """A name of an object or a grasp: it becomes the name of a group."""
    text = check_text(name, place)
    if "/" in text or text in (".", ".."):
        place.fail("a name without / that is not a dot", format_value(text), "rename it")
    return text
