"""Application of a mapping to a file: the selected fields are read and brought into the shapes of a recording."""

from __future__ import annotations

import re
from math import prod
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel.hand.errors import format_value
from taxel.recording.general.format import AXES, TaxelPlaces
from taxel.recording.grasp_checks import Location
from taxel.recording.importers.contacts import Recording, convert_phases
from taxel.recording.importers.fields import Source
from taxel.recording.importers.mapping import TIME_UNITS, Labels, Mapping, Selection, Times, Values
from taxel.recording.importers.places import make_grid_places
from taxel.types import FloatArray


def read_recording(source: Source, mapping: Mapping, labels: Labels) -> Recording:
    """Read the frames of a file by a mapping. labels: labels of all contacts of the file.

    If the first axis of the arrays is the contact, the result contains the frames of all contacts one after another,
    and the contact number of each frame in its field `contact`. Raises DatasetError for the first error.
    """
    array = read_selection(source, mapping.values.selection, mapping.values.frame_axis)
    is_batch = mapping.grouping.axis
    count = array.shape[:2] if is_batch else array.shape[:1]
    frames = prod(count)
    values = shape_values(array.reshape(frames, *array.shape[len(count) :]), mapping.values)
    time = read_times(source, mapping.times, frames, count[-1])
    contact: NDArray[Any] | None = None
    if is_batch:
        contact = np.repeat(np.arange(count[0]), count[1])
    elif mapping.grouping.name is not None:
        contact = _read_column(source, mapping.grouping.name, frames)
    n = values.shape[1]
    optional = {
        name: None if selection is None else _read_per_taxel(source, selection, frames, n)
        for name, selection in (("force", mapping.force), ("separation", mapping.separation))
    }
    phase = None
    if mapping.phase is not None:
        phase = convert_phases(_read_column(source, mapping.phase, frames), source.at(mapping.phase))
    valid = None if mapping.valid is None else _read_flags(source, mapping.valid, frames)
    contacts = count[0] if is_batch else None
    arrays = {name: _read_column(source, column, frames, contacts) for name, column in mapping.label_fields.items()}
    return Recording(source.location, time, values, labels, arrays, contact, phase, valid, **optional)


def select_columns(source: Source, selection: Selection) -> tuple[str, ...]:
    """Return the names of the selected fields in order. Raises DatasetError for an unknown name or prefix."""
    if selection.names is not None:
        return tuple(source.find(name).name for name in selection.names)
    if selection.prefix is not None:
        found = find_numbered(source, selection.prefix)
        if not found:
            similar = f"columns that begin with {format_value(selection.prefix)} and end with a number"
            source.at(selection.prefix).fail(similar, "none", "correct the prefix, or list the columns")
        return found
    assert selection.span is not None
    names = list(source.fields)
    first, last = (names.index(source.find(name).name) for name in selection.span)
    if last < first:
        selection.location.key("range").fail("the first column before the last", "the reverse", "exchange the names")
    return tuple(names[first : last + 1])


def find_numbered(source: Source, prefix: str) -> tuple[str, ...]:
    """Return the names of the fields that consist of the prefix and a number, in the order of the numbers."""
    numbered = re.compile(re.escape(prefix) + r"(\d+)")
    matches = [match for name in source.fields if (match := numbered.fullmatch(name)) is not None]
    return tuple(match[0] for match in sorted(matches, key=lambda match: int(match[1])))


def read_selection(source: Source, selection: Selection, frame_axis: int = 0) -> NDArray[Any]:
    """Read the selected fields as one array [frame, ...]; several fields are joined along the taxels.

    frame_axis: axis of the frames in each field. Raises DatasetError for a field that is not numeric, fields with
    different numbers of frames, and selected elements beyond the frame.
    """
    names = select_columns(source, selection)
    arrays: list[NDArray[Any]] = []
    for name in names:
        array = source.read_numbers(name)
        location = source.at(name)
        if array.ndim == 0 or not -array.ndim <= frame_axis < array.ndim:
            location.fail("an array with a frame axis", f"shape {array.shape}", "choose another field or frame_axis")
        array = np.moveaxis(array, frame_axis, 0)
        if arrays and len(array) != len(arrays[0]):
            remedy = "select fields that were recorded together"
            location.fail(f"{len(arrays[0])} frames as in {names[0]}", str(len(array)), remedy)
        arrays.append(array)
    if len(arrays) == 1:
        joined = arrays[0]
    else:
        joined = np.concatenate([array.reshape(len(array), -1) for array in arrays], axis=1)
    if selection.elements is not None:
        flat = joined.reshape(len(joined), -1)
        if selection.elements[-1] >= flat.shape[1]:
            found = f"{flat.shape[1]} values in a frame"
            selection.location.key("elements").fail(f"more than {selection.elements[-1]} values", found, "correct it")
        joined = flat[:, list(selection.elements)]
    return joined


