"""NumPy files: .npz with named arrays, .npy with one array, which has the name "data"."""

from __future__ import annotations

import io
import zipfile
from pathlib import Path
from typing import IO, Any, Final

import numpy as np
from numpy.typing import NDArray

from taxel.hand.errors import format_value
from taxel.recording.grasp_checks import Location
from taxel.recording.importers.fields import Field, Source, check_size

ARRAY_NAME: Final = "data"
"""Name of the only array of a .npy file."""

_DAMAGED: Final = "write the file again with numpy.savez"


def open_file(path: Path) -> Source:
    """Open a NumPy file; arrays are read on first use. Raises DatasetError for a damaged file and Python objects."""
    location = Location(str(path))
    if path.suffix.lower() == ".npy":
        with path.open("rb") as file:
            field = _read_header(file, ARRAY_NAME, location, lambda: _load_npy(path))
        return Source(path, "NumPy file", {ARRAY_NAME: field})
    fields = {}
    try:
        with zipfile.ZipFile(path) as archive:
            for member in archive.namelist():
                name = member.removesuffix(".npy")
                with archive.open(member) as file:
                    fields[name] = _read_header(file, name, location, _make_loader(path, member, name))
    except (zipfile.BadZipFile, OSError, EOFError, RuntimeError) as error:
        location.fail("a NumPy archive (.npz)", format_value(str(error)), _DAMAGED)
    return Source(path, "NumPy archive", fields)


def _read_header(file: IO[bytes], name: str, location: Location, load: Any) -> Field:
    """Read shape and type of an array without its values. Raises DatasetError."""
    own = location.key(name)
    try:
        version = np.lib.format.read_magic(file)
        read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
        shape, _, dtype = read(file)
    except (ValueError, EOFError) as error:
        own.fail("a NumPy array", format_value(str(error).partition("\n")[0]), _DAMAGED)
    if dtype.hasobject or dtype.names:
        own.fail("a plain array", "Python objects or records", "store numbers or texts without Python objects")
    check_size(shape, dtype.itemsize, own)
    return Field(name, tuple(shape), str(dtype) if dtype.kind in "iufb" else "text", load)


def _make_loader(path: Path, member: str, name: str) -> Any:
    """Return a function that reads one array of an archive."""

    def load() -> NDArray[Any]:
        try:
            with zipfile.ZipFile(path) as archive:
                return np.asarray(np.lib.format.read_array(io.BytesIO(archive.read(member)), allow_pickle=False))
        except (zipfile.BadZipFile, OSError, ValueError, EOFError, RuntimeError) as error:
            return Location(str(path)).key(name).fail("a complete array", format_value(str(error)), _DAMAGED)

    return load


def _load_npy(path: Path) -> NDArray[Any]:
    """Read the only array of a .npy file. Raises DatasetError."""
    try:
        return np.asarray(np.load(path, allow_pickle=False))
    except (OSError, ValueError, EOFError) as error:
        location = Location(str(path)).key(ARRAY_NAME)
        return location.fail("a complete array", format_value(str(error).partition("\n")[0]), _DAMAGED)
