"""Targets: grasp datasets of version 1 and 2, and NumPy archives of a dataset."""

from __future__ import annotations

import io
import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Final

import h5py
import numpy as np

from fuzz_files.array_codecs import Hdf5, Npz, Zip, encode_npz
from fuzz_files.document import Flat, flatten
from fuzz_files.target import Rules, Target
from taxel.recording.from_arrays import write_from_arrays
from taxel.recording.general.dataset import GeneralDataset
from taxel.recording.general.format import Contact, GeneralHeader, Properties, TaxelPlaces
from taxel.recording.general.writer import write_general
from taxel.recording.grasp_dataset import GraspDataset

_FRAMES, _TAXELS, _SENSORS = 8, 3, 2


def make_contents() -> dict[str, Any]:
    """Create the content of a simulated dataset of version 1: datasets by path, attributes by path and "@"."""
    items: dict[str, Any] = {
        "@format": "taxel-grasp-dataset", "@version": 1, "@source": "sim", "@hand": "two boards",
        "@created": "2026-01-31T12:00:00+00:00", "@generator": "fuzz",
        "taxels/sensor": np.array([0x20, 0x20, 0x21], np.uint8),
        "taxels/tx": np.array([0, 0, 1], np.uint8),
        "taxels/rx": np.array([0, 1, 0], np.uint8),
        "taxels/position": np.arange(9.0).reshape(_TAXELS, 3) * 0.01,
        "taxels/normal": np.tile([0.0, 0.0, 1.0], (_TAXELS, 1)),
        "taxels/size": np.full(_TAXELS, 0.003),
        "sensors/address": np.array([0x20, 0x21], np.uint8),
        "sensors/name": ["palm", "index"],
        "sensors/kind": ["palm", "fingertip"],
        "sensors/rate_hz": np.array([6.0, 6.0]),
        "objects/cube/vertices": np.vstack([np.zeros(3), np.eye(3)]),
        "objects/cube/faces": np.array([[0, 2, 1], [0, 1, 3]], np.int32),
        "sensor_model@baseline_counts": 3e4,
        "sensor_model@full_scale_drop_counts": 4e3,
        "sensor_model@half_force_n": 2.0,
    }  # fmt: skip
    for number in range(2):
        grasp = f"grasps/000{number + 1}"
        items |= {
            f"{grasp}@object": "cube",
            f"{grasp}@approach": "top",
            f"{grasp}@iteration": number,
            f"{grasp}@session": 0,
            f"{grasp}/timestamp": np.arange(_FRAMES) / 6.0,
            f"{grasp}/phase": np.arange(_FRAMES, dtype=np.uint8) // 2,
            f"{grasp}/raw_counts": np.arange(_FRAMES * _TAXELS, dtype=np.uint16).reshape(_FRAMES, _TAXELS) + 30_000,
            f"{grasp}/valid": np.ones((_FRAMES, _SENSORS), bool),
            f"{grasp}/sensor_pose": np.tile(np.eye(4), (_SENSORS, 1, 1)),
            f"{grasp}/object_pose": np.eye(4),
            f"{grasp}/contact_force": np.zeros((_FRAMES, _TAXELS)) + 0.125 * number,
            f"{grasp}/separation": np.full((_FRAMES, _TAXELS), 0.05),
        }
    return items


def write_version_1(folder: Path) -> str:
    """Write a dataset of version 1 and return its name."""
    (folder / "a.h5").write_bytes(Hdf5().encode(make_contents()))
    return "a.h5"


def write_version_2(folder: Path) -> str:
    """Write a dataset of version 2 and return its name."""
    properties = Properties("kPa", "raises", 250.0, 0.5, "resistive")
    places = TaxelPlaces(np.zeros(_TAXELS, np.int64), position=np.arange(9.0).reshape(_TAXELS, 3) * 0.01)
    values = np.arange(40.0 * _TAXELS).reshape(40, _TAXELS)
    time = np.asarray(np.arange(40) * 0.02, np.float64)
    contacts = [Contact(f"c{number}", number, time, values + number) for number in range(2)]
    write_general(folder / "a.h5", GeneralHeader("real", "mat", "fuzz", properties, places), contacts)
    return "a.h5"


def write_npz(folder: Path) -> str:
    """Write the content of a dataset of version 1 as a NumPy archive and return its name."""
    names = {name.replace("@", "/").lstrip("/"): value for name, value in make_contents().items()}
    arrays = {name: np.asarray(value) for name, value in names.items() if name not in ("format", "version")}
    (folder / "a.npz").write_bytes(encode_npz(arrays))
    return "a.npz"


