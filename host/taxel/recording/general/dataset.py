"""Reader of grasp datasets of version 2; datasets of version 1 are converted to the contents of version 2."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from os import PathLike
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from taxel.hand.errors import format_value
from taxel.recording.general.checks import check_contact, check_header
from taxel.recording.general.format import (
    DEFAULT_APPROACH,
    DEFAULT_OBJECT,
    VERSION,
    Contact,
    Direction,
    GeneralHeader,
    Properties,
    TaxelPlaces,
)
from taxel.recording.general.hdf5_fields import (
    check_links,
    decode_text,
    read_flags,
    read_floats,
    read_integer,
    read_integers,
    read_number,
    read_text,
)
from taxel.recording.grasp_checks import Location
from taxel.recording.grasp_dataset import GraspDataset
from taxel.recording.grasp_format import FORMAT, SIM, Phase
from taxel.recording.grasp_hdf5 import convert_hdf5_errors, open_hdf5
from taxel.recording.grasp_tables import ObjectMesh

_ALIASES: Final = {"time": ("time", "timestamp", "t"), "values": ("values", "raw_counts", "data")}
"""Names under which a required array is accepted."""

_LEVELS: Final = 3
"""Levels of groups with data: the root group of the file, its subgroups, and their subgroups."""


def read_version(path: str | PathLike[str]) -> int:
    """Return the version number of a grasp dataset. Raises DatasetError for a file in another format."""
    location = Location(str(path))
    with open_hdf5(Path(path), "r") as file, convert_hdf5_errors(location):
        name, version = file.attrs.get("format", ""), file.attrs.get("version", 0)
        if (name.decode() if isinstance(name, bytes) else name) != FORMAT:
            remedy = "import the file with taxel import, or see docs/dataset-format.md"
            location.key("format").fail(format_value(FORMAT), format_value(name), remedy)
        return read_integer({"version": version}, "version", 0, location)


def read_source(path: str | PathLike[str]) -> str:
    """Return the declared source of a grasp dataset, "real" or "sim"; "" if none is declared. Raises DatasetError."""
    read_version(path)
    with open_hdf5(Path(path), "r") as file:
        return read_text(file.attrs, "source", "", Location(str(path)))


def read_hand_name(path: str | PathLike[str]) -> str:
    """Return the name of a grasp dataset's hand; "" if none is declared. Raises DatasetError."""
    read_version(path)
    with open_hdf5(Path(path), "r") as file:
        return read_text(file.attrs, "hand", "", Location(str(path)))


