"""What the arrays and texts of a grasp dataset must be, whether they stand in a file or come from a program.

Every check takes a `Place`, which knows the file and the field, and raises DatasetError there.
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

POSE_TOLERANCE = 1e-6
"""Largest departure of the product of a rotation and its transpose from the identity."""

NORMAL_TOLERANCE = 1e-3
"""Largest departure of a normal's length from 1."""

_WORDS = {"u": "integers", "i": "integers", "f": "floating-point numbers", "?": "booleans, or integers 0 and 1"}


@dataclass(frozen=True)
class Place:
    """A place in a grasp dataset: where an error points."""

    file: str
    path: str = ""

    def key(self, name: str) -> Place:
        """The place of a group, an array or an attribute below this one."""
        return Place(self.file, f"{self.path}/{name}")

    def fail(self, expected: str, found: str, remedy: str) -> NoReturn:
        """Raise DatasetError for this place."""
        raise DatasetError(format_path(self.file), format_path(self.path or "/"), expected, found, remedy)


def check_header(shape: tuple[int, ...], dtype: Any, spec: ArraySpec, sizes: dict[str, int], place: Place) -> None:
    """Check the kind and the shape of an array; its values need not be known.

    sizes: length of each axis known so far; an axis that is new is added.
    """
    _check_kind(dtype, spec, place)
    axes = ", ".join(str(axis) for axis in spec.axes)
    wanted = f"shape [{axes}]" + _known(spec, sizes)
    if len(shape) != len(spec.axes):
        place.fail(wanted, f"{list(shape)}", "write the array in that shape")
    for axis, length in zip(spec.axes, shape, strict=True):
        if isinstance(axis, str) and axis not in sizes:
            if not 1 <= length <= LARGEST_AXIS[axis]:
                place.fail(f"{wanted} with {axis} from 1 to {LARGEST_AXIS[axis]}", f"{list(shape)}", "correct it")
            sizes[axis] = length
        elif length != (axis if isinstance(axis, int) else sizes[axis]):
            place.fail(wanted, f"{list(shape)}", "write the array in that shape")
    width = 8 if spec.dtype == STRING else max(np.dtype(spec.dtype).itemsize, dtype.itemsize)
    if prod(shape) * width > LARGEST_ARRAY_BYTES:
        place.fail(f"at most {LARGEST_ARRAY_BYTES} bytes", f"{list(shape)}", "split the grasp")


def _known(spec: ArraySpec, sizes: Mapping[str, int]) -> str:
    letters = [axis for axis in dict.fromkeys(spec.axes) if isinstance(axis, str) and axis in sizes]
    return f" ({', '.join(f'{axis} = {sizes[axis]}' for axis in letters)})" if letters else ""


def _check_kind(dtype: Any, spec: ArraySpec, place: Place) -> None:
    if spec.dtype == STRING:
        return  # strings have several forms in HDF5 and NumPy: their readers check them
    wanted = np.dtype(spec.dtype).kind
    allowed = {"b": "bui", "u": "ui", "i": "ui", "f": "f"}[wanted]
    if dtype.kind not in allowed:
        place.fail(_WORDS["?" if wanted == "b" else wanted], f"type {dtype}", f"store it as {np.dtype(spec.dtype)}")


def typed(array: NDArray[Any], spec: ArraySpec, place: Place) -> NDArray[Any]:
    """The array in the documented type; refuses a value that this type does not hold, and every NaN and infinity."""
    wanted = np.dtype(spec.dtype)
    if wanted.kind == "f":
        with np.errstate(over="ignore"):
            result = np.ascontiguousarray(array, dtype=wanted)
        if not np.isfinite(result).all():
            at = first(~np.isfinite(result))
            place.fail("finite numbers", f"{result[at]} at {shown_index(at)}", "leave out or correct that value")
        if array.dtype.itemsize > wanted.itemsize and (result != array).any():
            at = first(result != array)
            place.fail("numbers that float64 holds exactly", f"{array[at]} at {shown_index(at)}", "store float64")
        return result
    # A boolean may hold any byte in a file.
    numbers = array.view(np.uint8) if array.dtype == np.bool_ else array
    low, high = (0, 1) if wanted.kind == "b" else (np.iinfo(wanted).min, np.iinfo(wanted).max)
    if numbers.size and (int(numbers.min()) < low or int(numbers.max()) > high):
        at = first((numbers < low) | (numbers > high))
        place.fail(f"values from {low} to {high}", f"{numbers[at]} at {shown_index(at)}", "correct that value")
    return np.ascontiguousarray(array, dtype=wanted)


def given(array: Any, spec: ArraySpec, sizes: dict[str, int], place: Place) -> NDArray[Any]:
    """An array that a program hands over, checked like one in a file and in the documented type."""
    try:
        values = np.asarray(array)
    except ValueError:
        place.fail("an array", "rows of different lengths", "make them equally long")
    check_header(values.shape, values.dtype, spec, sizes, place)
    return typed(values, spec, place)


