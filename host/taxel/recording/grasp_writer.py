"""Writing a grasp dataset, grasp by grasp. What was finished stays readable if the program is killed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from datetime import UTC, datetime
from os import PathLike
from pathlib import Path
from types import TracebackType
from typing import Any

from taxel.hand.errors import format_value
from taxel.recording.grasp_checks import Place, check_choice, check_created, check_text
from taxel.recording.grasp_dataset import GraspDataset
from taxel.recording.grasp_format import FORMAT, MESH, REAL, SENSORS, SIM, TAXELS, VERSION
from taxel.recording.grasp_hdf5 import open_hdf5
from taxel.recording.grasp_record import GraspRecord, checked_arrays, checked_attributes
from taxel.recording.grasp_sensor_model import SensorModel, checked_sensor_model
from taxel.recording.grasp_storage import (
    LIBVER,
    check_target,
    create_file,
    create_grasps_group,
    create_group,
    link_grasp,
    part_of,
    put_in_place,
    write_array,
    write_attributes,
    writing_errors,
)
from taxel.recording.grasp_tables import (
    ObjectMesh,
    SensorTable,
    TaxelTable,
    check_addresses,
    check_name,
    checked_mesh,
    checked_sensors,
    checked_taxels,
)

_ID_DIGITS = 4


class GraspDatasetWriter:
    """A grasp dataset that grows. Use `create` or `extend`, as a context manager.

    Each `add` checks a grasp as the reader would, writes it, and returns when it is part of the file. A program killed
    at any moment leaves a file with the grasps that were finished (see `grasp_storage.py` for how, and for what
    remains); `extend` goes on with it. The same content with the same `created` gives the same bytes.
    """

    def __init__(self, path: Path) -> None:
        """Open a whole dataset to add to it; `create` and `extend` call this."""
        with GraspDataset(path) as data:  # all that stands there must be valid before anything is added
            self._source = data.source
            self._objects = frozenset(data.objects)
            self._sizes = {"n": data.taxels.n, "s": data.sensors.s}
            self._ids = list(data.ids)
        self.path = path
        self._place = Place(str(path))
        self._file = open_hdf5(path, "r+", LIBVER)

    @classmethod
    def create(
        cls,
        path: str | PathLike[str],
        *,
        source: str,
        hand: str,
        taxels: TaxelTable,
        sensors: SensorTable,
        objects: Mapping[str, ObjectMesh],
        generator: str,
        sensor_model: SensorModel | None = None,
        created: str | None = None,
        notes: Mapping[str, str] | None = None,
        overwrite: bool = False,
    ) -> GraspDatasetWriter:
        """Make a dataset without grasps.

        source: "real" or "sim"; a simulated one needs a sensor_model, a real one has none. hand: name of the hand
        description. generator: program and version. created: ISO 8601; None for now. notes: further attributes of the
        file, such as a calibration as JSON. overwrite: replace a file.

        Raises DatasetError for a file that exists (unless overwrite) and for every mistake in the tables.
        """
        target, place = Path(path), Place(str(path))
        check_target(target, overwrite, place)
        header = {
            "format": FORMAT,
            "version": VERSION,
            "source": check_choice(source, (REAL, SIM), place.key("source")),
            "hand": check_text(hand, place.key("hand")),
            "created": check_created(
                datetime.now(UTC).isoformat(timespec="seconds") if created is None else created, place.key("created")
            ),
            "generator": check_text(generator, place.key("generator")),
        }
        header = {**(notes or {}), **header}
        sizes: dict[str, int] = {}
        tables: dict[str, tuple[Any, Mapping[str, Any]]] = {
            "taxels": (checked_taxels(vars(taxels), place.key("taxels"), sizes), TAXELS),
            "sensors": (checked_sensors(vars(sensors), place.key("sensors"), sizes), SENSORS),
        }
        check_addresses(tables["taxels"][0], tables["sensors"][0], place)
        for name, mesh in objects.items():
            here = place.key("objects").key(check_name(name, place.key("objects")))
            tables[f"objects/{name}"] = (checked_mesh(vars(mesh), here), MESH)
        model = _checked_model(sensor_model, source, place.key("sensor_model"), sizes["n"])
        part = part_of(target)
        with writing_errors(place):
            _write_new(part, header, tables, model)
            put_in_place(part, target, overwrite, place)
        return cls(target)

    @classmethod
    def extend(cls, path: str | PathLike[str]) -> GraspDatasetWriter:
        """Go on with a dataset, such as one from a campaign that was cut; its grasps are kept.

        Raises DatasetError for a file that the reader refuses.
        """
        target = Path(path)
        part_of(target).unlink(missing_ok=True)
        return cls(target)

    @property
    def ids(self) -> tuple[str, ...]:
        """Ids of the grasps that the file has, in order of time."""
        return tuple(self._ids)

    def add_object(self, name: str, mesh: ObjectMesh) -> None:
        """Add an object for the grasps that follow. A kill while this runs, unlike `add`, may cost the file: name the
        objects in `create` wherever they are known. Raises DatasetError for a name that is there, or a bad mesh.
        """
        place = self._place.key("objects")
        here = place.key(check_name(name, place))
        if name in self._objects:
            here.fail("a new name", "one that is there", "leave it out, or choose another name")
        table = checked_mesh(vars(mesh), here)
        with writing_errors(here):
            group = create_group(self._file["objects"], name)
            for key in MESH:
                write_array(group, key, getattr(table, key))
        self._objects |= {name}

    def add(self, grasp: GraspRecord, grasp_id: str | None = None) -> str:
        """Check and write one grasp; returns its id once the file holds it.

        grasp_id: sorts after all ids so far; None for the next number, such as "0007".

        Raises DatasetError, and leaves the file as it was, for anything that the reader would refuse.
        """
        grasps = self._place.key("grasps")
        if not self._file:
            self._place.fail("an open dataset", "a closed one", "use it inside its with block")
        name = check_name(f"{len(self._ids) + 1:0{_ID_DIGITS}}" if grasp_id is None else grasp_id, grasps)
        if self._ids and name <= self._ids[-1]:
            expected = f"an id that sorts after {format_value(self._ids[-1])}"
            grasps.key(name).fail(expected, format_value(name), "ids sort in order of time; give a grasp_id")
        place = grasps.key(name)
        attributes = checked_attributes(grasp, self._objects, place)
        arrays = checked_arrays(grasp, self._source, self._sizes, place)
        with writing_errors(place):
            group = create_group(self._file, None)
            write_attributes(group, attributes)
            for key, array in arrays.items():
                write_array(group, key, array)
            link_grasp(self._file, group, name)
        self._ids.append(name)
        return name

    def close(self) -> None:
        """Close the file; closing again is harmless."""
        self._file.close()

    def __enter__(self) -> GraspDatasetWriter:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def _checked_model(model: SensorModel | None, source: str, place: Place, n: int) -> SensorModel | None:
    if (model is None) == (source == SIM):
        if model is None:
            place.fail("a sensor model", "none", "a simulated dataset states how force became counts")
        place.fail('none where source = "real"', "one", "leave it out or correct the source")
    return None if model is None else checked_sensor_model(vars(model), place, n)


def _write_new(path: Path, header: Mapping[str, Any], tables: Mapping[str, Any], model: SensorModel | None) -> None:
    with create_file(path) as file:
        create_grasps_group(file)
        write_attributes(file, header)
        groups = {"": file}
        for name in ("taxels", "sensors", "objects", *(key for key in tables if "/" in key)):
            parent, _, leaf = name.rpartition("/")
            groups[name] = create_group(groups[parent], leaf)
            if name in tables:
                table, specs = tables[name]
                for key in specs:
                    write_array(groups[name], key, getattr(table, key))
        if model is not None:
            values = {field.name: getattr(model, field.name) for field in fields(model)}
            given = {name: value for name, value in values.items() if value is not None}
            write_attributes(create_group(file, "sensor_model"), given)
