"""Files and folders that appear under their name when they are complete."""

import io
import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO, Final, TextIO

from taxel.output.pending import PendingOutput

_STREAMS: Final = ("/dev/stdout", "/dev/stderr", "/dev/fd/", "/proc/self/fd/")
"""Names of open streams of the process; a file of this name must not be replaced."""


def write_whole(path: str | os.PathLike[str], data: bytes | str, *, overwrite: bool = True, mode: int = 0o666) -> None:
    """Write a file completely or not at all, also if the program is killed or the power fails.

    data: a string is encoded as UTF-8. mode: permissions of a new file. Missing folders are created. Raises OutputError
    if the file exists and `overwrite` is False, or if another program writes it; OSError if the system refuses. An
    existing file then stays as it was.
    """
    content = data.encode() if isinstance(data, str) else data
    with open_whole(path, overwrite=overwrite, mode=mode) as file:
        file.write(content)


@contextmanager
def open_whole(path: str | os.PathLike[str], *, overwrite: bool = True, mode: int = 0o666) -> Iterator[BinaryIO]:
    """Context manager: a binary file open for writing, which appears as `path` at the end of the block.

    An exception in the block leaves an existing file as it was. A device or a pipe is written directly. Raises as
    `write_whole` does.
    """
    if _is_stream(path):
        with open(path, "ab") as stream:  # truncation would remove earlier output of the process
            yield stream
        return
    with PendingOutput(path, overwrite=overwrite, mode=mode) as pending:
        try:
            with open(pending.part, "wb") as stream:
                yield stream
        except OSError as error:
            if error.filename not in (None, os.fspath(pending.part)):
                raise
            raise OSError(error.errno, error.strerror, os.fspath(path)) from error


@contextmanager
def open_whole_text(path: str | os.PathLike[str], *, overwrite: bool = True) -> Iterator[TextIO]:
    """Context manager: as `open_whole`, a text file in UTF-8 whose line ends stay as they are written."""
    with (
        open_whole(path, overwrite=overwrite) as stream,
        io.TextIOWrapper(stream, encoding="utf-8", newline="") as file,
    ):
        yield file


@contextmanager
def whole_path(path: str | os.PathLike[str], *, overwrite: bool = True) -> Iterator[Path]:
    """Context manager: a path for a library that writes to a path; the file appears as `path` at the end of the block.

    The block receives a temporary path with another ending than `path`. A library that selects its format by the
    ending therefore needs the format as an argument. Raises the errors of `write_whole`.
    """
    with PendingOutput(path, overwrite=overwrite) as pending:
        yield pending.part


@contextmanager
def whole_folder(path: str | os.PathLike[str], *, overwrite: bool = True) -> Iterator[Path]:
    """Context manager: an empty folder for several files, which appears as `path` at the end of the block.

    An existing folder is replaced in one step. Raises as `write_whole` does.
    """
    with PendingOutput(path, overwrite=overwrite, is_folder=True) as pending:
        yield pending.part


def _is_stream(path: str | os.PathLike[str]) -> bool:
    """Whether `path` is an open stream of the process, a device or a pipe."""
    if os.fspath(path).startswith(_STREAMS):
        return True
    try:
        mode = os.stat(path).st_mode
    except OSError:
        return False
    return not stat.S_ISREG(mode) and not stat.S_ISDIR(mode)
