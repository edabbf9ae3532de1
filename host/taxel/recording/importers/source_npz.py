"""NumPy files: .npz with named arrays, .npy with one array, which has the name "data"."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

from numpy.typing import NDArray

from taxel.hand.errors import format_value
from taxel.input_files import open_regular_file, read_regular_file
from taxel.input_files.numpy_archive import (
    HEADER_BYTES,
    ArchiveError,
    ArrayHeader,
    NumpyArchive,
    parse_array,
    parse_array_header,
)
from taxel.recording.grasp_checks import Location
from taxel.recording.grasp_format import LARGEST_ARRAY_BYTES
from taxel.recording.importers.fields import Field, Source, check_size

ARRAY_NAME: Final = "data"
"""Name of the only array of a .npy file."""

_DAMAGED: Final = "write the file again with numpy.savez"


def open_file(path: Path) -> Source:
    """Open a NumPy file; arrays are read on first use. Raises DatasetError for a damaged file and Python objects."""
    location = Location(str(path))
    if path.suffix.lower() == ".npy":
        place = location.key(ARRAY_NAME)
        with _convert_errors(place, "a NumPy array"), open_regular_file(path) as file:
            header = parse_array_header(file.read(HEADER_BYTES), path.stat().st_size)
        return Source(path, "NumPy file", {ARRAY_NAME: _make_field(header, ARRAY_NAME, place, lambda: _load_npy(path))})
    fields = {}
    with _convert_errors(location, "a NumPy archive (.npz)"):
        archive = NumpyArchive(path)
    with archive:
        for name in archive.names:
            place = location.key(name)
            with _convert_errors(place, "a NumPy array"):
                header = archive.read_header(name)
            fields[name] = _make_field(header, name, place, _make_loader(path, name))
    return Source(path, "NumPy archive", fields)


@contextmanager
def _convert_errors(location: Location, expected: str) -> Iterator[None]:
    """Context manager that converts the errors of a NumPy file into DatasetError.

    expected: expected content in the error message, such as "a NumPy array".
    """
    try:
        yield
    except (ArchiveError, OSError) as error:
        location.fail(expected, format_value(str(error)), _DAMAGED)


def _make_field(header: ArrayHeader, name: str, location: Location, load: Callable[[], NDArray[Any]]) -> Field:
    """Return the field of an array that is not read yet. Raises DatasetError for a size above the limit."""
    check_size(header.shape, header.dtype.itemsize, location)
    return Field(name, header.shape, str(header.dtype) if header.dtype.kind in "iufb" else "text", load)


def _make_loader(path: Path, name: str) -> Callable[[], NDArray[Any]]:
    """Return a function that reads the array `name` of an archive."""

    def load() -> NDArray[Any]:
        """Open the archive again and read the array. Raises DatasetError."""
        with _convert_errors(Location(str(path)).key(name), "a complete array"), NumpyArchive(path) as archive:
            return archive.read(name, LARGEST_ARRAY_BYTES)

    return load


def _load_npy(path: Path) -> NDArray[Any]:
    """Read the only array of a .npy file. Raises DatasetError."""
    with _convert_errors(Location(str(path)).key(ARRAY_NAME), "a complete array"):
        data = read_regular_file(path, LARGEST_ARRAY_BYTES)
        return parse_array(data, parse_array_header(data[:HEADER_BYTES], len(data)))
