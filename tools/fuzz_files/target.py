"""Targets: a reader, valid files for it, the model of these files, and the rules of its data."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from fuzz_files.codec import Codec
from fuzz_files.document import Flat
from taxel.errors import TaxelError

Files = Mapping[str, bytes]
"""Content of the files of one input by name, which may contain a folder."""

NEVER: Final = re.compile(r"(?!)")
"""Pattern that matches no path."""


@dataclass(frozen=True)
class Rules:
    """Rules of the data that a reader returns for a changed file. Paths are those of `Flat`.

    related: (pattern of a changed field of the file, pattern of the data that may then differ); the default permits
    every difference. unused: fields of the file that do not affect the data. derived: fields whose value affects the
    data only after a computation, so the data need not contain the value itself. is_protected: the files have a
    checksum over all data, so the data of a file with other bytes never differ. subset: path of a list of data that
    have a checksum each, so only their number may differ, never an element.
    """

    related: tuple[tuple[re.Pattern[str], re.Pattern[str]], ...] = ()
    unused: re.Pattern[str] = NEVER
    derived: re.Pattern[str] = NEVER
    is_protected: bool = False
    subset: str = ""


COARSE: Final = Rules(unused=re.compile(""))
"""Rules of a file whose model is coarse: bytes of messages, of which the fields are not mutated one by one."""


@dataclass(frozen=True)
class Target:
    """A reader under test.

    name: for the command line. make: writes valid files into a new folder and returns the name of the file or folder
    that is given to `read`. codecs: (pattern of file names, codecs); the first codec is the model for the rules. read:
    returns the data that the reader returns. weight: share of the inputs; cheap readers have a large one. errors: the
    errors by which the reader reports an invalid file. mutable: pattern of the names of the mutated files.
    """

    name: str
    make: Callable[[Path], str]
    codecs: tuple[tuple[str, tuple[Codec, ...]], ...]
    read: Callable[[Path], Flat]
    weight: float = 1.0
    rules: Rules = field(default_factory=Rules)
    errors: tuple[type[BaseException], ...] = (TaxelError, OSError)
    mutable: str = ""

    def find_codecs(self, name: str) -> tuple[Codec, ...]:
        """Return the codecs of a file by its name; () if only its bytes are mutated."""
        return next((codecs for pattern, codecs in self.codecs if re.search(pattern, name)), ())
