"""Zarr stores (folders) of format 2 or 3: every numeric array is a field, by its path. Needs the package zarr."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel.hand.errors import format_value
from taxel.optional import optional_import
from taxel.recording.grasp_checks import Location
from taxel.recording.importers.fields import NUMBERS, Field, Source, check_size

_DAMAGED = "write the store again, or copy it completely"
_METADATA = (".zarray", ".zgroup", "zarr.json")
"""Files that describe an array or a group of format 2 or 3."""


def open_file(path: Path) -> Source:
    """Open a Zarr store; arrays are read on first use.

    Raises DatasetError for a damaged store and for an array above the size limit, and MissingPackageError if the
    package zarr is not installed.
    """
    location = Location(str(path))
    with optional_import("zarr", "a Zarr store"):
        import zarr
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # zarr warns of a part that it skips; `_find_unread_node` reports it
            nodes = dict(sorted(_walk(zarr.open(str(path), mode="r"), ""), key=lambda item: item[0]))
    except Exception as error:  # zarr raises several types for a damaged store
        location.fail("a Zarr store", format_value(str(error).partition("\n")[0]), _DAMAGED)
    arrays = {name: node for name, node in nodes.items() if hasattr(node, "shape")}
    if (damaged := _find_unread_node(path, nodes)) is not None:
        location.key(damaged).fail("a readable array or group", "damaged metadata", _DAMAGED)
    fields = {}
    for name, array in arrays.items():
        if array.dtype.kind in NUMBERS:
            check_size(array.shape, array.dtype.itemsize, location.key(name))
            fields[name] = Field(name, tuple(array.shape), str(array.dtype), _make_loader(array, location.key(name)))
    return Source(path, "Zarr store", fields)


def _walk(node: Any, path: str) -> Iterator[tuple[str, Any]]:
    """Yield (path, node) for a Zarr array, or for a Zarr group and all arrays and groups in it.

    node: array or group. path: its path; "" for the root group, "data" for a root array.
    """
    if hasattr(node, "shape"):
        yield path or "data", node
        return
    yield path, node
    start = f"{path}/" if path else ""
    for name, array in node.arrays():
        yield f"{start}{name}", array
    for name, group in node.groups():
        yield from _walk(group, f"{start}{name}")


def _find_unread_node(folder: Path, nodes: Mapping[str, Any]) -> str | None:
    """Return the path of the first folder with metadata that zarr has not read; None if there is none.

    zarr skips an array or a group whose metadata are damaged. zarr reads an array of format 2 as a group if the
    metadata lack the number of the format. folder: the store; a store in a single file is not examined. nodes: arrays
    and groups that zarr has read, by path.
    """
    groups = [name for name, node in nodes.items() if not hasattr(node, "shape")] if folder.is_dir() else []
    for group in groups:
        if (folder / group / ".zarray").exists():
            return group or "."
        for child in sorted((folder / group).iterdir()):
            name = child.relative_to(folder).as_posix()
            if name not in nodes and any((child / each).exists() for each in _METADATA):
                return name
    return None


def _make_loader(array: Any, location: Location) -> Any:
    """Return a function that reads a Zarr array."""

    def load() -> NDArray[Any]:
        """Read the array into memory. Raises DatasetError for a damaged store."""
        try:
            return np.asarray(array[...])
        except Exception as error:  # as in open_file
            return location.fail("a readable array", format_value(str(error).partition("\n")[0]), _DAMAGED)

    return load
