"""Genesis: saved arrays of the read() method of tactile sensors.

Layouts and origins (Genesis-Embodied-AI/Genesis, genesis/engine/sensors), stacked over T steps; e: environments:

- KinematicContactProbe: penetration [T, (e,) probes] in metres, force [T, (e,) probes, 3] in the frame of the link;
- KinematicTaxel and ProximityTaxel: force and torque [T, (e,) probes, 3] in the frame of the link;
- ElastomerDisplacement and ElastomerTaxel: one array [T, (e,) probes, 3] of displacements in metres;
- ContactForce: one array [T, (e,) 3].

The probes of a grid can have two axes. The simulator saves no files; the user saves these arrays, under these names if
there are several, in a .npy, .npz, .h5 or .zarr file, and ``time`` [T] in seconds or the frame rate.
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
from taxel.recording.importers.preset import PresetOptions, read_preset_times, split_environments
from taxel.recording.importers.run import make_header
from taxel.recording.importers.sources import open_source

_FIELDS: Final = ("force", "displacement", "penetration", "data")
"""Names of arrays that are imported without the option --field, in this order."""

_UNITS: Final = {"force": "N", "displacement": "m", "penetration": "m"}


def read_genesis(
    path: Path,
    options: PresetOptions,
    field: str | None = None,
    has_environments: bool = False,
    is_scalar: bool = False,
) -> tuple[GeneralHeader, list[Recording]]:
    """Read an array of a Genesis tactile sensor; return (header of the dataset, one recording for each environment).

    field: name of the array; None: the first known name in the file (force, displacement, penetration, data), or the
    only array. A penetration is always scalar. has_environments: whether the second axis is the environment. is_scalar:
    whether a last axis of length 3 counts probes instead of components. Raises DatasetError for a missing array and
    other shapes.
    """
    opened = open_source(path)
    name = field or _choose_array(opened)
    array = opened.read_numbers(name).astype(np.float64)
    lead = 2 if has_environments else 1
    is_vector = array.ndim > lead and array.shape[-1] == AXES and not is_scalar and "penetration" not in name
    if array.ndim < lead + (0 if is_vector else 1) or array.ndim < 2:
        remedy = "stack the result of read() of every step along a new first axis"
        opened.at(name).fail("shape [T, probes] or [T, probes, 3]", f"shape {array.shape}", remedy)
    environments = array.shape[1] if has_environments else 1
    inner = array.shape[lead:-1] if is_vector else array.shape[lead:]
    values = array.reshape(len(array), environments, prod(inner), *((AXES,) if is_vector else ()))
    time = read_preset_times(opened, len(values), options)
    unit = next((unit for key, unit in _UNITS.items() if key in name), None)
    contact = Direction.SIGNED if is_vector else Direction.RAISES
    header = make_header(SIM, "Genesis", Properties(unit, contact.value, modality="other"))
    return header, list(split_environments(values, time, opened.location, options.labels))


def _choose_array(opened: Source) -> str:
    """Return the name of the array to import: the first known name in the file, else that of its only array.

    Raises DatasetError for a file without a known name that has no array or several arrays.
    """
    for name in _FIELDS:
        if name in opened.fields:
            return name
    arrays = [field.name for field in opened.fields.values() if field.is_numeric and len(field.shape) > 1]
    if len(arrays) != 1:
        remedy = f"choose one with --field: {', '.join(arrays[:8])}" if arrays else "save the result of read()"
        opened.location.fail(f"an array {', '.join(_FIELDS[:3])}, or one array", f"{len(arrays)} arrays", remedy)
    return arrays[0]
