"""Reader of a grasp dataset: one HDF5 file of a real, an emulated or a simulated hand."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from os import PathLike
from pathlib import Path
from types import MappingProxyType, TracebackType
from typing import Any

import numpy as np

from taxel.hand.errors import format_value
from taxel.recording.grasp import Grasp
from taxel.recording.grasp_checks import Location, check_choice, check_created, check_text
from taxel.recording.grasp_format import FORMAT, MESH, REAL, SENSORS, SIM, TAXELS, VERSION
from taxel.recording.grasp_hdf5 import Node, open_hdf5, scalar
from taxel.recording.grasp_sensor_model import OPTIONAL, REQUIRED, SensorModel, check_sensor_model
from taxel.recording.grasp_tables import (
    ObjectMesh,
    SensorTable,
    TaxelTable,
    check_addresses,
    check_mesh,
    check_sensors,
    check_taxels,
)
from taxel.types import IntArray


class GraspDataset:
    """A grasp dataset, open for reading. A context manager.

    path: the HDF5 file. baseline_frames: raise DatasetError if a grasp has fewer, see `require_baseline`; 0: no check.

    Opening checks the attributes, the tables, and the type and shape of every array. The values of a grasp's arrays are
    read and checked on first use, or all together by `check`. Iteration gives each `Grasp` in order of time.

    Raises DatasetError for the first deviation from the format, as one line with the file and the field. A file without
    a grasp, such as one from a campaign that was interrupted at its start, is valid.
    """

    def __init__(self, path: str | PathLike[str], baseline_frames: int = 0) -> None:
        """Open a grasp dataset (HDF5) for reading and check its structure, but not yet the values of its arrays.

        baseline_frames: smallest number of baseline frames that each grasp must have; 0: not checked. Raises
        DatasetError for the first deviation from the format.
        """
        self._open(Path(path), open_hdf5(Path(path), "r"), baseline_frames)

    @classmethod
    def from_file(cls, file: Any, path: str | PathLike[str]) -> GraspDataset:
        """Read and check a dataset in an open HDF5 file, which `close` closes.

        file: h5py.File. path: name for error messages. Raises DatasetError for the first deviation from the format.
        """
        dataset = cls.__new__(cls)
        dataset._open(Path(path), file, 0)
        return dataset

    def _open(self, path: Path, file: Any, baseline_frames: int) -> None:
        """Read and check the structure of the dataset in an open HDF5 file, which is closed after an error."""
        self.path, self._file = path, file
        self._location = Location(str(path))
        try:
            self._read_header(Node(self._file, self._location))
            if baseline_frames:
                self.require_baseline(baseline_frames)
        except BaseException:
            self.close()
            raise

    def _read_header(self, root: Node) -> None:
        """Read and check everything in the dataset except the arrays of the grasps."""
        check_format(root)
        location = self._location
        text = {name: scalar(root.attribute(name), location.key(name)) for name in ("source", "hand", "generator")}
        self.source: str = check_choice(text["source"], (REAL, SIM), location.key("source"))
        self.hand: str = check_text(text["hand"], location.key("hand"))
        self.generator: str = check_text(text["generator"], location.key("generator"))
        self.created: str = check_created(
            scalar(root.attribute("created"), location.key("created")), location.key("created")
        )
        sizes: dict[str, int] = {}
        self.taxels: TaxelTable = check_taxels(
            _read_arrays(root, "taxels", TAXELS, sizes), location.key("taxels"), sizes
        )
        self.sensors: SensorTable = check_sensors(
            _read_arrays(root, "sensors", SENSORS, sizes), location.key("sensors"), sizes
        )
        check_addresses(self.taxels, self.sensors, location)
        self.objects: Mapping[str, ObjectMesh] = MappingProxyType(_read_objects(root))
        self.sensor_model: SensorModel | None = self._read_sensor_model(root)
        # These grasps never read their arrays: callers get copies, so that the arrays are freed with the copies.
        index = self.sensors.index_of(self.taxels)
        self._grasps = {
            grasp_id: self._open_grasp(grasp_id, node, index) for grasp_id, node in _list_grasp_nodes(root).items()
        }

    def _open_grasp(self, grasp_id: str, node: Node, sensor_index: IntArray) -> Grasp:
        """Create the grasp of a group of the file; its arrays are read on first use.

        sensor_index: i64[n], row of each taxel's sensor in the sensor table. Raises DatasetError for an unknown object.
        """
        grasp = Grasp(node, grasp_id, self.source, self.sensors.s, sensor_index)
        if grasp.object not in self.objects:
            self._location.key("grasps").key(grasp_id).key("object").fail(
                "a name in /objects", format_value(grasp.object), "add that object or correct the name"
            )
        return grasp

    def _read_sensor_model(self, root: Node) -> SensorModel | None:
        """Read the sensor model of a simulated dataset; None for a real dataset, which must not have a sensor model."""
        location = self._location.key("sensor_model")
        if self.source == REAL:
            if root.has("sensor_model"):
                location.fail('no such group where source = "real"', "one", "remove it or correct the source")
            return None
        values = dict(root.group("sensor_model").attributes(REQUIRED + OPTIONAL))
        return check_sensor_model(values, location, self.taxels.n)

    @property
    def ids(self) -> tuple[str, ...]:
        """Ids of the grasps, in order of time."""
        return tuple(self._grasps)

    def __len__(self) -> int:
        return len(self._grasps)

    def __iter__(self) -> Iterator[Grasp]:
        return (self[grasp_id] for grasp_id in self._grasps)

    def __contains__(self, grasp_id: object) -> bool:
        return grasp_id in self._grasps

    def __getitem__(self, grasp_id: str) -> Grasp:
        """Return the grasp with this id; raises DatasetError for an unknown id."""
        location = self._location.key("grasps")
        if not self._file:
            self._location.fail("an open dataset", "a closed one", "use it inside its with block")
        if grasp_id not in self._grasps:
            location.key(str(grasp_id)).fail("a grasp of this file", "nothing", f"use one of its {len(self)} ids")
        return self._grasps[grasp_id].copy_without_arrays()

    def require_baseline(self, frames: int) -> None:
        """Raise DatasetError if a sensor of a grasp has fewer than `frames` valid phase-0 frames.

        A sensor without a valid frame in the whole grasp is missing and is not checked.
        """
        for grasp in self:
            grasp.require_baseline(frames)

    def check(self) -> None:
        """Read and check all arrays of all grasps; raises DatasetError for the first error."""
        for grasp in self:
            grasp.check()

    def close(self) -> None:
        """Close the grasp dataset. A second call has no effect."""
        self._file.close()

    def __enter__(self) -> GraspDataset:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close the grasp dataset at the end of the `with` block."""
        self.close()


