"""Checks of the content of a dataset of version 2, of a file and of values that a program passes to the writer."""

from __future__ import annotations

from dataclasses import fields
from typing import Final

import numpy as np

from taxel.hand.errors import format_value
from taxel.recording.general.format import AXES, MODALITIES, Contact, Direction, GeneralHeader, Properties, TaxelPlaces
from taxel.recording.grasp_checks import Location
from taxel.recording.grasp_format import LARGEST_AXIS, REAL, SIM, Phase

LEAST_FRAMES: Final = 20
"""Smallest number of frames of a contact: ten without contact, and ten for the contact itself."""

_SHAPES: Final = {"sensor": (), "tx": (), "rx": (), "position": (3,), "normal": (3,), "size": ()}
_LINES: Final = ("sensor", "tx", "rx")


def check_properties(properties: Properties, location: Location) -> None:
    """Raise DatasetError for the first declared property with a value that the format does not permit."""
    for name, permitted in (("contact", tuple(Direction)), ("modality", MODALITIES)):
        value = getattr(properties, name)
        if value is not None and value not in permitted:
            remedy = "correct the attribute, or remove it: the property is then inferred"
            location.key(name).fail(f"one of {', '.join(permitted)}", format_value(value), remedy)
    for name in ("full_scale", "resolution"):
        value = getattr(properties, name)
        if value is not None and not (isinstance(value, float) and np.isfinite(value) and value > 0):
            location.key(name).fail("a finite number above 0", format_value(value), "correct or remove the attribute")
    if properties.unit is not None and not (isinstance(properties.unit, str) and 0 < len(properties.unit) <= 40):
        location.key("unit").fail("a unit of at most 40 characters", format_value(properties.unit), "correct it")


def check_places(places: TaxelPlaces, n: int, location: Location) -> None:
    """Raise DatasetError for an array of taxel properties with wrong values or without n rows.

    n: number of taxels in the values of the contacts. Numbers of sensors and electrode lines must be 0 to 255.
    """
    for item in fields(places):
        array = getattr(places, item.name)
        if array is None:
            continue
        shape = (n, *_SHAPES[item.name])
        array_location = location.key("taxels").key(item.name)
        if array.shape != shape:
            expected = f"shape {shape}, as values have {n} taxels"
            array_location.fail(expected, f"shape {array.shape}", "correct that array")
        if not np.isfinite(array).all():
            array_location.fail("finite numbers", "others", "correct that array, or leave it out if it is not known")
        is_outside = (array < 0) | (array > 255)
        if item.name in _LINES and is_outside.any():
            array_location.fail("numbers from 0 to 255", format_value(int(array[is_outside][0])), "number them from 0")
    if (places.tx is None) != (places.rx is None):
        location.key("taxels").fail("both tx and rx, or neither", "one of them", "add the other one")


def check_header(header: GeneralHeader, n: int, location: Location) -> None:
    """Raise DatasetError for the first deviation of the header from the format. n: number of taxels."""
    if header.source not in (REAL, SIM):
        location.key("source").fail('"real" or "sim"', format_value(header.source), "correct the attribute")
    if not 0 < n <= LARGEST_AXIS["n"]:
        location.key("grasps").fail(f"1 to {LARGEST_AXIS['n']} taxels", str(n), "check the order of the axes")
    check_properties(header.properties, location)
    check_places(header.places, n, location)


def check_contact(contact: Contact, n: int, is_vector: bool, location: Location) -> None:
    """Raise DatasetError for the first deviation of a contact from the format.

    n: number of taxels. is_vector: whether the value of a taxel has 3 components. Both are those of the first contact.
    """
    if contact.time.ndim != 1:
        location.key("time").fail("one time for each frame", f"shape {contact.time.shape}", "correct that array")
    frames = len(contact.time)
    shape = (frames, n, AXES) if is_vector else (frames, n)
    if contact.values.shape != shape:
        found = f"shape {contact.values.shape}"
        location.key("values").fail(f"shape {shape} (frames, taxels) as in the first contact", found, "correct it")
    if frames < LEAST_FRAMES:
        location.key("time").fail(f"at least {LEAST_FRAMES} frames", str(frames), "record longer, or leave it out")
    if not np.isfinite(contact.time).all() or (np.diff(contact.time) <= 0).any():
        location.key("time").fail("increasing finite seconds", "others", "sort the frames, and use one clock")
    if np.isinf(contact.values).any():
        location.key("values").fail("finite numbers, or NaN for a missing value", "an infinite number", "correct it")
    for name, expected in (
        ("phase", (frames,)),
        ("valid", (frames,)),
        ("force", (frames, n)),
        ("separation", (frames, n)),
    ):
        array = getattr(contact, name)
        if array is not None and array.shape != expected:
            location.key(name).fail(f"shape {expected}", f"shape {array.shape}", "correct that array")
    if contact.phase is not None and contact.phase.max(initial=0) > max(Phase):
        location.key("phase").fail("0 to 4", str(int(contact.phase.max())), "see docs/dataset-format.md")
    if (contact.force is None) != (contact.separation is None):
        location.fail("both force and separation, or neither", "one of them", "add the other one")
