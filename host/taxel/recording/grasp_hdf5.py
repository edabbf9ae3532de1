"""Strict, bounded reading of an HDF5 file: hard links only, nothing allocated before its size is known."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from math import prod
from pathlib import Path
from typing import Any

import h5py  # type: ignore[import-untyped, unused-ignore]
import numpy as np
from numpy.typing import NDArray

from taxel.hand.errors import shown
from taxel.recording.grasp_checks import Place, check_header, typed
from taxel.recording.grasp_format import LARGEST_ARRAY_BYTES, LONGEST_TEXT, STRING, ArraySpec

_LARGEST_ATTRIBUTE = 2**20
"""Values; the largest is baseline_counts, one for each taxel."""

_DAMAGED = "the file is damaged or was cut; copy it again or record anew"


@contextmanager
def hdf5_errors(place: Place) -> Iterator[None]:
    """Turn what the HDF5 library raises on a damaged file into a DatasetError for this place."""
    try:
        yield
    except (OSError, RuntimeError, LookupError, ValueError, TypeError, OverflowError, MemoryError) as error:
        place.fail("readable HDF5 data", shown(str(error).partition("\n")[0]), _DAMAGED)


def open_hdf5(path: Path, mode: str, libver: tuple[str, str] | None = None) -> Any:
    """An h5py.File; raises DatasetError for a file that is missing, no HDF5 file, cut, or open elsewhere."""
    place = Place(str(path))
    if not path.is_file():
        place.fail("an HDF5 file", "a folder" if path.is_dir() else "nothing", "check the path")
    try:
        return h5py.File(path, mode, libver=libver)
    except OSError as error:
        text = str(error)
        if "signature not found" in text:
            place.fail("an HDF5 file", "another kind of file", "give a grasp dataset")
        if "truncated file" in text:
            place.fail("a whole HDF5 file", "one whose end is missing", _DAMAGED)
        if "unable to lock" in text:
            place.fail("a file that no one is writing", "one that is open elsewhere", "wait until it is closed")
        place.fail("a readable HDF5 file", shown(text.partition("\n")[0]), _DAMAGED)


class Node:
    """A group of an HDF5 file and its place. Only hard links are followed, so that nothing outside is read."""

    def __init__(self, group: Any, place: Place) -> None:
        self._group = group
        self.place = place
        self._open: dict[tuple[str, ArraySpec], Any] = {}

    def names(self) -> list[str]:
        """Names of everything in this group, sorted."""
        with hdf5_errors(self.place):
            return sorted(self._group)

    def has(self, name: str) -> bool:
        """Whether something of that name stands here."""
        with hdf5_errors(self.place.key(name)):
            return bool(self._group.id.links.exists(_encoded(name)))

    def group(self, name: str) -> Node:
        """The group of that name."""
        return Node(self._child(name, h5py.Group, "group"), self.place.key(name))

    def check_array(self, name: str, spec: ArraySpec, sizes: dict[str, int]) -> None:
        """Check kind and shape of an array without reading it. sizes: as in `check_header`."""
        # To find and check one of hundreds of datasets takes as long as to read it: it stays open until it is read.
        self._open[name, spec] = self._checked(name, spec, sizes)

    def array(self, name: str, spec: ArraySpec, sizes: dict[str, int]) -> Any:
        """Read an array in its documented type; a list of str for texts. sizes: as in `check_header`."""
        dataset, place = self._open.pop((name, spec), None), self.place.key(name)
        if dataset is None:
            dataset = self._checked(name, spec, sizes)
        with hdf5_errors(place):
            values = dataset[()]
        return list(values) if spec.dtype == STRING else typed(values, spec, place)

    def length(self, name: str) -> int:
        """Length of the first axis of an array that has been checked."""
        with hdf5_errors(self.place.key(name)):
            return int(self._group[name].shape[0])

    def attribute(self, name: str) -> Any:
        """The value of an attribute: a scalar, an array or a text."""
        value = self.optional_attribute(name)
        if value is None:
            self.place.key(name).fail("an attribute", "nothing", "add it")
        return value

    def optional_attribute(self, name: str) -> Any:
        """The value of an attribute, or None where it is absent."""
        place = self.place.key(name)
        with hdf5_errors(place):
            if name not in self._group.attrs:
                return None
            header = self._group.attrs.get_id(name)
            null = header.get_space().get_simple_extent_type() == h5py.h5s.NULL
            shape, dtype, text = header.shape, header.dtype, h5py.check_string_dtype(header.dtype)
        if null or (text is None and dtype.kind not in "biuf"):
            place.fail("a number or a text", "an empty value" if null else f"type {dtype}", "store it plainly")
        if prod(shape) > _LARGEST_ATTRIBUTE or len(shape) > 1:
            place.fail("one value, or one for each taxel", f"shape {list(shape)}", "correct it")
        with hdf5_errors(place):
            return self._group.attrs[name]

    def attributes(self, names: tuple[str, ...]) -> Mapping[str, Any]:
        """Values of those attributes that are there."""
        return {name: value for name in names if (value := self.optional_attribute(name)) is not None}

    def _child(self, name: str, kind: type, word: str) -> Any:
        place = self.place.key(name)
        if not self.has(name):
            place.fail(f"a {word}", "nothing", "add it")
        with hdf5_errors(place):
            link = self._group.id.links.get_info(_encoded(name))
        if link.type != h5py.h5l.TYPE_HARD:
            place.fail(f"a {word} of this file", "a link", "store the data itself; links are not followed")
        with hdf5_errors(place):
            child = self._group[name]
        if not isinstance(child, kind):
            place.fail(f"a {word}", f"a {type(child).__name__.lower()}", f"store a {word} there")
        return child

    def _checked(self, name: str, spec: ArraySpec, sizes: dict[str, int]) -> Any:
        dataset, place = self._child(name, h5py.Dataset, "dataset"), self.place.key(name)
        with hdf5_errors(place):
            shape, dtype, chunks = dataset.shape, dataset.dtype, dataset.chunks
            outside = dataset.is_virtual or dataset.external is not None
            text = h5py.check_string_dtype(dtype)
        if shape is None:
            place.fail("an array", "an empty dataset", "store the array")
        if outside:
            place.fail("data in this file", "data in another file", "store the data itself; links are not followed")
        if spec.dtype == STRING and text is None:
            place.fail("texts", f"type {dtype}", "store strings")
        if spec.dtype == STRING and text.length is not None and text.length > 4 * LONGEST_TEXT:
            place.fail(f"texts of at most {LONGEST_TEXT} characters", f"type {dtype}", "shorten them")
        check_header(shape, dtype, spec, sizes, place)
        if chunks is not None and prod(chunks) * dtype.itemsize > LARGEST_ARRAY_BYTES:
            place.fail(f"chunks of at most {LARGEST_ARRAY_BYTES} bytes", f"{list(chunks)}", "use smaller chunks")
        return dataset


def _encoded(name: str) -> bytes:
    return name.encode("utf-8", "surrogateescape")  # as h5py decodes the names that it lists


def scalar(value: Any, place: Place) -> Any:
    """The one value of an attribute."""
    if isinstance(value, np.ndarray):
        if value.ndim:
            place.fail("one value", f"shape {list(value.shape)}", "store one value")
        return value[()]
    return value


def read_only(array: NDArray[Any]) -> NDArray[Any]:
    """The array, which no one else has, set read-only."""
    array.flags.writeable = False
    return array
