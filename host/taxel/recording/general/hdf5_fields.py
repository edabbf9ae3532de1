"""Readers of the HDF5 fields of a version 2 dataset: values of the required type, or a one-line error message.

A number of another type is accepted if the conversion is exact, because many programs write every number as a float.
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from taxel.hand.errors import format_value
from taxel.optional import optional_import
from taxel.recording.grasp_checks import Location
from taxel.recording.grasp_format import LARGEST_ARRAY_BYTES, LONGEST_TEXT
from taxel.recording.hdf5_storage import check_layout, check_names, read_values

with optional_import("h5py", "a dataset (.h5)"):
    import h5py  # type: ignore[import-untyped, unused-ignore]

_NUMBERS: Final = "iufb"
_EXACT: Final = 2**53
"""Largest integer up to which a float64 represents every integer."""


def check_links(group: Any, location: Location, depth: int) -> None:
    """Raise DatasetError for a member of a group that is a soft or external link, also in subgroups.

    depth: number of levels of groups that are checked; 1: only the members of `group`.
    """
    names = list(group)
    check_names(names, location)
    for name in names:
        link = group.get(name, getlink=True)
        member_location = location.key(name)
        if not isinstance(link, h5py.HardLink):
            member_location.fail("data of this file", "a link", "store the data itself; links are not followed")
        if depth > 1 and isinstance(group[name], h5py.Group):
            check_links(group[name], member_location, depth - 1)


def read_text(attributes: Any, name: str, default: str, location: Location) -> str:
    """Return a string attribute; `default` if it is absent. Raises DatasetError for another type or a long string."""
    if name not in attributes:
        return default
    return decode_text(attributes[name], location.key(name))


def decode_text(value: object, location: Location) -> str:
    """Return a string, also one stored as UTF-8 bytes.

    Raises DatasetError for another type, or more than `LONGEST_TEXT` characters.
    """
    text = value.decode(errors="replace") if isinstance(value, bytes) else value
    if not isinstance(text, str) or len(text) > LONGEST_TEXT:
        expected = f"a string of at most {LONGEST_TEXT} characters"
        location.fail(expected, format_value(_simplify(text)), "store one string")
    return str(text)


def read_number(attributes: Any, name: str, location: Location) -> float:
    """Return a number attribute. Raises DatasetError for another type, a truth value, or several values."""
    value = _simplify(attributes[name])
    if isinstance(value, bool) or not isinstance(value, int | float):
        location.key(name).fail("one number", format_value(value), "correct the attribute")
    return float(value)


def read_integer(attributes: Any, name: str, default: int, location: Location) -> int:
    """Return an integer attribute, 0 to 2^53 - 1; `default` if it is absent. Raises DatasetError for other values."""
    if name not in attributes:
        return default
    value = _simplify(attributes[name])
    if isinstance(value, float) and value.is_integer():
        value = int(value)
    if type(value) is not int or not 0 <= value < _EXACT:
        location.key(name).fail("an integer of 0 or more", format_value(value), "correct the attribute")
    return value


def read_array(item: Any, location: Location) -> NDArray[Any]:
    """Read a numeric array in its stored type. item: `h5py.Dataset`.

    Raises DatasetError for another type, data in another file, and an array that is too large or expands too much.
    """
    if not isinstance(item, h5py.Dataset) or item.shape is None or item.dtype.kind not in _NUMBERS:
        kind = str(getattr(item, "dtype", "a group"))
        location.fail("an array of numbers", kind, "write numbers")
    # 8 bytes for each number, because most callers convert the array to float64 or int64.
    if item.size * 8 > LARGEST_ARRAY_BYTES:
        location.fail(f"at most {LARGEST_ARRAY_BYTES // 8} numbers", str(item.size), "divide the contact")
    check_layout(item, location)
    return np.asarray(read_values(item, location))


def read_floats(item: Any, location: Location) -> NDArray[np.float64]:
    """Read an array of numbers as f64. Raises DatasetError."""
    return read_array(item, location).astype(np.float64)


def read_integers(item: Any, location: Location) -> NDArray[np.int64]:
    """Read an array of integers, also stored as floating-point numbers, as i64. Raises DatasetError for fractions."""
    array = read_array(item, location)
    if array.dtype.kind == "f" or array.dtype == np.uint64:
        # Integers from `_EXACT` on are refused, because float64 does not represent all of them.
        numbers = array.astype(np.float64)
        if not (np.isfinite(numbers) & (np.abs(numbers) < _EXACT) & (numbers == np.round(numbers))).all():
            location.fail("integers", "other numbers", "correct that array")
    return array.astype(np.int64)


def read_flags(item: Any, location: Location) -> NDArray[np.bool_]:
    """Read an array of truth values, stored as booleans or as 0 and 1. Raises DatasetError for other numbers."""
    array = read_array(item, location)
    if not ((array == 0) | (array == 1)).all():
        location.fail("booleans, or 0 and 1", "other numbers", "correct that array")
    return array.astype(bool)


def _simplify(value: object) -> object:
    """Convert a NumPy scalar, or an array of one number, to a plain Python value; return other values unchanged."""
    if isinstance(value, np.ndarray) and value.size == 1 and value.ndim <= 1:
        return value.reshape(-1)[0].item() if value.dtype.kind in _NUMBERS else value
    return value.item() if isinstance(value, np.generic) else value
