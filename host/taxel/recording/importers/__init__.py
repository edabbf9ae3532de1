"""Importers of data of any tactile sensor: files of other programs become datasets of version 2."""

from taxel.recording.importers.mapping import Mapping, load_mapping
from taxel.recording.importers.propose import propose_mapping
from taxel.recording.importers.run import ImportReport, import_files
from taxel.recording.importers.sources import Field, Source, open_source

__all__ = [
    "Field",
    "ImportReport",
    "Mapping",
    "Source",
    "import_files",
    "load_mapping",
    "open_source",
    "propose_mapping",
]
