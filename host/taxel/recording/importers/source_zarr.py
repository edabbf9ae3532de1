"""Zarr stores (folders) of format 2 or 3: every numeric array is a field, by its path. Needs the package zarr."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel.hand.errors import format_value
from taxel.optional import optional_import
from taxel.recording.grasp_checks import Location
from taxel.recording.importers.fields import NUMBERS, Field, Source, check_size

_DAMAGED = "write the store again, or copy it completely"


def open_file(path: Path) -> Source:
    """Open a Zarr store; arrays are read on first use. Raises DatasetError, and MissingPackageError."""
    location = Location(str(path))
    with optional_import("zarr", "a Zarr store"):
        import zarr
    try:
        root = zarr.open(str(path), mode="r")
        arrays = dict(sorted(_walk(root, ""), key=lambda item: item[0]))  # a folder has no order
    except Exception as error:  # zarr raises several types for a damaged store
        location.fail("a Zarr store", format_value(str(error).partition("\n")[0]), _DAMAGED)
    fields = {}
    for name, array in arrays.items():
        if array.dtype.kind in NUMBERS:
            check_size(array.shape, array.dtype.itemsize, location.key(name))
            fields[name] = Field(name, tuple(array.shape), str(array.dtype), _make_loader(array, location.key(name)))
    return Source(path, "Zarr store", fields)


def _walk(node: Any, path: str) -> Iterator[tuple[str, Any]]:
    """Yield (path, array) for a Zarr array, or for all arrays in a Zarr group and its subgroups.

    node: array or group. path: its path; "" for the root, whose array is called "data".
    """
    if hasattr(node, "shape"):
        yield path or "data", node
        return
    start = f"{path}/" if path else ""
    for name, array in node.arrays():
        yield f"{start}{name}", array
    for name, group in node.groups():
        yield from _walk(group, f"{start}{name}")


def _make_loader(array: Any, location: Location) -> Any:
    """Return a function that reads a Zarr array."""

    def load() -> NDArray[Any]:
        """Read the array into memory. Raises DatasetError for a damaged store."""
        try:
            return np.asarray(array[...])
        except Exception as error:  # as in open_file
            return location.fail("a readable array", format_value(str(error).partition("\n")[0]), _DAMAGED)

    return load
