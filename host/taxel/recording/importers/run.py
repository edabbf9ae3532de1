"""Import of files: their recordings are divided into contacts and written as a dataset of version 2."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import Any

from taxel.recording.general.format import Contact, GeneralHeader, Properties, TaxelPlaces
from taxel.recording.general.writer import write_general
from taxel.recording.importers.contacts import Recording, make_contacts
from taxel.recording.importers.mapping import Grouping, Mapping
from taxel.recording.importers.selection import read_places, read_recording
from taxel.recording.importers.sources import open_source

GENERATOR = "taxel import"


@dataclass(frozen=True)
class ImportReport:
    """Result of an import: numbers of contacts, frames and taxels, and components of a value (1 or 3)."""

    contacts: int
    frames: int
    taxels: int
    components: int


def make_header(
    source: str, sensor: str = "sensor", properties: Properties | None = None, places: TaxelPlaces | None = None
) -> GeneralHeader:
    """Return the header of an imported dataset. source: "real" or "sim"."""
    return GeneralHeader(source, sensor, GENERATOR, properties or Properties(), places or TaxelPlaces())


def write_recordings(
    out: str | os.PathLike[str],
    header: GeneralHeader,
    recordings: Iterable[Recording],
    grouping: Grouping | None = None,
    overwrite: bool = False,
) -> ImportReport:
    """Write the contacts of recordings to the dataset file `out`; return the numbers of contacts, frames and taxels.

    grouping: division of the frames into contacts; None: one contact for each recording without contact numbers. The
    dataset is written completely or not at all. Raises DatasetError for the first error.
    """
    counter = _Counter()
    write_general(out, header, counter.count(recordings, grouping or Grouping()), overwrite)
    return ImportReport(counter.contacts, counter.frames, counter.taxels, counter.components)


def import_files(
    paths: Sequence[str | os.PathLike[str]], mapping: Mapping, out: str | os.PathLike[str], overwrite: bool = False
) -> ImportReport:
    """Import files by a mapping into the dataset file `out`; the contacts are in the order of the files.

    The places of the taxels are those of the first file. Raises DatasetError for the first error.
    """
    first = open_source(paths[0])
    sources = chain([first], (open_source(path) for path in paths[1:]))
    header = make_header(mapping.source, mapping.sensor, mapping.properties, read_places(first, mapping))
    recordings = (read_recording(source, mapping, mapping.find_labels(Path(source.path))) for source in sources)
    return write_recordings(out, header, recordings, mapping.grouping, overwrite)


class _Counter:
    """Counter of the contacts and frames that pass through `count` to the writer."""

    def __init__(self) -> None:
        self.contacts = self.frames = self.taxels = 0
        self.components = 1

    def count(self, recordings: Iterable[Recording], grouping: Grouping) -> Iterator[Contact]:
        """Yield the contacts of all recordings, and count contacts, frames, taxels and components."""
        for recording in recordings:
            for contact in make_contacts(recording, grouping, self.contacts):
                shape: tuple[Any, ...] = contact.values.shape
                self.contacts += 1
                self.frames += shape[0]
                self.taxels, self.components = shape[1], shape[2] if len(shape) > 2 else 1
                yield contact