class GeneralDataset:
    """A dataset of version 2 or 1, open for reading. A context manager; iteration gives each `Contact` in order.

    header: everything except the contacts. ids: ids of the contacts, sorted. n: number of taxels. is_vector: whether
    the value of a taxel has 3 components. version: format version of the file, 1 or 2. Raises DatasetError for the
    first deviation from the format.
    """

    def __init__(self, path: str | PathLike[str]) -> None:
        """Open a dataset and check everything except the arrays of its contacts."""
        self.path = Path(path)
        self._location = Location(str(path))
        self.version = read_version(path)
        self._old: GraspDataset | None = None
        self._file: Any = None
        if self.version == 1:
            self._old = GraspDataset(path)
            self.header = _convert_header(self._old)
            self.ids, self.n, self.is_vector = self._old.ids, self._old.taxels.n, False
            return
        if self.version != VERSION:
            remedy = "use a taxel release that reads that file"
            self._location.key("version").fail("1 or 2", str(self.version), remedy)
        self._file = open_hdf5(self.path, "r")
        try:
            with convert_hdf5_errors(self._location):
                self._read_tables()
        except BaseException:
            self.close()
            raise

    def _read_tables(self) -> None:
        """Read and check the header of a version 2 file, and set `ids`, `n` and `is_vector`.

        n and is_vector come from the values of the first contact.
        """
        check_links(self._file, self._location, _LEVELS)
        grasps = self._file.get("grasps")
        self.ids = tuple(sorted(grasps)) if grasps is not None else ()
        if not self.ids:
            self._location.key("grasps").fail("at least one contact", "none", "write a group for each contact")
        shape = self._find(self.ids[0], "values").shape
        self.n, self.is_vector = int(shape[1]) if len(shape) > 1 else 0, len(shape) == 3
        attrs = self._file.attrs
        location = self._location
        declared: dict[str, Any] = {
            name: read_text(attrs, name, "", location) for name in ("unit", "contact", "modality") if name in attrs
        }
        declared |= {name: read_number(attrs, name, location) for name in ("full_scale", "resolution") if name in attrs}
        self.header = GeneralHeader(
            source=read_text(attrs, "source", "", location),
            sensor=read_text(attrs, "sensor", "sensor", location),
            generator=read_text(attrs, "generator", "unknown", location),
            properties=Properties(**declared),
            places=self._read_places(),
            sensor_names=self._read_sensor_names(),
            objects=self._read_objects(),
        )
        check_header(self.header, self.n, self._location)

    def _read_places(self) -> TaxelPlaces:
        """Read the optional arrays of taxel properties: sensor, electrode lines, position, normal and size."""
        taxels, location = self._file.get("taxels", {}), self._location.key("taxels")
        places: dict[str, Any] = {
            name: read_integers(taxels[name], location.key(name)) for name in ("sensor", "tx", "rx") if name in taxels
        }
        names = ("position", "normal", "size")
        places |= {name: read_floats(taxels[name], location.key(name)) for name in names if name in taxels}
        return TaxelPlaces(**places)

    def _read_sensor_names(self) -> tuple[str, ...]:
        """Read the names of the sensors; empty if the file has none. Raises DatasetError for another type."""
        names = getattr(self._file.get("taxels"), "attrs", {}).get("sensor_names", ())
        location = self._location.key("taxels").key("sensor_names")
        if np.ndim(names) != 1:
            location.fail("a list of names", format_value(names), "store one string for each sensor")
        return tuple(decode_text(name, location) for name in names)

    def _read_objects(self) -> dict[str, ObjectMesh]:
        """Read the meshes of the objects by name. Raises DatasetError for a face without its vertices."""
        meshes = {}
        for name, group in self._file.get("objects", {}).items():
            location = self._location.key("objects").key(name)
            vertices = read_floats(group["vertices"], location.key("vertices"))
            faces = read_integers(group["faces"], location.key("faces"))
            is_index = (faces >= 0) & (faces < len(vertices))
            if vertices.ndim != 2 or not np.isfinite(vertices).all() or not is_index.all():
                location.fail("finite vertices [V, 3], and faces of their rows", "others", "write the mesh again")
            meshes[name] = ObjectMesh(vertices, faces.astype(np.int32))
        return meshes

    def __iter__(self) -> Iterator[Contact]:
        """Yield each contact in the order of ids.

        If the file has no repeat numbers, the repeats of a condition (object and approach) are numbered from 0.
        """
        seen: Counter[tuple[str, str]] = Counter()
        for name in self.ids:
            contact = self._convert_grasp(name) if self._old is not None else self._read(name, seen)
            seen[contact.object, contact.approach] += 1
            yield contact

    def __len__(self) -> int:
        return len(self.ids)

    def _find(self, contact_id: str, name: str) -> Any:
        """Return the HDF5 dataset of a required array of a contact, under any of its accepted names.

        name: key of `_ALIASES`. Raises DatasetError if the contact has none of the names.
        """
        group = self._file["grasps"][contact_id]
        for alias in _ALIASES[name]:
            if alias in group:
                return group[alias]
        location = self._location.key("grasps").key(contact_id)
        return location.fail(f"an array {name}", "none", "see docs/dataset-format.md for the required fields")

    def _read(self, contact_id: str, seen: Counter[tuple[str, str]]) -> Contact:
        """Read and check one contact of a version 2 file.

        seen: number of earlier contacts with each (object, approach). A contact without a repeat number in the file
        gets the number of earlier contacts with its labels. Force and separation are read only from simulated data.
        Raises DatasetError.
        """
        location = self._location.key("grasps").key(contact_id)
        with convert_hdf5_errors(location):
            group = self._file["grasps"][contact_id]
            if "session" not in group.attrs:
                location.key("session").fail("the number of a session", "none", "number the days or the mountings")
            labels = (
                read_text(group.attrs, "object", DEFAULT_OBJECT, location),
                read_text(group.attrs, "approach", DEFAULT_APPROACH, location),
            )
            arrays: dict[str, Any] = {
                name: read_floats(group[name], location.key(name))
                for name in ("force", "separation", "sensor_pose", "object_pose")
                if name in group
            }
            contact = Contact(
                id=contact_id,
                session=read_integer(group.attrs, "session", 0, location),
                time=read_floats(self._find(contact_id, "time"), location.key("time")),
                values=read_floats(self._find(contact_id, "values"), location.key("values")),
                object=labels[0],
                approach=labels[1],
                iteration=read_integer(group.attrs, "iteration", seen[labels], location),
                phase=_read_phase(group, location),
                valid=_read_valid(group, location),
                force=arrays.get("force") if self.header.source == SIM else None,
                separation=arrays.get("separation") if self.header.source == SIM else None,
                sensor_pose=arrays.get("sensor_pose"),
                object_pose=arrays.get("object_pose"),
            )
        check_contact(contact, self.n, self.is_vector, location)
        return contact

    def _convert_grasp(self, contact_id: str) -> Contact:
        """Return a grasp of a version 1 file as a contact; counts of a frame that did not arrive become NaN."""
        assert self._old is not None
        grasp = self._old[contact_id]
        index = self._old.sensors.index_of(self._old.taxels)
        values = np.where(grasp.valid[:, index], grasp.raw_counts.astype(np.float64), np.nan)
        return Contact(
            id=grasp.id,
            session=grasp.session,
            time=grasp.timestamp,
            values=values,
            object=grasp.object,
            approach=grasp.approach,
            iteration=grasp.iteration,
            phase=grasp.phase,
            force=grasp.contact_force,
            separation=grasp.separation,
            sensor_pose=grasp.sensor_pose,
            object_pose=grasp.object_pose,
        )

    def close(self) -> None:
        """Close the dataset. A second call has no effect."""
        for file in (self._old, self._file):
            if file is not None:
                file.close()

    def __enter__(self) -> GeneralDataset:
        return self

    def __exit__(self, *_: object) -> None:
        """Close the dataset at the end of the `with` block."""
        self.close()


