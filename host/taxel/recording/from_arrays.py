"""Conversion of plain NumPy arrays, or of an .npz file of arrays, into a grasp dataset.

The names of the arrays are the paths of the format page without the leading slash. Attributes are 0-d arrays or plain
values:

    source, hand, created, generator                            strings; created and generator are optional
    taxels/sensor, taxels/tx, taxels/rx, taxels/position, taxels/normal, taxels/size
    sensors/address, sensors/name, sensors/kind, sensors/rate_hz
    objects/<name>/vertices, objects/<name>/faces
    sensor_model/baseline_counts, ...                           only with source = "sim"
    grasps/<id>/object, grasps/<id>/approach, grasps/<id>/iteration, grasps/<id>/session
    grasps/<id>/timestamp, grasps/<id>/raw_counts, ...          as on the format page

``np.savez("x.npz", **arrays)`` writes such a file: the names may contain slashes. Dictionaries may be nested:
``{"taxels": {"sensor": ...}}``.
"""

import difflib
from collections.abc import Callable, Iterable, Iterator, Mapping
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from taxel.hand.errors import format_value
from taxel.input_files.numpy_archive import ArchiveError, NumpyArchive
from taxel.recording.grasp_checks import Location
from taxel.recording.grasp_format import (
    GRASP,
    GRASP_ATTRIBUTES,
    LARGEST_ARRAY_BYTES,
    MESH,
    OPTIONAL_GRASP_ATTRIBUTES,
    ROOT_ATTRIBUTES,
    SENSORS,
    TAXELS,
)
from taxel.recording.grasp_record import GraspRecord
from taxel.recording.grasp_sensor_model import OPTIONAL, REQUIRED, SensorModel
from taxel.recording.grasp_storage import open_whole_dataset
from taxel.recording.grasp_tables import ObjectMesh, SensorTable, TaxelTable
from taxel.recording.grasp_writer import DatasetHeader, GraspDatasetWriter

GENERATOR = "taxel from_arrays"

_GROUPS: Mapping[str, tuple[str, ...]] = {
    "taxels": tuple(TAXELS),
    "sensors": tuple(SENSORS),
    "sensor_model": REQUIRED + OPTIONAL,
}
_GROUPS_OF_GROUPS: Mapping[str, tuple[str, ...]] = {
    "objects": tuple(MESH),
    "grasps": GRASP_ATTRIBUTES + OPTIONAL_GRASP_ATTRIBUTES + tuple(GRASP),
}


def write_from_arrays(
    path: str | PathLike[str], arrays: Mapping[str, Any] | str | PathLike[str], *, overwrite: bool = False
) -> None:
    """Write a grasp dataset from arrays, or from an .npz file of arrays.

    arrays: arrays and values by their path in the dataset, such as "taxels/position", or the path of the .npz file.
    Grasps are written in the order of their ids. An .npz file is read grasp by grasp and without pickle.

    Raises DatasetError for the first error: an unknown name, a missing name, or a value that the reader would reject.
    For an .npz file that cannot be read, the error names this file.
    """
    if not isinstance(arrays, Mapping):
        with _Npz(Path(arrays)) as values:
            _write(path, values, overwrite)
        return
    flat = dict(_flatten(arrays, ""))
    _write(path, _Values(flat.keys(), flat.__getitem__, Location(str(path))), overwrite)


class _Values:
    """Arrays of a dataset by name, from a mapping or a file.

    Raises DatasetError for an unknown name at construction, and for a missing name on access.
    """

    def __init__(self, names: Iterable[object], read: Callable[[str], Any], location: Location) -> None:
        """Check the names of a source's arrays; the arrays themselves are read on access.

        names: names of all arrays. read: function that returns the array with a name. Raises DatasetError for a name
        that the grasp format does not define.
        """
        self.location = location
        self._names = sorted(str(name) for name in names)
        self._read = read
        checked: set[str] = set()
        for name in self._names:
            if name not in checked and not _is_format_name(name):
                self.location.key(name).fail("a name of the format", "an unknown one", _suggest_names(name))
            checked.add(name)

    def ids(self, group: str) -> list[str]:
        """Return the sorted names of the subgroups of `group`, "objects" or "grasps"."""
        return sorted({name.split("/")[1] for name in self._names if name.startswith(f"{group}/")})

    def has_group(self, group: str) -> bool:
        """Whether there is an array or value in the group `group`."""
        return any(name.startswith(f"{group}/") for name in self._names)

    def get(self, name: str, required: bool = True) -> Any:
        """Return the array or value called `name`; a 0-d array becomes a plain value.

        Returns None for an absent value that is not required. Raises DatasetError for an absent value that is required.
        """
        if name not in self._names:
            if required:
                self.location.key(name).fail("a value", "nothing", "add it to the arrays")
            return None
        value = self._read(name)
        # np.str_ is a str; 0-d arrays of strings and numbers become scalars here.
        return value[()] if isinstance(value, np.ndarray) and value.ndim == 0 else value

    def table(self, group: str, names: tuple[str, ...]) -> dict[str, Any]:
        """Return the arrays `names` of the table `group`, by name. Raises DatasetError for a missing array."""
        return {name: self.get(f"{group}/{name}") for name in names}


