"""Opening of a file of any supported kind as named arrays."""

from __future__ import annotations

import os
import stat
from collections.abc import Callable
from importlib import import_module
from os import PathLike
from pathlib import Path
from typing import Final, cast

from taxel.input_files import is_regular_file
from taxel.recording.grasp_checks import Location
from taxel.recording.importers.fields import Field, Source

__all__ = ["Field", "Source", "check_input", "find_kind", "open_source"]

_MODULE_OF_SUFFIX: Final = {
    ".npz": "source_npz",
    ".npy": "source_npz",
    ".csv": "source_csv",
    ".tsv": "source_csv",
    ".txt": "source_csv",
    ".parquet": "source_parquet",
    ".h5": "source_hdf5",
    ".hdf5": "source_hdf5",
    ".hdf": "source_hdf5",
    ".zarr": "source_zarr",
    ".bag": "source_ros",
    ".mcap": "source_ros",
    ".db3": "source_ros",
}
_FOLDERS: Final = (
    ("meta/info.json", "source_lerobot"),
    ("metadata.yaml", "source_ros"),
    ("zarr.json", "source_zarr"),
    (".zgroup", "source_zarr"),
    (".zarray", "source_zarr"),
)
"""Known folder layouts: path of a file that every folder of the layout contains, and the module that reads it."""


def check_input(path: Path) -> None:
    """Raise DatasetError for a path that is no readable, regular, non-empty file.

    A FIFO or a device is refused, because reading it would wait without end.
    """
    location = Location(str(path))
    try:
        status = path.stat()
    except OSError as error:
        location.fail("a readable file", error.strerror or "nothing", "check the path")
    if stat.S_ISDIR(status.st_mode):
        remedy = "give the file, or the folder of a ROS 2 bag, a Zarr store or a LeRobot dataset"
        location.fail("a file", "a folder", remedy)
    if not stat.S_ISREG(status.st_mode):
        location.fail("a regular file", "a device, pipe or socket", "copy the data to a file, and give the file")
    if status.st_size == 0:
        location.fail("a file with content", "an empty file", "record or copy the file again")


def _check_folder(path: Path) -> None:
    """Raise DatasetError for a file below a folder that is no regular file; libraries would wait for it without end."""
    for folder, _, names in os.walk(path):
        for name in names:
            file = os.path.join(folder, name)
            if not is_regular_file(file):
                Location(file).fail("a regular file", "another kind of file", "copy the folder completely")


def find_kind(path: Path) -> str:
    """Return the name of the module that reads a file or folder, such as "source_csv".

    Raises DatasetError for an unknown kind, and for a path that `check_input` refuses.
    """
    if path.is_dir():
        _check_folder(path)
        for name, module in _FOLDERS:
            if (path / name).is_file():
                return module
        if path.suffix == ".zarr":
            return "source_zarr"
    check_input(path)
    module = _MODULE_OF_SUFFIX.get(path.suffix.lower(), "")
    if not module or module == "source_zarr":
        suffixes = ", ".join(_MODULE_OF_SUFFIX)
        found = f"the suffix {path.suffix}" if path.suffix else "no suffix"
        Location(str(path)).fail(f"one of {suffixes}", found, "convert the file, or correct the suffix of its name")
    return module


def open_source(path: str | PathLike[str]) -> Source:
    """Open a file, or a folder of a known layout, as named arrays.

    Raises DatasetError for a path that is missing, is empty, is no regular file, is damaged or has an unknown kind, and
    MissingPackageError if the library of the kind is not installed.
    """
    module = import_module(f"taxel.recording.importers.{find_kind(Path(path))}")
    opened = cast("Callable[[Path], Source]", module.open_file)(Path(path))
    if not opened.fields:
        opened.location.fail("at least one array", "none", "check how the file was written")
    return opened
