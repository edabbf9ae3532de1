"""Writer of a grasp dataset, grasp by grasp. Completed grasps stay readable if the program is killed."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field, fields
from datetime import UTC, datetime
from os import PathLike
from pathlib import Path
from types import MappingProxyType, TracebackType
from typing import Any

from taxel.hand.errors import format_value
from taxel.output import LiveOutput
from taxel.recording.grasp_checks import Location, check_choice, check_created, check_text
from taxel.recording.grasp_dataset import GraspDataset
from taxel.recording.grasp_format import FORMAT, MESH, REAL, SENSORS, SIM, TAXELS, VERSION
from taxel.recording.grasp_record import GraspRecord, check_arrays, check_attributes
from taxel.recording.grasp_sensor_model import SensorModel, check_sensor_model
from taxel.recording.grasp_storage import (
    check_target,
    convert_writing_errors,
    create_grasps_group,
    create_group,
    link_grasp,
    write_array,
    write_attributes,
)
from taxel.recording.grasp_tables import (
    ObjectMesh,
    SensorTable,
    TaxelTable,
    check_addresses,
    check_mesh,
    check_name,
    check_sensors,
    check_taxels,
)
from taxel.recording.hdf5_output import WritableFile, create_hdf5, extend_hdf5

_ID_DIGITS = 4


@dataclass(frozen=True, eq=False)
class DatasetHeader:
    """All content of a grasp dataset except the grasps.

    source: "real" or "sim". hand: name of the hand description. objects: meshes by name. generator: program and
    version. sensor_model: required for a simulated dataset, None for a real one. created: ISO 8601; None: the current
    time. notes: further attributes of the file, such as a calibration as JSON.
    """

    source: str
    hand: str
    taxels: TaxelTable
    sensors: SensorTable
    objects: Mapping[str, ObjectMesh]
    generator: str
    sensor_model: SensorModel | None = None
    created: str | None = None
    notes: Mapping[str, str] = field(default_factory=lambda: MappingProxyType({}))


class GraspDatasetWriter:
    """A grasp dataset to which grasps are added. A context manager; construct it with `create` or `extend`.

    `add` checks a grasp as the reader does, writes it, and returns when the grasp is part of the file. A program that
    is killed leaves a file with the completed grasps (see `grasp_storage.py` for the method and its limits), to which
    `extend` can add further ones. The same content with the same `created` gives the same bytes.
    """

    def __init__(self, output: LiveOutput, is_live: bool = True) -> None:
        """Open a complete dataset file to add grasps; called by the class methods.

        output: the locked file. is_live: each grasp is flushed to the disk. Raises DatasetError for a file with errors.
        """
        self.path = output.path
        self._output, self._is_live = output, is_live
        self._location = Location(str(self.path))
        # A file with errors is rejected before it is open for writing.
        with GraspDataset.from_file(extend_hdf5(output, self._location, is_read_only=True), self.path) as data:
            self._source = data.source
            self._objects = frozenset(data.objects)
            self._sizes = {"n": data.taxels.n, "s": data.sensors.s}
            self._ids = list(data.ids)
        self._file = extend_hdf5(output, self._location)

    @classmethod
    def create(cls, path: str | PathLike[str], header: DatasetHeader, *, overwrite: bool = False) -> GraspDatasetWriter:
        """Create a dataset without grasps that is readable while grasps are added.

        overwrite: replace an existing file, which is preserved as `.NAME.previous` from the first grasp to `close`.
        Raises DatasetError for an existing file (unless overwrite) and for the first error in the header.
        """
        target, location = Path(path), Location(str(path))
        check_target(target, overwrite, location)
        content = _HeaderContent(header, location)
        with convert_writing_errors(location):
            output = LiveOutput(target, overwrite=overwrite)
        try:
            with convert_writing_errors(location):
                content.write(output)
            writer = cls(output)
            with convert_writing_errors(location):
                output.begin()
        except BaseException:
            output.discard()
            raise
        return writer

    @classmethod
    def create_part(cls, part: Path, header: DatasetHeader) -> GraspDatasetWriter:
        """Create a dataset without grasps in an empty temporary file of `open_whole_dataset`; raises DatasetError.

        Grasps are not flushed to the disk one by one, because no program reads the file before it is complete.
        """
        location = Location(str(part))
        content = _HeaderContent(header, location)
        with convert_writing_errors(location):
            output = LiveOutput.without_name(part)
            content.write(output)
        return cls(output, is_live=False)

    @classmethod
    def extend(cls, path: str | PathLike[str]) -> GraspDatasetWriter:
        """Open an existing dataset, such as one from an interrupted campaign, to add grasps; its grasps are kept.

        Raises DatasetError for a file that the reader rejects, or that another program writes.
        """
        location = Location(str(path))
        if not Path(path).is_file():
            location.fail("an HDF5 file", "a folder" if Path(path).is_dir() else "nothing", "check the path")
        with convert_writing_errors(location):
            output = LiveOutput.extend(path)
        try:
            return cls(output)
        except BaseException:
            output.fail()
            raise

    @property
    def ids(self) -> tuple[str, ...]:
        """Ids of the grasps in the file, in order of time."""
        return tuple(self._ids)

    def add_object(self, name: str, mesh: ObjectMesh) -> None:
        """Add an object for later grasps. Raises DatasetError for an existing name or an invalid mesh.

        Unlike `add`, this method may leave an unreadable file if the program is killed meanwhile. Therefore put objects
        that are known beforehand into the header.
        """
        location = self._location.key("objects")
        object_location = location.key(check_name(name, location))
        if name in self._objects:
            object_location.fail("a new name", "an existing one", "leave the object out, or choose another name")
        table = check_mesh(vars(mesh), object_location)
        with convert_writing_errors(object_location):
            group = create_group(self._file["objects"], name)
            for key in MESH:
                write_array(group, key, getattr(table, key))
        self._objects |= {name}

    def add(self, grasp: GraspRecord, grasp_id: str | None = None) -> str:
        """Check and write one grasp; return its id when the grasp is part of the file.

        grasp_id: must sort after all ids of the file; None: the next number, such as "0007".

        Raises DatasetError, and leaves the file unchanged, for a grasp that the reader would reject.
        """
        grasps = self._location.key("grasps")
        if not self._file:
            self._location.fail("an open dataset", "a closed one", "use it inside its with block")
        name = check_name(f"{len(self._ids) + 1:0{_ID_DIGITS}}" if grasp_id is None else grasp_id, grasps)
        if self._ids and name <= self._ids[-1]:
            expected = f"an id that sorts after {format_value(self._ids[-1])}"
            grasps.key(name).fail(expected, format_value(name), "ids sort in order of time; give a grasp_id")
        location = grasps.key(name)
        attributes = check_attributes(grasp, self._objects, location)
        arrays = check_arrays(grasp, self._source, self._sizes, location)
        with convert_writing_errors(location):
            group = create_group(self._file, None)
            write_attributes(group, attributes)
            for key, array in arrays.items():
                write_array(group, key, array)
            link_grasp(self._file, group, name, is_durable=self._is_live)
            self._output.publish()
        self._ids.append(name)
        return name

    def close(self) -> None:
        """Close the grasp dataset. A second call has no effect.

        Raises DatasetError if the system refused a write. The complete grasps are then still in the file, and the
        file that this dataset replaces is kept as `.NAME.previous`.
        """
        if self._output.file.closed:
            return
        try:
            with convert_writing_errors(self._location):
                self._file.close()
                self._output.close()
        finally:
            self._output.fail()  # does nothing after a successful close

    def __enter__(self) -> GraspDatasetWriter:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close the grasp dataset at the end of the `with` block.

        After an exception, a dataset without grasps does not replace an existing file.
        """
        if kind is None or self._output.is_published:
            self.close()
            return
        with suppress(OSError):
            self._file.close()
        self._output.discard()


