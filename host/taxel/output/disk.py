"""Flush of files and folders to the disk, so that they survive a power failure."""

import errno
import os
from pathlib import Path
from typing import Final

_NO_FLUSH: Final = frozenset({errno.EINVAL, errno.EOPNOTSUPP, errno.EROFS, errno.EBADF})
"""Errors of a file system that cannot flush this kind of file, as the manual page of fsync states."""


def flush_file(path: str | os.PathLike[str]) -> None:
    """Write the content of a file to the disk. Raises OSError."""
    _flush(path, os.O_RDONLY)


def flush_folder(path: str | os.PathLike[str]) -> None:
    """Write the file names in a folder to the disk, so that a new or renamed file survives. Raises OSError.

    A folder that the user may write but not read cannot be flushed; its names reach the disk later.
    """
    try:
        _flush(path, os.O_RDONLY | os.O_DIRECTORY)
    except PermissionError:
        return


def flush_tree(folder: Path) -> None:
    """Write all files below a folder and the names in the folder to the disk. Raises OSError."""
    for parent, _, names in os.walk(folder, topdown=False):
        for name in names:
            flush_file(Path(parent) / name)
        flush_folder(parent)


def _flush(path: str | os.PathLike[str], flags: int) -> None:
    """Open a file or folder with the given flags and write it to the disk. Raises OSError."""
    descriptor = os.open(path, flags | os.O_CLOEXEC)
    try:
        flush_descriptor(descriptor)
    finally:
        os.close(descriptor)


def flush_descriptor(descriptor: int) -> None:
    """Write an open file or folder to the disk. Raises OSError, except where the file system cannot flush."""
    try:
        os.fsync(descriptor)
    except OSError as error:
        if error.errno not in _NO_FLUSH:
            raise
