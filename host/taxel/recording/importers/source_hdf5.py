"""HDF5 files of any layout: every dataset of numbers or strings is a field, named by its path. Needs h5py."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel.optional import optional_import
from taxel.recording.grasp_checks import Location
from taxel.recording.grasp_hdf5 import convert_hdf5_errors, open_hdf5
from taxel.recording.hdf5_storage import check_layout, check_names, read_values
from taxel.recording.importers.fields import NUMBERS, Field, Source, check_size

with optional_import("h5py", "an HDF5 file"):
    import h5py  # type: ignore[import-untyped, unused-ignore]


def open_file(path: Path) -> Source:
    """Open an HDF5 file; arrays are read on first use. Links to other files are not followed. Raises DatasetError."""
    location = Location(str(path))
    fields: dict[str, Field] = {}

    def add_field(name: str, item: Any) -> None:
        """Add the member `item` of the file to the fields if it is a dataset of numbers or strings in this file.

        Raises DatasetError for a name that is not UTF-8.
        """
        check_names([name], location)
        if not isinstance(item, h5py.Dataset) or item.shape is None or item.is_virtual or item.external:
            return
        is_text = h5py.check_string_dtype(item.dtype) is not None
        if is_text or item.dtype.kind in NUMBERS:
            kind = "text" if is_text else str(item.dtype)
            fields[name] = Field(name, item.shape, kind, lambda: _load_dataset(path, name))

    with open_hdf5(path, "r") as file, convert_hdf5_errors(location):
        file.visititems(add_field)  # hard links only
    return Source(path, "HDF5 file", fields)


def _load_dataset(path: Path, name: str) -> NDArray[Any]:
    """Read the dataset `name` of an HDF5 file, numbers or strings. Raises DatasetError."""
    location = Location(str(path)).key(name)
    with open_hdf5(path, "r") as file, convert_hdf5_errors(location):
        dataset = file[name]
        check_size(dataset.shape, dataset.dtype.itemsize, location)
        check_layout(dataset, location)
        array = read_values(dataset, location)
        if h5py.check_string_dtype(dataset.dtype) is not None:
            array = dataset.asstr()[()]
    return np.asarray(array) if np.asarray(array).dtype.kind in NUMBERS else np.asarray(array, dtype=str)