def check_content(name: str, array: NDArray[Any], place: Place) -> None:
    """Check what the values of a grasp's array mean; the array has its documented type."""
    if name == "timestamp":
        _check_times(array, place)
    elif name == "phase" and array.max() > max(Phase):
        at = first(array > max(Phase))
        place.fail("phases from 0 to 4", f"{array[at]} at {shown_index(at)}", "correct that frame's phase")
    elif name in ("sensor_pose", "sensor_pose_t", "object_pose"):
        check_poses(array, place)
    elif name == "contact_force" and array.min() < 0.0:
        at = first(array < 0.0)
        place.fail("forces of 0 N or more", f"{array[at]} at {shown_index(at)}", "a taxel is only pressed, not pulled")


def _check_times(times: NDArray[np.float64], place: Place) -> None:
    back = times[1:] < times[:-1]
    if back.any():
        frame = first(back)[0] + 1
        found = f"{times[frame]} after {times[frame - 1]} at [{frame}]"
        place.fail("times that never go back", found, "put the frames in order of time")


def check_poses(poses: NDArray[np.float64], place: Place) -> None:
    """Check f64[..., 4, 4]: each a rotation and a translation, metres."""
    remedy = "store [R t; 0 0 0 1] with R a rotation"
    rotation = poses[..., :3, :3]
    with np.errstate(over="ignore", invalid="ignore"):
        error = np.abs(rotation @ np.swapaxes(rotation, -1, -2) - np.eye(3)).max(axis=(-1, -2))
        # Written as not <=, so that an overflow to NaN is refused too.
        skewed = ~(error <= POSE_TOLERANCE)
        mirrored = ~(np.linalg.det(rotation) > 0.0)
    if (poses[..., 3, :] != (0.0, 0.0, 0.0, 1.0)).any():
        at = first((poses[..., 3, :] != (0.0, 0.0, 0.0, 1.0)).any(axis=-1))
        place.fail("a last row 0 0 0 1", f"{poses[at][3].tolist()} at {shown_index(at)}", remedy)
    if skewed.any():
        at = first(skewed)
        found = f"columns off by {error[at]:.2g} at {shown_index(at)}"
        place.fail(f"an orthonormal rotation (to {POSE_TOLERANCE:g})", found, remedy)
    if mirrored.any():
        place.fail("a rotation of determinant +1", f"a mirroring at {shown_index(first(mirrored))}", remedy)


def first(wrong: NDArray[np.bool_] | np.bool_) -> tuple[int, ...]:
    """The index of the first True."""
    return tuple(int(i) for i in np.unravel_index(int(np.argmax(wrong)), np.shape(wrong)))


def shown_index(at: tuple[int, ...]) -> str:
    """An index as people write it: [3, 17]."""
    return str(list(at))


def check_text(value: Any, place: Place) -> str:
    """A text of one printable line; bytes are UTF-8."""
    if isinstance(value, bytes):
        try:
            value = value.decode("utf-8")
        except UnicodeDecodeError:
            place.fail("UTF-8 text", format_value(value), "store it as UTF-8")
    if not isinstance(value, str):
        place.fail("a text", format_value(value), "store a string")
    if not value or len(value) > LONGEST_TEXT or not value.isprintable():
        expected = f"1 to {LONGEST_TEXT} printable characters"
        place.fail(expected, format_value(value) if value else "an empty text", "correct the text")
    return str(value)


def check_choice(value: Any, choices: tuple[str, ...], place: Place) -> str:
    """One of a few texts."""
    text = check_text(value, place)
    if text not in choices:
        place.fail(" or ".join(f'"{choice}"' for choice in choices), format_value(text), "write one of these")
    return text


def check_created(value: Any, place: Place) -> str:
    """A date and time of ISO 8601."""
    text = check_text(value, place)
    try:
        datetime.fromisoformat(text)
    except ValueError:
        place.fail("a time of ISO 8601", format_value(text), "write it as 2024-05-31T12:00:00+00:00")
    return text


def check_integer(value: Any, place: Place) -> int:
    """An integer of 0 or more, of 63 bits."""
    if isinstance(value, bool | np.bool_) or not isinstance(value, int | np.integer):
        place.fail("an integer of 0 or more", format_value(value), "store a whole number")
    if not 0 <= value < 2**63:
        place.fail("an integer from 0 to 2^63 - 1", format_value(int(value)), "count from 0")
    return int(value)


def check_number(value: Any, place: Place, zero: bool = False) -> float:
    """A finite number above 0; or 0 too."""
    wanted = "a finite number of 0 or more" if zero else "a finite number above 0"
    if isinstance(value, bool | np.bool_) or not isinstance(value, int | float | np.integer | np.floating):
        place.fail(wanted, format_value(value), "store one number")
    try:
        number = float(value)
    except OverflowError:
        number = np.inf
    if not np.isfinite(number) or number < 0.0 or (number == 0.0 and not zero):
        place.fail(wanted, str(number), "correct it")
    return number