class _HeaderContent:
    """The checked content of a new dataset file without grasps."""

    def __init__(self, header: DatasetHeader, location: Location) -> None:
        """Check a header, and convert it to attributes and tables. Raises DatasetError for the first error."""
        self._attributes = _check_attributes(header, location)
        sizes: dict[str, int] = {}
        self._tables = _check_tables(header, location, sizes)
        self._model = _check_model(header.sensor_model, header.source, location.key("sensor_model"), sizes["n"])

    def write(self, output: LiveOutput) -> None:
        """Write the content to an empty output."""
        with create_hdf5(output) as file:
            _write_content(file, self._attributes, self._tables, self._model)


def _check_attributes(header: DatasetHeader, location: Location) -> dict[str, Any]:
    """Return the attributes of the root group of a dataset. Raises DatasetError for an invalid value of the header."""
    created = datetime.now(UTC).isoformat(timespec="seconds") if header.created is None else header.created
    return {
        **header.notes,
        "format": FORMAT,
        "version": VERSION,
        "source": check_choice(header.source, (REAL, SIM), location.key("source")),
        "hand": check_text(header.hand, location.key("hand")),
        "created": check_created(created, location.key("created")),
        "generator": check_text(header.generator, location.key("generator")),
    }


def _check_tables(
    header: DatasetHeader, location: Location, sizes: dict[str, int]
) -> dict[str, tuple[Any, Mapping[str, Any]]]:
    """Check the tables of a dataset's header; return {HDF5 path: (table, specification of its arrays)}.

    sizes: the numbers n of taxels and s of sensors are added. Raises DatasetError for the first error.
    """
    tables: dict[str, tuple[Any, Mapping[str, Any]]] = {
        "taxels": (check_taxels(vars(header.taxels), location.key("taxels"), sizes), TAXELS),
        "sensors": (check_sensors(vars(header.sensors), location.key("sensors"), sizes), SENSORS),
    }
    check_addresses(tables["taxels"][0], tables["sensors"][0], location)
    for name, mesh in header.objects.items():
        object_location = location.key("objects").key(check_name(name, location.key("objects")))
        tables[f"objects/{name}"] = (check_mesh(vars(mesh), object_location), MESH)
    return tables


