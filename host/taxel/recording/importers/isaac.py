"""Isaac Lab: saved arrays of contact sensors and of TacSL force fields.

Layouts and origins (isaac-sim/IsaacLab, docstrings of ContactSensorData and VisuoTactileSensorData), stacked over T
steps:

- net_forces_w [T, (e,) bodies, 3]: contact force of each body in the frame of the world, newtons;
- force_matrix_w [T, (e,) bodies, filters, 3]: the same for each filtered body; summed over the filters;
- tactile_normal_force [T, (e,) points] or [T, (e,) rows, columns], and tactile_shear_force [..., 2]: the force field in
  the frame of the sensor.

e: environments. Vectors of a force field are in the order shear x, shear y, normal. The simulator saves no files; the
user saves these arrays under these names in a .npz, .h5 or .zarr file, and ``time`` [T] in seconds.
"""

from __future__ import annotations

from math import prod
from pathlib import Path
from typing import Final

import numpy as np

from taxel.recording.general.format import AXES, Direction, GeneralHeader, Properties
from taxel.recording.grasp_format import SIM
from taxel.recording.importers.contacts import Recording
from taxel.recording.importers.fields import Source
from taxel.recording.importers.preset import PresetOptions, join_components, read_preset_times, split_environments
from taxel.recording.importers.run import make_header
from taxel.recording.importers.sources import open_source
from taxel.types import FloatArray

NORMAL, SHEAR = "tactile_normal_force", "tactile_shear_force"
NET, MATRIX = "net_forces_w", "force_matrix_w"
_LEAST_AXES: Final = {NET: 3, MATRIX: 4}
"""Number of axes of the array of a contact sensor without environments."""


def read_isaac(
    path: Path, options: PresetOptions, has_environments: bool = False
) -> tuple[GeneralHeader, list[Recording]]:
    """Read arrays of Isaac Lab; each environment gives its own contacts.

    has_environments: whether the second axis of a force field is the environment; for contact sensors, and for a force
    field [T, e, rows, columns], the number of axes shows it. Raises DatasetError for missing arrays and other shapes.
    """
    opened = open_source(path)
    present = [name for name in (NORMAL, MATRIX, NET) if _find(opened, name)]
    if not present:
        expected = f"an array {NORMAL}, {MATRIX} or {NET}"
        opened.location.fail(expected, "none", "save the arrays under these names, see docs/import-isaac.md")
    name = _find(opened, present[0])
    if present[0] == NORMAL:
        values = _read_field(opened, name, has_environments)
    else:
        values = _read_contacts(opened, name, _LEAST_AXES[present[0]])
    time = read_preset_times(opened, len(values), options)
    is_vector = values.ndim == 4
    contact = Direction.SIGNED if is_vector else Direction.RAISES
    header = make_header(SIM, "Isaac Lab", Properties("N", contact.value, modality="other"))
    return header, list(split_environments(values, time, opened.location, options.labels))


def _find(opened: Source, name: str) -> str:
    """Name of the first field that ends with a name, such as sensor/net_forces_w; "" without one."""
    return next((own for own in opened.fields if own == name or own.endswith(f"/{name}")), "")


def _read_contacts(opened: Source, name: str, least: int) -> FloatArray:
    """Forces f64[T, e, bodies, 3] of a contact sensor; NaN of missing filters counts as 0. Raises DatasetError."""
    array = opened.read_numbers(name).astype(np.float64)
    if array.ndim not in (least, least + 1) or array.shape[-1] != AXES:
        expected = "shape [T, bodies, 3]" if least == 3 else "shape [T, bodies, filters, 3]"
        remedy = "stack the array of every step along a new first axis"
        opened.at(name).fail(f"{expected}, or with environments after T", f"shape {array.shape}", remedy)
    if array.ndim == least:
        array = array[:, None]
    return np.asarray(array if least == 3 else np.nansum(array, axis=3))


def _read_field(opened: Source, name: str, has_environments: bool) -> FloatArray:
    """Values f64[T, e, n], or f64[T, e, n, 3] if the file has the shear forces. Raises DatasetError."""
    normal = opened.read_numbers(name).astype(np.float64)
    if normal.ndim not in (2, 3, 4):
        remedy = "stack the array of every step along a new first axis"
        opened.at(name).fail("shape [T, points], or with environments", f"shape {normal.shape}", remedy)
    split = has_environments or normal.ndim == 4
    if split and normal.ndim == 2:
        opened.at(name).fail("shape [T, e, points]", f"shape {normal.shape}", "leave out --environments")
    lead = normal.shape[:2] if split else (len(normal), 1)
    points = prod(normal.shape[len(normal.shape) - normal.ndim + (2 if split else 1) :])
    shear_name = _find(opened, SHEAR)
    if not shear_name:
        return normal.reshape(*lead, points)
    shear = opened.read_numbers(shear_name).astype(np.float64)
    if shear.shape != (*normal.shape, 2):
        opened.at(shear_name).fail(f"shape {(*normal.shape, 2)}", f"shape {shear.shape}", "save both again")
    return join_components(shear.reshape(*lead, points, 2), normal.reshape(*lead, points))
