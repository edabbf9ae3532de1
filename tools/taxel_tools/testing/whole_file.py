"""Files that are there whole or not at all, also after a power cut."""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path
from typing import NoReturn

from taxel.hand.errors import format_path
from taxel_tools.testing.errors import ResultFileError


def write_whole(path: str | os.PathLike[str], data: bytes, overwrite: bool) -> None:
    """Write under another name, wait for the disk, then give the file its name in one step.

    Raises `ResultFileError`: the name is taken and `overwrite` is false, or the system refuses; what stood there stays.
    """
    target = Path(path)
    part = target.with_name(f".{target.name}.{os.getpid()}.part")
    if target.is_dir() or (target.exists() and not overwrite):
        _taken(target)
    try:
        with part.open("wb") as stream:
            stream.write(data)
            stream.flush()
            os.fsync(stream.fileno())
        _put_in_place(part, target, overwrite)
        _wait_for_folder(target.parent)
    except OSError as error:
        reason = error.strerror or type(error).__name__
        raise ResultFileError(format_path(path), "file", "a file that can be written", reason, "mend that") from None
    finally:
        with suppress(OSError):
            part.unlink()


def _put_in_place(part: Path, target: Path, overwrite: bool) -> None:
    if not overwrite:
        try:
            os.link(part, target)  # unlike a rename, this refuses a name that was taken meanwhile
            return
        except FileExistsError:
            _taken(target)
        except OSError:
            pass  # a file system without hard links
    os.replace(part, target)


def _wait_for_folder(folder: Path) -> None:
    """The new name is on the disk only once its folder is; not every file system can be asked."""
    with suppress(OSError):
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)


def _taken(target: Path) -> NoReturn:
    raise ResultFileError(
        format_path(target), "file", "a new file", "an existing one", "choose another name, or ask to overwrite it"
    )
