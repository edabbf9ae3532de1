"""Checks of the arrays and texts of a grasp dataset, both for a file and for values that a program passes to the
writer.

Each check takes a `Location` (file and HDF5 path) and raises DatasetError with this location.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from math import prod
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from taxel.hand.errors import format_path, format_value
from taxel.recording.errors import DatasetError
from taxel.recording.grasp_format import LARGEST_ARRAY_BYTES, LARGEST_AXIS, LONGEST_TEXT, STRING, ArraySpec, Phase
from taxel.types import BoolArray, FloatArray

POSE_TOLERANCE = 1e-6
"""Largest deviation of an element of R R^T from the identity. Origin: float64 rotations from kinematics deviate by less
than 1e-12 and float32 rotations by less than 1e-6. A larger value accepts skewed poses.
"""

NORMAL_TOLERANCE = 1e-3
"""Largest deviation of the length of a normal from 1. Origin: normals with three decimals in a text file are accepted.
A larger value scales the taxel normals, and with them the contact forces, by more than 0.1 %.
"""

_KIND_NAMES = {"u": "integers", "i": "integers", "f": "floating-point numbers", "?": "booleans, or integers 0 and 1"}


@dataclass(frozen=True)
class Location:
    """A place in a dataset, a file and an HDF5 path in the file, which an error message names."""

    file: str
    path: str = ""

    def key(self, name: str) -> Location:
        """Return the location of a group, an array or an attribute below this location of a dataset."""
        return Location(self.file, f"{self.path}/{name}")

    def fail(self, expected: str, found: str, remedy: str) -> NoReturn:
        """Raise DatasetError with this location in a dataset file."""
        raise DatasetError(format_path(self.file), format_path(self.path or "/"), expected, found, remedy)


def check_header(
    shape: tuple[int, ...], dtype: Any, spec: ArraySpec, sizes: dict[str, int], location: Location
) -> None:
    """Check the type and the shape of an array of a dataset before its values are read; raises DatasetError.

    spec: type and axes that the format requires. sizes: length of each axis in the arrays checked so far, by the letter
    of the axis, such as "n"; a new axis is added.
    """
    _check_kind(dtype, spec, location)
    axes = ", ".join(str(axis) for axis in spec.axes)
    expected = f"shape [{axes}]" + _format_sizes(spec, sizes)
    if len(shape) != len(spec.axes):
        location.fail(expected, f"{list(shape)}", "write the array in that shape")
    for axis, length in zip(spec.axes, shape, strict=True):
        if isinstance(axis, str) and axis not in sizes:
            if not 1 <= length <= LARGEST_AXIS[axis]:
                location.fail(f"{expected} with {axis} from 1 to {LARGEST_AXIS[axis]}", f"{list(shape)}", "correct it")
            sizes[axis] = length
        elif length != (axis if isinstance(axis, int) else sizes[axis]):
            location.fail(expected, f"{list(shape)}", "write the array in that shape")
    width = 8 if spec.dtype == STRING else max(np.dtype(spec.dtype).itemsize, dtype.itemsize)
    if prod(shape) * width > LARGEST_ARRAY_BYTES:
        location.fail(f"at most {LARGEST_ARRAY_BYTES} bytes", f"{list(shape)}", "split the grasp")


def _format_sizes(spec: ArraySpec, sizes: Mapping[str, int]) -> str:
    """Format the known lengths of the axes of an array for an error message, such as " (T = 10, n = 64)"."""
    letters = [axis for axis in dict.fromkeys(spec.axes) if isinstance(axis, str) and axis in sizes]
    return f" ({', '.join(f'{axis} = {sizes[axis]}' for axis in letters)})" if letters else ""


def _check_kind(dtype: Any, spec: ArraySpec, location: Location) -> None:
    """Raise DatasetError if the stored type of an array cannot represent the type that the format requires."""
    if spec.dtype == STRING:
        return  # HDF5 and NumPy store strings in several types; the readers of strings check them
    # Kinds of NumPy: b boolean, u unsigned, i signed, f floating-point. `convert_type` then checks the values.
    expected = np.dtype(spec.dtype).kind
    allowed = {"b": "bui", "u": "ui", "i": "ui", "f": "f"}[expected]
    if dtype.kind not in allowed:
        name = _KIND_NAMES["?" if expected == "b" else expected]
        location.fail(name, f"type {dtype}", f"store it as {np.dtype(spec.dtype)}")


def convert_type(array: NDArray[Any], spec: ArraySpec, location: Location) -> NDArray[Any]:
    """Convert an array to the type that the format requires.

    Raises DatasetError for a value outside the range of this type, a NaN or an infinity, and for a floating-point
    number that this type does not represent exactly.
    """
    dtype = np.dtype(spec.dtype)
    if dtype.kind == "f":
        with np.errstate(over="ignore"):
            result = np.ascontiguousarray(array, dtype=dtype)
        if not np.isfinite(result).all():
            at = find_first(~np.isfinite(result))
            location.fail("finite numbers", f"{result[at]} at {format_index(at)}", "remove or correct that value")
        if array.dtype.itemsize > dtype.itemsize and (result != array).any():
            at = find_first(result != array)
            found = f"{array[at]} at {format_index(at)}"
            location.fail("numbers that float64 represents exactly", found, "store float64")
        return result
    # A boolean in a file may have any byte value.
    numbers = array.view(np.uint8) if array.dtype == np.bool_ else array
    low, high = (0, 1) if dtype.kind == "b" else (np.iinfo(dtype).min, np.iinfo(dtype).max)
    if numbers.size and (int(numbers.min()) < low or int(numbers.max()) > high):
        at = find_first((numbers < low) | (numbers > high))
        location.fail(f"values from {low} to {high}", f"{numbers[at]} at {format_index(at)}", "correct that value")
    return np.ascontiguousarray(array, dtype=dtype)


def check_array(array: Any, spec: ArraySpec, sizes: dict[str, int], location: Location) -> NDArray[Any]:
    """Convert an array given by a program to the type of the format, with the same checks as for an array in a file.

    sizes: length of each axis so far; a new axis is added. Raises DatasetError for the first error.
    """
    try:
        values = np.asarray(array)
    except ValueError:
        location.fail("an array", "rows of different lengths", "make them equally long")
    check_header(values.shape, values.dtype, spec, sizes, location)
    return convert_type(values, spec, location)


def check_content(name: str, array: NDArray[Any], location: Location) -> None:
    """Check the values of the array `name` of a grasp, such as times, phases or poses; raises DatasetError."""
    if name == "timestamp":
        _check_times(array, location)
    elif name == "phase" and array.max() > max(Phase):
        at = find_first(array > max(Phase))
        location.fail("phases from 0 to 4", f"{array[at]} at {format_index(at)}", "correct that frame's phase")
    elif name in ("sensor_pose", "sensor_pose_t", "object_pose"):
        check_poses(array, location)
    elif name == "contact_force" and array.min() < 0.0:
        at = find_first(array < 0.0)
        remedy = "correct the sign: a contact cannot pull a taxel"
        location.fail("forces of 0 N or more", f"{array[at]} at {format_index(at)}", remedy)


def _check_times(times: FloatArray, location: Location) -> None:
    """Raise DatasetError if the times f64[T] of a grasp decrease."""
    decreases = times[1:] < times[:-1]
    if decreases.any():
        frame = find_first(decreases)[0] + 1
        found = f"{times[frame]} after {times[frame - 1]} at [{frame}]"
        location.fail("times that do not decrease", found, "put the frames in order of time")


def check_poses(poses: FloatArray, location: Location) -> None:
    """Raise DatasetError unless each pose of f64[..., 4, 4] is a rotation and a translation, metres."""
    remedy = "store [R t; 0 0 0 1] with R a rotation"
    rotation = poses[..., :3, :3]
    with np.errstate(over="ignore", invalid="ignore"):
        error = np.abs(rotation @ np.swapaxes(rotation, -1, -2) - np.eye(3)).max(axis=(-1, -2))
        # "not <=" also rejects a NaN from an overflow.
        is_skewed = ~(error <= POSE_TOLERANCE)
        is_mirrored = ~(np.linalg.det(rotation) > 0.0)
    if (poses[..., 3, :] != (0.0, 0.0, 0.0, 1.0)).any():
        at = find_first((poses[..., 3, :] != (0.0, 0.0, 0.0, 1.0)).any(axis=-1))
        location.fail("a last row 0 0 0 1", f"{poses[at][3].tolist()} at {format_index(at)}", remedy)
    if is_skewed.any():
        at = find_first(is_skewed)
        found = f"columns off by {error[at]:.2g} at {format_index(at)}"
        location.fail(f"an orthonormal rotation (to {POSE_TOLERANCE:g})", found, remedy)
    if is_mirrored.any():
        location.fail(
            "a rotation of determinant +1", f"a reflection at {format_index(find_first(is_mirrored))}", remedy
        )


def find_first(mask: BoolArray | np.bool_) -> tuple[int, ...]:
    """Return the index of the first True of an array, as a tuple."""
    return tuple(int(i) for i in np.unravel_index(int(np.argmax(mask)), np.shape(mask)))


def format_index(index: tuple[int, ...]) -> str:
    """Format an array index for an error message, such as "[3, 17]"."""
    return str(list(index))


def check_text(value: Any, location: Location) -> str:
    """Return `value` as a string of one printable line; bytes are decoded as UTF-8.

    Raises DatasetError for another value, an empty string, and more than `LONGEST_TEXT` characters.
    """
    if isinstance(value, bytes):
        try:
            value = value.decode("utf-8")
        except UnicodeDecodeError:
            location.fail("UTF-8 text", format_value(value), "store it as UTF-8")
    if not isinstance(value, str):
        location.fail("a string", format_value(value), "write the attribute again")
    if not value or len(value) > LONGEST_TEXT or not value.isprintable():
        expected = f"1 to {LONGEST_TEXT} printable characters"
        location.fail(expected, format_value(value) if value else "an empty text", "correct the text")
    return str(value)


def check_choice(value: Any, choices: tuple[str, ...], location: Location) -> str:
    """Return `value` if it is one of the strings in `choices`; else raise DatasetError."""
    text = check_text(value, location)
    if text not in choices:
        location.fail(" or ".join(f'"{choice}"' for choice in choices), format_value(text), "write one of these")
    return text


def check_created(value: Any, location: Location) -> str:
    """Return `value` if it is a date and time in ISO 8601; else raise DatasetError."""
    text = check_text(value, location)
    try:
        datetime.fromisoformat(text)
    except ValueError:
        location.fail("a time of ISO 8601", format_value(text), "write it as 2024-05-31T12:00:00+00:00")
    return text


def check_integer(value: Any, location: Location) -> int:
    """Return `value` if it is an integer from 0 to 2^63 - 1; else raise DatasetError."""
    if isinstance(value, bool | np.bool_) or not isinstance(value, int | np.integer):
        location.fail("an integer of 0 or more", format_value(value), "store an integer")
    if not 0 <= value < 2**63:
        location.fail("an integer from 0 to 2^63 - 1", format_value(int(value)), "count from 0")
    return int(value)


def check_outcome(attempts: Any, failure: Any, location: Location) -> tuple[int | None, str | None]:
    """Check the optional attributes of a grasp's outcome; return (number of attempts, failure), None where absent.

    Raises DatasetError for a number of attempts below 1 and for a failure that is no text.
    """
    if attempts is not None and check_integer(attempts, location.key("attempts")) < 1:
        location.key("attempts").fail("an integer of 1 or more", "0", "count the first attempt, too")
    number = None if attempts is None else int(attempts)
    return number, None if failure is None else check_text(failure, location.key("failure"))


def check_number(value: Any, location: Location, allow_zero: bool = False) -> float:
    """Return `value` as a float if it is a finite number above 0, or 0 with `allow_zero`; else raise DatasetError."""
    expected = "a finite number of 0 or more" if allow_zero else "a finite number above 0"
    if isinstance(value, bool | np.bool_) or not isinstance(value, int | float | np.integer | np.floating):
        location.fail(expected, format_value(value), "store one number")
    try:
        number = float(value)
    except OverflowError:
        number = np.inf
    if not np.isfinite(number) or number < 0.0 or (number == 0.0 and not allow_zero):
        location.fail(expected, str(number), "correct it")
    return number