def _convert_header(old: GraspDataset) -> GeneralHeader:
    """Convert the header of a version 1 dataset, whose values are capacitive counts that contact lowers."""
    taxels = old.taxels
    index = old.sensors.index_of(taxels)
    places = TaxelPlaces(
        index, taxels.tx.astype(np.int64), taxels.rx.astype(np.int64), taxels.position, taxels.normal, taxels.size
    )
    properties = Properties("counts", Direction.LOWERS.value, None, 1.0, "capacitive")
    return GeneralHeader(
        old.source, old.hand, old.generator, properties, places, tuple(old.sensors.name), dict(old.objects)
    )


def _read_phase(group: Any, location: Location) -> NDArray[np.uint8] | None:
    """Read the phases of a contact, u8[T]; None without them. Raises DatasetError for a number that is no phase."""
    if "phase" not in group:
        return None
    phase = read_integers(group["phase"], location.key("phase"))
    if phase.size and not 0 <= phase.min() <= phase.max() <= max(Phase):
        location.key("phase").fail("0 to 4", f"{phase.min()} to {phase.max()}", "see docs/dataset-format.md")
    return phase.astype(np.uint8)


def _read_valid(group: Any, location: Location) -> NDArray[np.bool_] | None:
    """Read whether each frame is valid, bool[T]; None without this array.

    The array is bool[T], or bool[T, s] with one entry for each sensor: a frame is valid if any sensor is valid.
    """
    if "valid" not in group:
        return None
    flags = read_flags(group["valid"], location.key("valid"))
    return np.asarray(flags if flags.ndim != 2 else flags.any(axis=1))
