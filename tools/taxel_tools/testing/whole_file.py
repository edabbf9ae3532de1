"""Files that are written completely or not at all, also in a power cut."""

import os
from contextlib import suppress
from pathlib import Path
from typing import NoReturn

from taxel.hand.errors import format_path
from taxel_tools.testing.errors import ResultFileError


def write_whole(path: str | os.PathLike[str], data: bytes, overwrite: bool) -> None:
    """Write a file completely or not at all.

    The bytes are written to a temporary file, which gets the final name in one step when it is on the disk. Raises
    `ResultFileError` if the file exists and `overwrite` is False, or if the system refuses; an existing file stays
    unchanged.
    """
    target = Path(path)
    temporary = target.with_name(f".{target.name}.{os.getpid()}.part")
    if target.is_dir() or (target.exists() and not overwrite):
        _refuse_existing(target)
    try:
        with temporary.open("wb") as stream:
            stream.write(data)
            stream.flush()
            os.fsync(stream.fileno())
        _rename(temporary, target, overwrite)
        _sync_folder(target.parent)
    except OSError as error:
        reason = error.strerror or type(error).__name__
        remedy = "check the folder and its permissions"
        raise ResultFileError(format_path(path), "file", "a writable file", reason, remedy) from None
    finally:
        with suppress(OSError):
            temporary.unlink()


def _rename(temporary: Path, target: Path, overwrite: bool) -> None:
    """Move a complete temporary file to its target. Without `overwrite`, an existing target is an error and stays
    unchanged.
    """
    if not overwrite:
        try:
            os.link(temporary, target)  # Unlike a rename, a link fails if the target was created meanwhile.
            return
        except FileExistsError:
            _refuse_existing(target)
        except OSError:
            pass  # The file system has no hard links.
    os.replace(temporary, target)


def _sync_folder(folder: Path) -> None:
    """Write the entries of a folder to the disk, so that the new name of a file survives a power cut.

    Not every file system supports this.
    """
    with suppress(OSError):
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)


def _refuse_existing(target: Path) -> NoReturn:
    """Raise `ResultFileError` because the target file exists."""
    remedy = "choose another name, or permit overwriting"
    raise ResultFileError(format_path(target), "file", "a new file", "an existing one", remedy)