def read_version_1(path: Path) -> Flat:
    """Read all data of a dataset of version 1."""
    with GraspDataset(path) as data:
        data.check()
        return flatten(describe(data))


def describe(data: GraspDataset) -> Mapping[str, Any]:
    """Return the header, tables and grasps of a dataset of version 1, by name."""
    grasps = {}
    for grasp in data:
        names = (
            "object", "approach", "iteration", "session", "timestamp", "phase", "raw_counts", "valid", "sensor_pose",
            "object_pose", "contact_force", "separation",
        )  # fmt: skip
        grasps[grasp.id] = {name: getattr(grasp, name) for name in names}
    return {
        "header": {name: getattr(data, name) for name in ("source", "hand", "generator")},
        "taxels": dict(vars(data.taxels)),
        "sensors": dict(vars(data.sensors)),
        "objects": {name: dict(vars(mesh)) for name, mesh in data.objects.items()},
        "sensor_model": data.sensor_model,
        "grasps": grasps,
    }


def read_version_2(path: Path) -> Flat:
    """Read all data of a dataset of version 2."""
    with GeneralDataset(path) as data:
        return flatten({"header": data.header, "contacts": list(data)})


def read_npz(path: Path) -> Flat:
    """Convert a NumPy archive to a dataset and read the dataset's data."""
    out = path.with_name("out.h5")
    try:
        write_from_arrays(out, path, overwrite=True)
        return read_version_1(out)
    finally:
        out.unlink(missing_ok=True)


def copy_with_chunks(make: Callable[[Path], str]) -> Callable[[Path], str]:
    """Return a function that writes the dataset of `make` with compressed chunks, as large datasets have them."""

    def write(folder: Path) -> str:
        """Write the dataset, and write its arrays again in chunks. Returns the dataset's name."""
        name = make(folder)
        source, target = h5py.File(folder / name, "r"), io.BytesIO()
        with source, h5py.File(target, "w") as file:
            file.attrs.update(source.attrs)
            source.visititems(lambda path, item: _copy(file, path, item))
        (folder / name).write_bytes(target.getvalue())
        return name

    return write


def _copy(file: Any, path: str, item: Any) -> None:
    """Copy a group or a dataset to `file`; an array of two or more axes is stored in a compressed chunk with a
    checksum.
    """
    if isinstance(item, h5py.Dataset):
        options = {"chunks": item.shape, "compression": "gzip", "fletcher32": True} if item.ndim > 1 else {}
        copied = file.create_dataset(path, data=item[()], dtype=item.dtype, **options)
    else:
        copied = file.require_group(path)
    copied.attrs.update(item.attrs)


_FIELDS: Final = (
    "sensor", "tx", "rx", "position", "normal", "size", "address", "name", "kind", "rate_hz", "vertices", "faces",
    "baseline_counts", "full_scale_drop_counts", "half_force_n", "object", "approach", "iteration", "session",
    "timestamp", "phase", "raw_counts", "valid", "sensor_pose", "object_pose", "contact_force", "separation", "time",
    "values", "unit", "contact", "full_scale", "resolution", "modality", "source", "hand", "generator",
)  # fmt: skip
"""Names of the fields that the formats define; readers ignore other names."""


def _match_other_names(separator: str) -> re.Pattern[str]:
    """Return a pattern of the paths whose last name is none of `_FIELDS`. separator: pattern between two names."""
    return re.compile(rf"^(?!(?:.*{separator})?(?:{'|'.join(_FIELDS)})(?:\[|#|$))")


_DATASET: Final = Rules(unused=_match_other_names("[/@]"), derived=re.compile("#$"))
_DATASET_2: Final = Rules(
    unused=re.compile(rf"{_DATASET.unused.pattern}|(^|[/@])(name|kind|address)$|@(object|approach)2$"),
    derived=re.compile("#$"),
)
_ARRAYS: Final = Rules(unused=_match_other_names("/"), derived=re.compile("#$"))

TARGETS: Final = (
    Target("dataset-1", write_version_1, ((r"\.h5$", (Hdf5(),)),), read_version_1, 0.8, _DATASET),
    Target("dataset-1-chunks", copy_with_chunks(write_version_1), ((r"\.h5$", ()),), read_version_1, 0.8, _DATASET),
    Target("dataset-2", write_version_2, ((r"\.h5$", (Hdf5(),)),), read_version_2, 0.8, _DATASET_2),
    Target("npz", write_npz, ((r"\.npz$", (Npz(), Zip())),), read_npz, 0.5, _ARRAYS),
)