def _check_model(model: SensorModel | None, source: str, location: Location, n: int) -> SensorModel | None:
    """Return the checked sensor model, which a simulated dataset must have and a real dataset must not have.

    source: "real" or "sim". n: number of taxels. Raises DatasetError.
    """
    if (model is None) == (source == SIM):
        if model is None:
            location.fail("a sensor model", "none", "a simulated dataset states how force became counts")
        location.fail('none where source = "real"', "one", "leave it out or correct the source")
    return None if model is None else check_sensor_model(vars(model), location, n)


def _write_content(
    file: WritableFile, attributes: Mapping[str, Any], tables: Mapping[str, Any], model: SensorModel | None
) -> None:
    """Write attributes, tables, sensor model and an empty group of grasps to an empty HDF5 file.

    tables: (table, specification of its arrays) by HDF5 path.
    """
    create_grasps_group(file)
    write_attributes(file, attributes)
    groups = {"": file}
    for name in ("taxels", "sensors", "objects", *(key for key in tables if "/" in key)):
        parent, _, leaf = name.rpartition("/")
        groups[name] = create_group(groups[parent], leaf)
        if name in tables:
            table, specs = tables[name]
            for key in specs:
                write_array(groups[name], key, getattr(table, key))
    if model is not None:
        values = {item.name: getattr(model, item.name) for item in fields(model)}
        present = {name: value for name, value in values.items() if value is not None}
        write_attributes(create_group(file, "sensor_model"), present)