class _Npz:
    """An open .npz file, whose arrays are read on access."""

    def __init__(self, path: Path) -> None:
        """Open an .npz file, whose arrays are then read on access; raise DatasetError if the path is no such file."""
        self._location = Location(str(path))
        if not path.is_file():
            self._location.fail("an .npz file", "a folder" if path.is_dir() else "nothing", "check the path")
        try:
            self._archive = NumpyArchive(path)
        except (ArchiveError, OSError) as error:
            self._location.fail("an .npz file", format_value(str(error)), "write it with numpy.savez")

    def __enter__(self) -> _Values:
        return _Values(self._archive.names, self._read_array, self._location)

    def __exit__(self, *_: object) -> None:
        """Close the .npz file at the end of the `with` block."""
        self._archive.close()

    def _read_array(self, name: str) -> Any:
        """Read one array of the .npz file. Raises DatasetError for a damaged, truncated or too large array."""
        location = self._location.key(name)
        try:
            return self._archive.read(name, LARGEST_ARRAY_BYTES)
        except ArchiveError as error:
            location.fail("a plain array", format_value(str(error)), "store numbers or texts, without Python objects")


def _write(path: str | PathLike[str], values: _Values, overwrite: bool) -> None:
    """Write the arrays to a temporary dataset file, which then replaces `path`. Raises DatasetError."""
    with open_whole_dataset(path, overwrite) as part:
        _write_dataset(part, values)


def _write_dataset(path: Path, values: _Values) -> None:
    """Write header, tables and grasps of a dataset from the named values to the empty file `path`."""
    attributes = {name: values.get(name, required=name in ("source", "hand")) for name in ROOT_ATTRIBUTES}
    if attributes["generator"] is None:
        attributes["generator"] = GENERATOR
    model = None
    if values.has_group("sensor_model"):
        required = values.table("sensor_model", REQUIRED)
        optional = {name: values.get(f"sensor_model/{name}", required=False) for name in OPTIONAL}
        model = SensorModel(**required, **{name: value for name, value in optional.items() if value is not None})
    if not values.has_group("objects"):
        values.location.key("objects").fail("at least one object", "nothing", "add objects/<name>/vertices and faces")
    header = DatasetHeader(
        **attributes,
        taxels=TaxelTable(**values.table("taxels", tuple(TAXELS))),
        sensors=SensorTable(**values.table("sensors", tuple(SENSORS))),
        objects={name: ObjectMesh(**values.table(f"objects/{name}", tuple(MESH))) for name in values.ids("objects")},
        sensor_model=model,
    )
    with GraspDatasetWriter.create_part(path, header) as out:
        for grasp_id in values.ids("grasps"):
            fields = {name: values.get(f"grasps/{grasp_id}/{name}") for name in GRASP_ATTRIBUTES}
            names = (*OPTIONAL_GRASP_ATTRIBUTES, *GRASP)
            arrays = {name: values.get(f"grasps/{grasp_id}/{name}", required=False) for name in names}
            out.add(GraspRecord(**fields, **arrays), grasp_id)


def _flatten(arrays: Mapping[str, Any], prefix: str) -> Iterator[tuple[str, Any]]:
    """Yield (path, value) for each value of nested mappings; a path joins the keys by "/".

    prefix: start of each path.
    """
    for name, value in arrays.items():
        if isinstance(value, Mapping):
            yield from _flatten(value, f"{prefix}{name}/")
        else:
            yield f"{prefix}{name}", value


def _is_format_name(name: str) -> bool:
    """Whether the dataset format defines this name, such as "taxels/position" or "grasps/0001/phase"."""
    parts = name.split("/")
    if len(parts) == 1:
        return name in ROOT_ATTRIBUTES
    if len(parts) == 2:
        return parts[1] in _GROUPS.get(parts[0], ())
    return len(parts) == 3 and bool(parts[1]) and parts[2] in _GROUPS_OF_GROUPS.get(parts[0], ())


def _suggest_names(name: str) -> str:
    """Return the remedy in the message about an unknown name: the most similar name, or all names of its group.

    The group is the part of the name before the slash, such as "taxels".
    """
    group, _, leaf = name.rpartition("/")
    kind = group.split("/")[0]
    leaves = _GROUPS.get(kind) or _GROUPS_OF_GROUPS.get(kind) or ROOT_ATTRIBUTES
    near = difflib.get_close_matches(leaf[:64], leaves, n=1)
    return f"did you mean {near[0]}?" if near else f"use one of {', '.join(leaves)}"