def shape_values(array: NDArray[Any], values: Values) -> FloatArray:
    """Bring an array [T, ...] into the shape of values: f64[T, n], or f64[T, n, 3] for vector taxels.

    Raises DatasetError if the numbers of a frame do not fit the components or the expected shape.
    """
    location = values.selection.location
    flat = np.asarray(array, np.float64).reshape(len(array), prod(array.shape[1:]))
    if flat.shape[1] % values.components:
        location.key("components").fail("a multiple of 3 values in a frame", str(flat.shape[1]), "correct components")
    n = flat.shape[1] // values.components
    if values.shape is not None and prod(values.shape) != n:
        expected = f"{prod(values.shape)} taxels ({' x '.join(map(str, values.shape))})"
        location.key("shape").fail(expected, f"{n} taxels", "correct the shape, or the selection")
    if values.components == 1:
        return flat
    if values.order == "taxel":
        return flat.reshape(len(flat), n, AXES)
    # Order "component": a frame contains x of all taxels, then y, then z.
    return np.ascontiguousarray(flat.reshape(len(flat), AXES, n).swapaxes(1, 2))


def read_times(source: Source, times: Times, frames: int, length: int | None = None) -> FloatArray:
    """Return the times of all frames, f64[T], seconds from the first frame.

    frames: number T of frames. length: number of frames of each contact, if all contacts have the same times and the
    field contains them once. Raises DatasetError for another number of times, and without a frame.
    """
    if times.name is None:
        assert times.rate_hz is not None
        return np.arange(frames, dtype=np.float64) / times.rate_hz
    array = source.read_numbers(times.name).ravel()
    if length is not None and len(array) == length < frames:
        array = np.tile(array, frames // length)
    if len(array) != frames:
        found = f"{len(array)} times"
        source.at(times.name).fail(f"{frames} times, one for each frame", found, "choose another field")
    if not frames:
        source.at(times.name).fail("at least one frame", "none", "check whether the recording is empty")
    if array.dtype.kind in "bu":
        array = array.astype(np.int64)  # a difference of unsigned numbers cannot be negative
    # Nanoseconds since 1970 exceed the 53 bits of float64; integers are subtracted before they are converted.
    start = array[0] if np.isfinite(array[0]) else 0
    return np.asarray((array - start).astype(np.float64) * TIME_UNITS[times.unit])


def read_places(source: Source, mapping: Mapping) -> TaxelPlaces:
    """Return the positions and numbers of the taxels, from the mapping and from fields of a file.

    Raises DatasetError for a field that is not numeric, and for positions without 3 coordinates.
    """
    places = make_grid_places(mapping.grid) if mapping.grid is not None else TaxelPlaces()
    arrays: dict[str, Any] = {}
    if mapping.position is not None:
        scale = 1e-3 if mapping.position_unit == "mm" else 1.0
        position = source.read_numbers(mapping.position)
        if position.size % AXES:
            source.at(mapping.position).fail("3 coordinates of each taxel", f"shape {position.shape}", "correct it")
        arrays["position"] = position.reshape(-1, AXES).astype(np.float64) * scale
    for name, value in mapping.taxels.items():
        array = source.read_numbers(value).ravel() if isinstance(value, str) else np.array(value)
        arrays[name] = array.astype(np.int64)
    return TaxelPlaces(**{**vars(places), **arrays})


def _read_column(source: Source, name: str, frames: int, contacts: int | None = None) -> NDArray[Any]:
    """Read one entry for each frame, numbers or strings; a single entry is repeated for all frames.

    contacts: number of contacts of equal length, for each of which the field may have one entry; None: not known.
    Raises DatasetError for another number of entries.
    """
    array = source.read(name).ravel()
    if len(array) == 1:
        array = np.repeat(array, frames)
    elif contacts is not None and len(array) == contacts:
        array = np.repeat(array, frames // contacts)
    if len(array) != frames:
        expected = f"{frames} entries, one for each frame"
        source.at(name).fail(expected, str(len(array)), "choose another field")
    return array


def _read_flags(source: Source, name: str, frames: int) -> NDArray[np.bool_]:
    """Read a field that states with 0 or 1 whether each frame is valid; return bool[T].

    Raises DatasetError for other entries.
    """
    array = _read_column(source, name, frames)
    location: Location = source.at(name)
    if array.dtype.kind not in "iufb" or not np.isin(array, (0, 1)).all():
        location.fail("0 or 1 for each frame", "other entries", "correct the entries, or leave out valid")
    return np.asarray(array, bool)


def _read_per_taxel(source: Source, selection: Selection, frames: int, n: int) -> FloatArray:
    """Read the selected fields as f64[T, n], T = `frames`, n taxels. Raises DatasetError for another size."""
    array = read_selection(source, selection)
    if array.size != frames * n:
        found = f"shape {array.shape}"
        selection.location.fail(f"one value for each of {frames} frames and {n} taxels", found, "correct it")
    return np.asarray(array, np.float64).reshape(frames, n)
