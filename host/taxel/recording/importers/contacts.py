"""Division of the frames of a file into contacts."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from taxel.hand.errors import format_value
from taxel.recording.general.checks import LEAST_FRAMES
from taxel.recording.general.format import DEFAULT_APPROACH, DEFAULT_OBJECT, Contact
from taxel.recording.grasp_checks import Location
from taxel.recording.grasp_format import Phase
from taxel.recording.importers.mapping import Grouping, Labels
from taxel.types import BoolArray, ByteArray, FloatArray

DEFAULT_SESSION: Final = 1
"""Session number of contacts whose session is not given."""

_FRAME_ARRAYS: Final = ("phase", "valid", "force", "separation")


@dataclass(frozen=True, eq=False)
class Recording:
    """The T frames of a file, before their division into contacts.

    Attributes:
        location: the file, for error messages.
        time: f64[T], seconds. values: f64[T, n] of n taxels, or f64[T, n, 3] of vector taxels.
        labels: labels of all contacts of the file. label_arrays: labels of each frame, [T], by the name of the label.
        contact: number or name of the contact of each frame, [T]; -1, NaN and "" mark a frame outside all contacts.
            None: a `Grouping` divides the frames.
        phase, valid, force, separation: as in `Contact`; None: not known.
    """

    location: Location
    time: FloatArray
    values: FloatArray
    labels: Labels = field(default_factory=Labels)
    label_arrays: dict[str, NDArray[Any]] = field(default_factory=dict)
    contact: NDArray[Any] | None = None
    phase: ByteArray | None = None
    valid: BoolArray | None = None
    force: FloatArray | None = None
    separation: FloatArray | None = None


def divide(recording: Recording, grouping: Grouping) -> Iterator[NDArray[np.intp]]:
    """Yield the frame indices of each contact of a recording, in order of the contacts' first frames.

    Frames outside all contacts are left out: their contact number is negative or not finite, or their contact name is
    empty. Raises DatasetError for a time that is not finite.
    """
    _check_finite(recording)
    if recording.contact is not None:
        ids = recording.contact
        is_number = ids.dtype.kind in "iufb"
        is_contact = np.isfinite(ids) & (ids >= 0) if is_number else ids != ""
        names, first = np.unique(ids[is_contact], return_index=True)
        for name in names[np.argsort(first)]:
            yield np.flatnonzero(is_contact & (ids == name))
        return
    starts = [0]
    if grouping.gap_s is not None:
        starts += (np.flatnonzero(np.diff(recording.time) > grouping.gap_s) + 1).tolist()
    for start, end in zip(starts, [*starts[1:], len(recording.time)], strict=True):
        yield np.arange(start, end)


def make_contacts(recording: Recording, grouping: Grouping, first: int = 0) -> Iterator[Contact]:
    """Yield the contacts of a recording, whose times each begin at 0.

    first: number of contacts that the dataset already has; the ids continue from there. Raises DatasetError for a
    contact whose labels change or whose times do not increase, and for a contact that is too short, unless the grouping
    leaves out short contacts.
    """
    number = first
    for frames in divide(recording, grouping):
        if len(frames) < LEAST_FRAMES:
            if grouping.skip_short:
                continue
            remedy = "choose another rule for contacts, or leave out short contacts (skip_short = true)"
            location = recording.location.key(f"contact {number - first + 1}")
            location.fail(f"at least {LEAST_FRAMES} frames", str(len(frames)), remedy)
        time = recording.time[frames]
        _check_increasing(recording, frames)
        arrays: dict[str, Any] = {}
        for name in _FRAME_ARRAYS:
            array = getattr(recording, name)
            arrays[name] = None if array is None else array[frames]
        labels = _find_labels(recording, frames)
        yield Contact(
            id=f"{number + 1:05d}",
            session=DEFAULT_SESSION if labels.session is None else labels.session,
            time=time - time[0],
            values=recording.values[frames],
            object=labels.object or DEFAULT_OBJECT,
            approach=labels.approach or DEFAULT_APPROACH,
            **arrays,
        )
        number += 1


def _check_finite(recording: Recording) -> None:
    """Raise DatasetError for a time that is not finite."""
    wrong = np.flatnonzero(~np.isfinite(recording.time))
    if len(wrong):
        found = f"{recording.time[wrong[0]]} in frame {wrong[0]}"
        recording.location.key("time").fail("a finite time of every frame", found, "remove those frames")


def _check_increasing(recording: Recording, frames: NDArray[np.intp]) -> None:
    """Raise DatasetError for the first time that does not increase among `frames`, the frame indices of a contact."""
    time = recording.time[frames]
    wrong = np.flatnonzero(np.diff(time) <= 0)
    if len(wrong):
        at = int(wrong[0])
        found = f"{time[at + 1]:.9g} s after {time[at]:.9g} s in frame {frames[at + 1]}"
        remedy = "sort the frames, remove repeated ones, or correct the field of the contact"
        recording.location.key("time").fail("increasing times in a contact", found, remedy)


def _find_labels(recording: Recording, frames: NDArray[np.intp]) -> Labels:
    """Return the labels of the contact with the frame indices `frames`: labels of its frames, else constant labels.

    Raises DatasetError for a label that changes within the contact, and for a session that is no number of 0 or more.
    """
    found: dict[str, Any] = {}
    for name, array in recording.label_arrays.items():
        location = recording.location.key(name)
        entries = np.unique(array[frames])
        if len(entries) != 1:
            text = f"{format_value(entries[0].item())} and {format_value(entries[1].item())}"
            location.fail("one label in each contact", text, "correct the labels, or the field of the contact")
        value = entries[0].item()
        if name == "session":
            if isinstance(value, str) or not np.isfinite(value) or value != int(value) or value < 0:
                location.fail("a number of 0 or more", format_value(value), "number the sessions")
            found[name] = int(value)
        else:
            found[name] = f"{value:g}" if isinstance(value, float) else str(value)
    return recording.labels.merge(Labels(**found))


def convert_phases(array: NDArray[Any], location: Location) -> ByteArray:
    """Convert phases, given as numbers from 0 to 4 or as names such as "hold", to u8[T].

    Raises DatasetError for other numbers or names.
    """
    names = {phase.name.lower(): int(phase) for phase in Phase}
    expected = f"{', '.join(names)}, or 0 to 4"
    if array.dtype.kind in "iufb":
        is_valid = np.isfinite(array) & (array == np.floor(np.where(np.isfinite(array), array, 0)))
        is_valid &= (array >= 0) & (array <= max(Phase))
        if not is_valid.all():
            location.fail(expected, format_value(array[~is_valid][0].item()), "correct that phase")
        return array.astype(np.uint8)
    texts = np.char.lower(np.char.strip(array.astype(str)))
    for text in np.unique(texts):
        if str(text) not in names:
            location.fail(expected, format_value(str(text)), "correct that phase")
    return np.array([names[str(text)] for text in texts], np.uint8)
