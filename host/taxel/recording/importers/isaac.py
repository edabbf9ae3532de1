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
    """Read arrays of Isaac Lab; return (header of the dataset, one recording for each environment).

    has_environments: whether the second axis of a force field with three axes is the environment. For contact sensors,
    and for a force field [T, e, rows, columns], the number of axes shows whether the array has environments. Raises
    DatasetError for missing arrays and other shapes.
    """
    opened = open_source(path)
    present = [name for name in (NORMAL, MATRIX, NET) if _find_field(opened, name)]
    if not present:
        expected = f"an array {NORMAL}, {MATRIX} or {NET}"
        opened.location.fail(expected, "none", "save the arrays under these names, see docs/import-isaac.md")
    name = _find_field(opened, present[0])
    if present[0] == NORMAL:
        values = _read_force_field(opened, name, has_environments)
    else:
        values = _read_contact_forces(opened, name, _LEAST_AXES[present[0]])
    time = read_preset_times(opened, len(values), options)
    is_vector = values.ndim == 4
    contact = Direction.SIGNED if is_vector else Direction.RAISES
    header = make_header(SIM, "Isaac Lab", Properties("N", contact.value, modality="other"))
    return header, list(split_environments(values, time, opened.location, options.labels))


def _find_field(opened: Source, name: str) -> str:
    """Return the path of the first field called `name`, such as sensor/net_forces_w; "" if there is none."""
    return next((path for path in opened.fields if path == name or path.endswith(f"/{name}")), "")


def _read_contact_forces(opened: Source, name: str, least: int) -> FloatArray:
    """Return the contact forces, f64[T, e, bodies, 3], of e environments; forces of several filters are summed.

    name: path of the field. least: number of axes of the array without environments, 3, or 4 with filters (other bodies
    of the contact). NaN of a missing filter is taken as 0. Raises DatasetError for another shape.
    """
    array = opened.read_numbers(name).astype(np.float64)
    if array.ndim not in (least, least + 1) or array.shape[-1] != AXES:
        expected = "shape [T, bodies, 3]" if least == 3 else "shape [T, bodies, filters, 3]"
        remedy = "stack the array of every step along a new first axis"
        opened.at(name).fail(f"{expected}, or with environments after T", f"shape {array.shape}", remedy)
    if array.ndim == least:
        array = array[:, None]
    return np.asarray(array if least == 3 else np.nansum(array, axis=3))


def _read_force_field(opened: Source, name: str, has_environments: bool) -> FloatArray:
    """Return a force field of e environments and n points: f64[T, e, n], or f64[T, e, n, 3] with shear forces.

    The force field is that of the visuotactile sensor TacSL of Isaac Lab. name: path of the field with the normal
    forces. Raises DatasetError for another shape.
    """
    normal = opened.read_numbers(name).astype(np.float64)
    if normal.ndim not in (2, 3, 4):
        remedy = "stack the array of every step along a new first axis"
        opened.at(name).fail("shape [T, points], or with environments", f"shape {normal.shape}", remedy)
    split = has_environments or normal.ndim == 4
    if split and normal.ndim == 2:
        opened.at(name).fail("shape [T, e, points]", f"shape {normal.shape}", "leave out --environments")
    lead = normal.shape[:2] if split else (len(normal), 1)
    # product of all axes after T (and after e)
    points = prod(normal.shape[2 if split else 1 :])
    shear_name = _find_field(opened, SHEAR)
    if not shear_name:
        return normal.reshape(*lead, points)
    shear = opened.read_numbers(shear_name).astype(np.float64)
    if shear.shape != (*normal.shape, 2):
        opened.at(shear_name).fail(f"shape {(*normal.shape, 2)}", f"shape {shear.shape}", "save both again")
    return join_components(shear.reshape(*lead, points, 2), normal.reshape(*lead, points))
