"""Writer of grasp datasets of version 2."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import fields
from datetime import UTC, datetime
from os import PathLike
from typing import Any

import numpy as np

from taxel.recording.general.checks import check_contact, check_header
from taxel.recording.general.format import VERSION, Contact, GeneralHeader
from taxel.recording.grasp_checks import Location
from taxel.recording.grasp_format import FORMAT
from taxel.recording.grasp_storage import convert_writing_errors, open_whole_dataset
from taxel.recording.hdf5_output import WritableFile, open_new_hdf5

_CONTACT_ARRAYS = ("time", "values", "phase", "valid", "force", "separation", "sensor_pose", "object_pose")


def write_general(
    path: str | PathLike[str], header: GeneralHeader, contacts: Iterable[Contact], overwrite: bool = False
) -> int:
    """Write a dataset of version 2; return the number of contacts.

    The file appears under its name when it is complete. Raises DatasetError for the first deviation from the format,
    and if there is no contact; an existing file then stays as it was.
    """
    location = Location(str(path))
    with open_whole_dataset(path, overwrite) as part:
        try:
            with open_new_hdf5(part) as file:
                count = _write_contacts(file, header, contacts, location)
        except OSError as error:
            with convert_writing_errors(location):
                raise error
        if not count:
            location.key("grasps").fail("at least one contact", "none", "check the input")
    return count


def _write_contacts(file: WritableFile, header: GeneralHeader, contacts: Iterable[Contact], location: Location) -> int:
    """Write the header and all contacts; return the number of contacts.

    The header is written with the first contact, whose values give the number of taxels. Raises DatasetError.
    """
    first: Contact | None = None
    count = 0
    for contact in contacts:
        if first is None:
            first = contact
            check_header(header, contact.values.shape[1] if contact.values.ndim > 1 else 0, location)
            with convert_writing_errors(location):
                _write_header(file, header)
        contact_location = location.key("grasps").key(contact.id)
        check_contact(contact, first.values.shape[1], first.values.ndim == 3, contact_location)
        with convert_writing_errors(contact_location):
            _write_contact(file, contact)
            file.check()
        count += 1
    return count


def _write_header(file: Any, header: GeneralHeader) -> None:
    """Write everything of a dataset except the contacts; the attribute `created` is the current time."""
    created = datetime.now(UTC).isoformat(timespec="seconds")
    text = {"source": header.source, "sensor": header.sensor, "generator": header.generator, "created": created}
    file.attrs.update({"format": FORMAT, "version": np.int64(VERSION), **text, **header.properties.to_attributes()})
    taxels = file.create_group("taxels")
    for item in fields(header.places):
        array = getattr(header.places, item.name)
        if array is not None:
            taxels.create_dataset(item.name, data=array)
    if header.sensor_names:
        taxels.attrs["sensor_names"] = list(header.sensor_names)
    for name, mesh in header.objects.items():
        group = file.create_group(f"objects/{name}")
        group.create_dataset("vertices", data=mesh.vertices)
        group.create_dataset("faces", data=mesh.faces)


def _write_contact(file: Any, contact: Contact) -> None:
    """Write a checked contact as a group of the file; large arrays are compressed."""
    group = file.create_group(f"grasps/{contact.id}")
    labels = {"object": contact.object, "approach": contact.approach}
    numbers = {"session": np.int64(contact.session), "iteration": np.int64(contact.iteration)}
    group.attrs.update({**labels, **numbers})
    for name in _CONTACT_ARRAYS:
        array = getattr(contact, name)
        if array is not None:
            options = {"compression": "gzip", "compression_opts": 1} if array.ndim > 1 and array.size > 4096 else {}
            group.create_dataset(name, data=array, **options)