def check_format(root: Node) -> None:
    """Raise DatasetError for a file of another format or version. A reader makes this check before all others."""
    remedy = "use a taxel release that reads that file, or convert the file"
    name = scalar(root.attribute("format"), root.location.key("format"))
    if name not in (FORMAT, FORMAT.encode()):
        root.location.key("format").fail(format_value(FORMAT), format_value(name), remedy)
    version = scalar(root.attribute("version"), root.location.key("version"))
    # The type is checked too, because True == 1 and 1.0 == 1 in Python.
    if not isinstance(version, np.integer) or version != VERSION:
        if version == VERSION + 1:
            remedy = "give a file of version 1; taxel gap diagnose, taxel show and GeneralDataset read version 2"
        root.location.key("version").fail(format_value(VERSION), str(version), remedy)


def _read_arrays(root: Node, name: str, specs: Mapping[str, Any], sizes: dict[str, int]) -> dict[str, Any]:
    """Return the arrays of the subgroup `name` of `root`, by the name of the array.

    specs: type and shape of each array by name. sizes: length of each axis so far; new axes are added.
    """
    group = root.group(name)
    return {key: group.array(key, spec, sizes) for key, spec in specs.items()}


def _read_objects(root: Node) -> dict[str, ObjectMesh]:
    """Read the meshes of all objects of a dataset, by name. root: the root group of the file."""
    group = root.group("objects")
    meshes = {}
    for name in group.names():
        sizes: dict[str, int] = {}
        meshes[name] = check_mesh(_read_arrays(group, name, MESH, sizes), group.location.key(name))
    return meshes


def _list_grasp_nodes(root: Node) -> dict[str, Node]:
    """Return the HDF5 group of each grasp of a dataset, by id."""
    group = root.group("grasps")
    return {name: group.group(name) for name in group.names()}
