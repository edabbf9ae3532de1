"""MuJoCo sensordata of the sensors touch, touch_grid (plug-in) and tactile.

Input: a .npz file with ``sensordata`` [T, k], as saved from `mjData.sensordata` in every step, and ``time`` [T]; the
model, or a list of the sensors. Layouts and origins (google-deepmind/mujoco):

- touch: one value, the sum of the normal forces in the site, newtons;
- touch_grid (plugin/sensor/touch_grid.cc): nchannel images of size[1] rows and size[0] columns, one after the other:
  value (channel * rows + row) * columns + column. The channels are normal force, two tangential forces, and three
  torques (plugin/sensor/README.md: order z, x, y);
- tactile (src/engine/engine_sensor.c, mjSENS_TACTILE): 3 images of one value for each vertex of the mesh: channel *
  vertices + vertex. The channels are the pressure along the normal, and two absolute tangential sliding speeds.

Vectors of the dataset are in the order tangent 1, tangent 2, normal.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import prod
from pathlib import Path
from typing import Any, Final

import numpy as np

from taxel.hand.errors import format_value
from taxel.optional import optional_import
from taxel.recording.general.format import AXES, Direction, GeneralHeader, Properties, TaxelPlaces
from taxel.recording.grasp_checks import Location
from taxel.recording.grasp_format import SIM
from taxel.recording.importers.contacts import Recording
from taxel.recording.importers.fields import suggest_names
from taxel.recording.importers.preset import PresetOptions, join_components, read_preset_times
from taxel.recording.importers.run import make_header
from taxel.recording.importers.sources import check_input, open_source
from taxel.types import FloatArray

SENSORDATA: Final = "sensordata"
PLUGIN: Final = "mujoco.sensor.touch_grid"
KINDS: Final = ("touch", "touch_grid", "tactile")


@dataclass(frozen=True)
class TactileSensor:
    """A tactile sensor of a model.

    name: name in the model. kind: one of `KINDS`. start: index of the sensor's first value in sensordata. taxels:
    number of taxels. channels: number of values of each taxel.
    """

    name: str
    kind: str
    start: int
    taxels: int
    channels: int


def read_mujoco_sensors(
    path: Path,
    options: PresetOptions,
    model: Path | None = None,
    layout: str | None = None,
    names: Sequence[str] = (),
    is_normal_only: bool = False,
) -> tuple[GeneralHeader, list[Recording]]:
    """Read the sensordata of tactile sensors; return (header of the dataset, list of one recording).

    model: XML or MJB file. layout: description of the sensors instead of a model, see `parse_layout`. names: sensors to
    import; empty: all tactile ones. is_normal_only: import only the normal component of each taxel. Raises DatasetError
    for a wrong number of values, an unknown sensor, and a mixture of sensors with one and with three components.
    """
    opened = open_source(path)
    location = Location(str(model if model is not None else path))
    sensors = read_model(model) if model is not None else parse_layout(layout or "", location)
    if names:
        by_name = {sensor.name: sensor for sensor in sensors}
        for name in names:
            if name not in by_name:
                location.key(name).fail("a tactile sensor", "none of this name", suggest_names(name, by_name))
        sensors = [by_name[name] for name in names]
    data = opened.read_numbers(SENSORDATA)
    last = max(sensor.start + sensor.taxels * sensor.channels for sensor in sensors)
    if data.ndim != 2 or data.shape[1] < last:
        remedy = "save mjData.sensordata of every step, and give the model of that simulation"
        opened.at(SENSORDATA).fail(f"shape [T, k] with k of at least {last}", f"shape {data.shape}", remedy)
    is_vector = {sensor.channels >= AXES and not is_normal_only for sensor in sensors}
    if len(is_vector) > 1:
        remedy = "import them separately (--sensors), or the normal values only (--normal-only)"
        location.fail("sensors of one number of components", "some of 1 and some of 3", remedy)
    values = np.concatenate([_read_sensor(data, sensor, is_vector == {True}) for sensor in sensors], axis=1)
    time = read_preset_times(opened, len(data), options)
    index = np.concatenate([np.full(sensor.taxels, number) for number, sensor in enumerate(sensors)])
    header = make_header(SIM, "MuJoCo", _find_properties(sensors, is_vector == {True}), TaxelPlaces(sensor=index))
    return header, [Recording(opened.location, time, values, options.labels)]


def _read_sensor(data: Any, sensor: TactileSensor, is_vector: bool) -> FloatArray:
    """Return the values of a sensor: f64[T, n], or f64[T, n, 3] if `is_vector` (tangent 1, tangent 2, normal).

    data: sensordata of T steps. A sensor stores the normal values of all taxels first, then tangent 1, then tangent 2.
    Further channels, such as torques, are left out.
    """
    flat = data[:, sensor.start : sensor.start + sensor.taxels * sensor.channels].astype(np.float64)
    images = flat.reshape(len(data), sensor.channels, sensor.taxels)
    return join_components(images[:, 1:AXES].swapaxes(1, 2), images[:, 0]) if is_vector else images[:, 0]


def _find_properties(sensors: Sequence[TactileSensor], is_vector: bool) -> Properties:
    """Return the properties of the sensors' values; the unit is newtons only if every sensor measures forces."""
    kinds = {sensor.kind for sensor in sensors}
    contact = Direction.SIGNED.value if is_vector else Direction.RAISES.value if kinds == {"touch"} else None
    return Properties(unit=None if "tactile" in kinds else "N", contact=contact, modality="other")


