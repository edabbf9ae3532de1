"""Error of an output that must not be written."""

import os
from typing import NoReturn

from taxel.errors import FieldError


class OutputError(FieldError):
    """Error: a file or folder must not be written, because it exists or because another program writes it.

    A refusal of the operating system, such as a full disk, is an `OSError` that names the file.
    """


def fail_existing(path: str | os.PathLike[str]) -> NoReturn:
    """Raise OutputError because `path` exists and must not be replaced."""
    fail(path, "a new file", "an existing one", "choose another name, or permit overwriting (--overwrite)")


def fail(path: str | os.PathLike[str], expected: str, found: str, remedy: str) -> NoReturn:
    """Raise OutputError for the output `path`. remedy: what the user should do."""
    text = os.fspath(path)
    raise OutputError(text if text.isprintable() and text else repr(text), "file", expected, found, remedy)
