"""Strict reader of an HDF5 file: follows hard links only, and checks each size before it allocates memory."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from math import prod
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel.hand.errors import format_value
from taxel.optional import optional_import
from taxel.recording.grasp_checks import Location, check_header, convert_type
from taxel.recording.grasp_format import LONGEST_TEXT, STRING, ArraySpec
from taxel.recording.hdf5_storage import DAMAGED, check_heaps, check_layout, check_names, read_values

with optional_import("h5py", "a grasp dataset (.h5)"):
    import h5py  # type: ignore[import-untyped, unused-ignore]

_LARGEST_ATTRIBUTE = 2**20
"""Largest number of values of an attribute. The longest attribute, baseline_counts, has one value for each taxel."""


@contextmanager
def convert_hdf5_errors(location: Location) -> Iterator[None]:
    """Context manager that converts exceptions of the HDF5 library for a damaged file into a DatasetError.

    location: the place in the file that the error message names.
    """
    try:
        yield
    except (OSError, RuntimeError, LookupError, ValueError, TypeError, OverflowError, MemoryError) as error:
        location.fail("readable HDF5 data", format_value(str(error).partition("\n")[0]), DAMAGED)


def open_hdf5(path: Path, mode: str, libver: tuple[str, str] | None = None) -> Any:
    """Open an HDF5 file as an h5py.File; mode: as for h5py ("r": read, "r+": change, "w": replace).

    libver: oldest and newest version of the file format. Raises DatasetError for a file that is missing, is no HDF5
    file, is truncated, or is open for writing elsewhere.
    """
    location = Location(str(path))
    if not path.is_file():
        location.fail("an HDF5 file", "a folder" if path.is_dir() else "nothing", "check the path")
    if mode != "w":
        check_heaps(path, location)
    with convert_opening_errors(location):
        return h5py.File(path, mode, libver=libver)


@contextmanager
def convert_opening_errors(location: Location) -> Iterator[None]:
    """Context manager that converts exceptions of the HDF5 library for a file that cannot be opened to DatasetError."""
    try:
        yield
    except OSError as error:
        text = str(error)
        if "signature not found" in text:
            location.fail("an HDF5 file", "another kind of file", "give a grasp dataset")
        if "truncated file" in text:
            location.fail("a complete HDF5 file", "a truncated one", DAMAGED)
        if "unable to lock" in text:
            location.fail("a file that no program is writing", "one that is open elsewhere", "wait until it is closed")
        location.fail("a readable HDF5 file", format_value(text.partition("\n")[0]), DAMAGED)


class Node:
    """A group of an HDF5 file, and its location for error messages.

    Only hard links are followed, so that no other file is read.
    """

    def __init__(self, group: Any, location: Location) -> None:
        """Wrap an HDF5 group of h5py; location: the place in the file that error messages name."""
        self._group = group
        self.location = location
        self._open_datasets: dict[tuple[str, ArraySpec], Any] = {}

    def names(self) -> list[str]:
        """Return the names of all members of the HDF5 group, sorted. Raises DatasetError for a name not in UTF-8."""
        with convert_hdf5_errors(self.location):
            names = list(self._group)
        check_names(names, self.location)
        return sorted(names)

    def has(self, name: str) -> bool:
        """Whether the HDF5 group has a member of this name."""
        with convert_hdf5_errors(self.location.key(name)):
            return bool(self._group.id.links.exists(_encode_name(name)))

    def group(self, name: str) -> Node:
        """Return the subgroup of this name. Raises DatasetError for a missing subgroup."""
        return Node(self._get_member(name, h5py.Group, "group"), self.location.key(name))

    def check_array(self, name: str, spec: ArraySpec, sizes: dict[str, int]) -> None:
        """Check the type and shape of an array without reading it. sizes: as in `check_header`."""
        # Opening and checking one of hundreds of datasets takes as long as reading it, so it stays open until then.
        self._open_datasets[name, spec] = self._get_checked_dataset(name, spec, sizes)

    def array(self, name: str, spec: ArraySpec, sizes: dict[str, int]) -> Any:
        """Read an array in the type that the format defines; strings as a list. sizes: as in `check_header`."""
        dataset, location = self._open_datasets.pop((name, spec), None), self.location.key(name)
        if dataset is None:
            dataset = self._get_checked_dataset(name, spec, sizes)
        with convert_hdf5_errors(location):
            values = read_values(dataset, location)
        return list(values) if spec.dtype == STRING else convert_type(values, spec, location)

    def attribute(self, name: str) -> Any:
        """Return the value of an attribute of the HDF5 group: a scalar, an array or a string.

        Raises DatasetError for a missing attribute.
        """
        value = self.optional_attribute(name)
        if value is None:
            self.location.key(name).fail("an attribute", "nothing", "add it")
        return value

    def optional_attribute(self, name: str) -> Any:
        """Return the value of an attribute of the HDF5 group, or None if the attribute is absent.

        Raises DatasetError for a value that is neither a number, a string nor a one-dimensional array, and for more
        than `_LARGEST_ATTRIBUTE` values.
        """
        location = self.location.key(name)
        with convert_hdf5_errors(location):
            if name not in self._group.attrs:
                return None
            header = self._group.attrs.get_id(name)
            is_null = header.get_space().get_simple_extent_type() == h5py.h5s.NULL
            shape, dtype, text = header.shape, header.dtype, h5py.check_string_dtype(header.dtype)
        if is_null or (text is None and dtype.kind not in "biuf"):
            found = "an empty value" if is_null else f"type {dtype}"
            location.fail("a number or a text", found, "store a number or a text")
        if prod(shape) > _LARGEST_ATTRIBUTE or len(shape) > 1:
            location.fail("one value, or one for each taxel", f"shape {list(shape)}", "correct it")
        with convert_hdf5_errors(location):
            return self._group.attrs[name]

    def attributes(self, names: tuple[str, ...]) -> Mapping[str, Any]:
        """Return the values of the attributes `names` that the HDF5 group has, by name."""
        return {name: value for name in names if (value := self.optional_attribute(name)) is not None}

    def _get_member(self, name: str, kind: type, kind_name: str) -> Any:
        """Return a subgroup or dataset of the HDF5 group.

        kind: expected class of h5py; kind_name: "group" or "dataset". Raises DatasetError for a missing member, a link
        or a member of another class.
        """
        location = self.location.key(name)
        if not self.has(name):
            location.fail(f"a {kind_name}", "nothing", "add it")
        with convert_hdf5_errors(location):
            link = self._group.id.links.get_info(_encode_name(name))
        if link.type != h5py.h5l.TYPE_HARD:
            location.fail(f"a {kind_name} of this file", "a link", "store the data itself; links are not followed")
        with convert_hdf5_errors(location):
            child = self._group[name]
        if not isinstance(child, kind):
            location.fail(f"a {kind_name}", f"a {type(child).__name__.lower()}", f"store a {kind_name} there")
        return child

    def _get_checked_dataset(self, name: str, spec: ArraySpec, sizes: dict[str, int]) -> Any:
        """Return a dataset of the HDF5 group after a check of its type, shape and storage; values are not read."""
        dataset, location = self._get_member(name, h5py.Dataset, "dataset"), self.location.key(name)
        with convert_hdf5_errors(location):
            shape, dtype = dataset.shape, dataset.dtype
            text = h5py.check_string_dtype(dtype)
        if shape is None:
            location.fail("an array", "an empty dataset", "store the array")
        if spec.dtype == STRING and text is None:
            location.fail("texts", f"type {dtype}", "store strings")
        # A character has at most 4 bytes in UTF-8.
        if spec.dtype == STRING and text.length is not None and text.length > 4 * LONGEST_TEXT:
            location.fail(f"texts of at most {LONGEST_TEXT} characters", f"type {dtype}", "shorten them")
        check_header(shape, dtype, spec, sizes, location)
        with convert_hdf5_errors(location):
            check_layout(dataset, location)
        return dataset


def _encode_name(name: str) -> bytes:
    """Return the bytes of an HDF5 name; characters that are not UTF-8 are kept unchanged."""
    return name.encode("utf-8", "surrogateescape")  # the inverse of h5py's decoding of names


def scalar(value: Any, location: Location) -> Any:
    """Return the single value of an attribute; a 0-d array becomes a plain value. Raises DatasetError for an array."""
    if isinstance(value, np.ndarray):
        if value.ndim:
            location.fail("one value", f"shape {list(value.shape)}", "store one value")
        return value[()]
    return value


def set_read_only(array: NDArray[Any]) -> NDArray[Any]:
    """Make an array read-only and return it. No other object may use the array."""
    array.flags.writeable = False
    return array