def read_model(path: Path) -> list[TactileSensor]:
    """Return the tactile sensors of a model file (XML or MJB) in the order of sensordata.

    Raises DatasetError for a model that cannot be loaded or has no tactile sensor, and MissingPackageError if the
    package mujoco is not installed.
    """
    with optional_import("mujoco", "a MuJoCo model"):
        import mujoco
    location = Location(str(path))
    check_input(path)
    _load_plugins(mujoco)
    try:
        load = mujoco.MjModel.from_binary_path if path.suffix.lower() == ".mjb" else mujoco.MjModel.from_xml_path
        model = load(str(path))
    except ValueError as error:
        location.fail("a MuJoCo model", format_value(str(error).partition("\n")[0]), "correct the model")
    sensors = []
    for index in range(model.nsensor):
        kind, dim = int(model.sensor_type[index]), int(model.sensor_dim[index])
        name = mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_SENSOR, index) or f"sensor_{index}"
        start = int(model.sensor_adr[index])
        if kind == mujoco.mjtSensor.mjSENS_TOUCH:
            sensors.append(TactileSensor(name, "touch", start, 1, 1))
        elif kind == mujoco.mjtSensor.mjSENS_TACTILE:
            vertices = int(model.mesh_vertnum[model.sensor_objid[index]])
            sensors.append(TactileSensor(name, "tactile", start, vertices, dim // vertices))
        elif kind == mujoco.mjtSensor.mjSENS_PLUGIN and model.sensor_plugin[index] >= 0:
            taxels = _read_grid_size(model, int(model.sensor_plugin[index]))
            if taxels is not None and dim % taxels == 0:
                sensors.append(TactileSensor(name, "touch_grid", start, taxels, dim // taxels))
    if not sensors:
        location.fail(f"a sensor of the kinds {', '.join(KINDS)}", "none", "add the sensor, or give another model")
    return sensors


def _load_plugins(mujoco: Any) -> None:
    """Load the plug-ins that the package mujoco contains, so that a model with touch_grid can be loaded.

    Newer versions load them when the package is imported; loading them again is an error, which is ignored.
    """
    for library in (Path(mujoco.__file__).parent / "plugin").glob("*sensor*"):
        try:
            mujoco.mj_loadPluginLibrary(str(library))
        except (mujoco.FatalError, ValueError, OSError):
            continue


def _read_grid_size(model: Any, instance: int) -> int | None:
    """Return the number of taxels of a touch_grid plug-in; None for another plug-in or a damaged configuration.

    instance: index of the plug-in instance. Its configuration contains the attributes nchannel, size, fov and gamma
    (touch_grid.cc, RegisterPlugin), each ended by a zero byte; size is "columns rows".
    """
    start = int(model.plugin_attradr[instance])
    texts = bytes(np.asarray(model.plugin_attr[start:]).astype(np.uint8)).split(b"\0")
    try:
        sizes = [int(float(text)) for text in texts[1].split()]
    except (ValueError, IndexError):
        return None
    return sizes[0] * sizes[1] if len(sizes) == 2 and min(sizes) > 0 else None


def parse_layout(text: str, location: Location) -> list[TactileSensor]:
    """Parse a list of sensors without a model, in the order of sensordata: "tip:touch, pad:touch_grid:7x5x3".

    An entry is NAME:touch, NAME:touch_grid:COLUMNSxROWSxCHANNELS, NAME:tactile:VERTICES, or NAME:skip:VALUES for other
    sensors. Raises DatasetError for another entry.
    """
    sensors, start = [], 0
    for entry in text.split(","):
        name, _, rest = entry.strip().partition(":")
        kind, _, size = rest.partition(":")
        sizes = [int(part) for part in size.split("x") if part.isdecimal()]
        expected = {"touch": 0, "touch_grid": AXES, "tactile": 1, "skip": 1}.get(kind)
        if not name or expected is None or len(sizes) != expected or (size and size.count("x") != expected - 1):
            example = "tip:touch, pad:touch_grid:7x5x3, finger:tactile:120, imu:skip:6"
            remedy = "give the model with --model, or list the sensors with --layout"
            location.key("layout").fail(f"sensors such as {example}", format_value(entry.strip()), remedy)
        if kind == "skip":
            start += sizes[0]
            continue
        taxels = 1 if kind == "touch" else prod(sizes[:2])
        channels = {"touch": 1, "touch_grid": sizes[-1] if sizes else 1, "tactile": AXES}[kind]
        if taxels < 1 or channels < 1:
            location.key("layout").fail("numbers above 0", format_value(entry.strip()), "correct the list")
        sensors.append(TactileSensor(name, kind, start, taxels, channels))
        start += taxels * channels
    if not sensors:
        location.key("layout").fail("at least one tactile sensor", "none", "correct the list")
    return sensors
