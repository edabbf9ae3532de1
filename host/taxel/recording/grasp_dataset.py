"""Reading a grasp dataset: one HDF5 file of a real, an emulated or a simulated hand. Strict and lazy."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from os import PathLike
from pathlib import Path
from types import MappingProxyType, TracebackType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel.hand.errors import format_value
from taxel.recording.grasp import Grasp
from taxel.recording.grasp_checks import Place, check_choice, check_created, check_text
from taxel.recording.grasp_format import FORMAT, MESH, REAL, SENSORS, SIM, TAXELS, VERSION
from taxel.recording.grasp_hdf5 import Node, open_hdf5, scalar
from taxel.recording.grasp_sensor_model import OPTIONAL, REQUIRED, SensorModel, checked_sensor_model
from taxel.recording.grasp_tables import (
    ObjectMesh,
    SensorTable,
    TaxelTable,
    check_addresses,
    checked_mesh,
    checked_sensors,
    checked_taxels,
)


class GraspDataset:
    """A grasp dataset, open for reading. Use it as a context manager.

    path: the HDF5 file. baseline_frames: refuse the file if a grasp has fewer, see `require_baseline`.

    Opening checks the attributes, the tables and the kind and shape of every array; the values of a grasp's arrays
    are read and checked when they are first touched, or all by `check`. Iterating gives each `Grasp` in order of time.

    Raises DatasetError for the first thing that is not as the format says: one line with the file and the field.
    A file without a grasp, such as one from a campaign that was cut at once, is valid.
    """

    def __init__(self, path: str | PathLike[str], baseline_frames: int = 0) -> None:
        self.path = Path(path)
        self._place = Place(str(path))
        self._file = open_hdf5(self.path, "r")
        try:
            self._read_header(Node(self._file, self._place))
            if baseline_frames:
                self.require_baseline(baseline_frames)
        except BaseException:
            self.close()
            raise

    def _read_header(self, root: Node) -> None:
        check_format(root)
        place = self._place
        text = {name: scalar(root.attribute(name), place.key(name)) for name in ("source", "hand", "generator")}
        self.source: str = check_choice(text["source"], (REAL, SIM), place.key("source"))
        self.hand: str = check_text(text["hand"], place.key("hand"))
        self.generator: str = check_text(text["generator"], place.key("generator"))
        self.created: str = check_created(scalar(root.attribute("created"), place.key("created")), place.key("created"))
        sizes: dict[str, int] = {}
        self.taxels: TaxelTable = checked_taxels(_arrays(root, "taxels", TAXELS, sizes), place.key("taxels"), sizes)
        self.sensors: SensorTable = checked_sensors(
            _arrays(root, "sensors", SENSORS, sizes), place.key("sensors"), sizes
        )
        check_addresses(self.taxels, self.sensors, place)
        self.objects: Mapping[str, ObjectMesh] = MappingProxyType(_objects(root))
        self.sensor_model: SensorModel | None = self._sensor_model(root)
        # Heads without arrays: callers get copies, so that no array outlives the caller's interest.
        index = self.sensors.index_of(self.taxels)
        self._heads = {grasp_id: self._head(grasp_id, node, index) for grasp_id, node in _grasp_nodes(root).items()}

    def _head(self, grasp_id: str, node: Node, sensor_index: NDArray[np.int64]) -> Grasp:
        grasp = Grasp(node, grasp_id, self.source, self.sensors.s, sensor_index)
        if grasp.object not in self.objects:
            self._place.key("grasps").key(grasp_id).key("object").fail(
                "a name that /objects has", format_value(grasp.object), "add that object or correct the name"
            )
        return grasp

    def _sensor_model(self, root: Node) -> SensorModel | None:
        place = self._place.key("sensor_model")
        if self.source == REAL:
            if root.has("sensor_model"):
                place.fail('no such group where source = "real"', "one", "remove it or correct the source")
            return None
        values = dict(root.group("sensor_model").attributes(REQUIRED + OPTIONAL))
        return checked_sensor_model(values, place, self.taxels.n)

    @property
    def ids(self) -> tuple[str, ...]:
        """Ids of the grasps, in order of time."""
        return tuple(self._heads)

    def __len__(self) -> int:
        return len(self._heads)

    def __iter__(self) -> Iterator[Grasp]:
        return (self[grasp_id] for grasp_id in self._heads)

    def __contains__(self, grasp_id: object) -> bool:
        return grasp_id in self._heads

    def __getitem__(self, grasp_id: str) -> Grasp:
        """The grasp of that id; raises DatasetError where there is none."""
        place = self._place.key("grasps")
        if not self._file:
            self._place.fail("an open dataset", "a closed one", "use it inside its with block")
        if grasp_id not in self._heads:
            place.key(str(grasp_id)).fail("a grasp of this file", "nothing", f"it has {len(self)}, see ids")
        return self._heads[grasp_id].fresh()

    def require_baseline(self, frames: int) -> None:
        """Refuse (DatasetError) a dataset with a grasp whose sensors have fewer valid phase-0 frames than asked for.

        A sensor without one valid frame in the whole grasp is missing, not short of frames.
        """
        for grasp in self:
            grasp.require_baseline(frames)

    def check(self) -> None:
        """Read everything and check all of it; raises DatasetError for the first mistake."""
        for grasp in self:
            grasp.check()

    def close(self) -> None:
        """Close the file; closing again is harmless."""
        self._file.close()

    def __enter__(self) -> GraspDataset:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def check_format(root: Node) -> None:
    """Refuse a file of another format or version. First: such a file may have other fields."""
    remedy = "use a taxel release that reads that file, or convert the file"
    name = scalar(root.attribute("format"), root.place.key("format"))
    if name not in (FORMAT, FORMAT.encode()):
        root.place.key("format").fail(format_value(FORMAT), format_value(name), remedy)
    version = scalar(root.attribute("version"), root.place.key("version"))
    # The type too: True == 1 and 1.0 == 1 in Python.
    if not isinstance(version, np.integer) or version != VERSION:
        root.place.key("version").fail(format_value(VERSION), format_value(version), remedy)


def _arrays(root: Node, name: str, specs: Mapping[str, Any], sizes: dict[str, int]) -> dict[str, Any]:
    group = root.group(name)
    return {key: group.array(key, spec, sizes) for key, spec in specs.items()}


def _objects(root: Node) -> dict[str, ObjectMesh]:
    group = root.group("objects")
    meshes = {}
    for name in group.names():
        sizes: dict[str, int] = {}
        meshes[name] = checked_mesh(_arrays(group, name, MESH, sizes), group.place.key(name))
    return meshes


def _grasp_nodes(root: Node) -> dict[str, Node]:
    group = root.group("grasps")
    return {name: group.group(name) for name in group.names()}
