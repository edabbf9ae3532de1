"""A recording that has its final name while it is written.

A recording of a skin can last for hours, and the program can be killed at any time. Therefore the file must not keep a
temporary name until the recording ends. It gets its final name at the start, or with its first record if it replaces
another file, and every complete record is readable from then on. The replaced file has the name `.NAME.previous` until
the new one is closed.
"""

import io
import os
from contextlib import suppress
from pathlib import Path
from typing import Self

from taxel.output.disk import flush_descriptor, flush_folder
from taxel.output.locks import fail_locked, try_lock
from taxel.output.pending import PendingOutput

PREVIOUS_SUFFIX = ".previous"


class LiveOutput:
    """A locked file that is readable while it is written.

    Attributes:
        path: final name of the file.
        file: the open file, unbuffered, for reading and writing.
    """

    _has_failed = False

    def __init__(self, path: str | os.PathLike[str], *, overwrite: bool) -> None:
        """Create a recording under a temporary name; `publish` gives it its final name.

        overwrite: replace an existing recording. Raises OutputError and OSError as `PendingOutput` does.
        """
        self.path = Path(path)
        self._pending: PendingOutput | None = PendingOutput(path, overwrite=overwrite)
        self._target = self._pending.target
        self._is_restorable = False
        self._open(os.dup(self._pending.descriptor))

    @classmethod
    def extend(cls, path: str | os.PathLike[str]) -> Self:
        """Open an existing recording to append to it. Raises OutputError if another program writes it; OSError."""
        output = cls.__new__(cls)
        output.path, output._target = Path(path), Path(os.path.realpath(path))
        output._pending, output._is_restorable = None, False
        output._open(os.open(path, os.O_RDWR | os.O_CLOEXEC))
        output._lock()
        return output

    @classmethod
    def without_name(cls, part: str | os.PathLike[str]) -> Self:
        """Open a file, or create it, as an output that the caller renames and flushes to the disk."""
        output = cls.__new__(cls)
        output.path = output._target = Path(part)
        output._pending, output._is_restorable = None, False
        output._open(os.open(part, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o666))
        return output

    def _open(self, descriptor: int) -> None:
        """Set `file` to an unbuffered file on an open descriptor."""
        self.file = io.FileIO(descriptor, "r+b")

    def _lock(self) -> None:
        """Lock the file exclusively, so that HDF5 readers and other writers refuse it until it is closed.

        Raises OutputError, and closes the file, if another program holds a lock.
        """
        if not try_lock(self.file.fileno()):
            try:
                fail_locked(self.path, self.file.fileno())
            finally:
                self.file.close()

    def begin(self) -> None:
        """Give the file its final name now if there is no file to replace; call this after writing its header."""
        if not self._target.exists():
            self.publish()

    @property
    def is_published(self) -> bool:
        """Whether the file has its final name."""
        return self._pending is None

    def publish(self) -> None:
        """Give the file its final name; an existing file gets the name `.NAME.previous`. A second call has no effect.

        Raises OutputError or OSError; the existing file then stays as it was.
        """
        if self._pending is None:
            return
        try:
            self._rename(self._pending)
            flush_folder(self._target.parent)
        except OSError as error:
            self._has_failed = True
            raise OSError(error.errno, error.strerror, os.fspath(self.path)) from error
        self._lock()

    def _rename(self, pending: PendingOutput) -> None:
        """Flush the file, and give it its final name."""
        flush_descriptor(self.file.fileno())
        if self._target.exists():
            self._preserve()
        try:
            pending.rename()
        except BaseException:
            self._restore()
            raise
        self._pending = None
        pending.discard()  # releases its locks; the file stays locked by its other descriptor

    def _preserve(self) -> None:
        """Give the existing file the name `.NAME.previous`.

        If a file `.NAME.previous` exists already, an earlier recording was interrupted before `close`. Then the file
        that the earlier recording should have replaced stays preserved, and the incomplete recording is not preserved.
        """
        if not self.previous_path.exists():
            try:
                os.link(self._target, self.previous_path)
            except OSError:  # a file system without hard links: the name is missing until the rename
                os.rename(self._target, self.previous_path)
        self._is_restorable = True

    @property
    def previous_path(self) -> Path:
        """Name of the replaced recording until this one is closed."""
        return self._target.with_name(f".{self._target.name}{PREVIOUS_SUFFIX}")

    def describe_previous(self) -> str:
        """Return a part of an error message that names the preserved recording; "" if there is none."""
        return f"; the replaced recording is kept as {self.previous_path}" if self._is_restorable else ""

    def close(self) -> None:
        """Flush the recording to the disk, remove the recording that it replaced, and release the lock.

        After a failure of `publish`, this method does the same as `fail`. Raises OSError.
        """
        if self.file.closed:
            return
        try:
            if not self._has_failed:
                self.publish()
                flush_descriptor(self.file.fileno())
                self.file.close()
                if self._is_restorable:
                    with suppress(OSError):
                        self.previous_path.unlink()
        except OSError as error:
            raise OSError(error.errno, error.strerror, os.fspath(self.path)) from error
        finally:
            self.fail()

    def fail(self) -> None:
        """Close a recording after an error; complete records stay, and so does the replaced recording."""
        with suppress(OSError):  # the error that led here is more important
            self.file.close()
        self._discard_pending()

    def discard(self) -> None:
        """Remove a recording without records; the recording that it replaced gets its name back."""
        is_published = self.is_published
        self.fail()
        if is_published and not self._restore():
            with suppress(OSError):
                self._target.unlink()

    def _restore(self) -> bool:
        """Give a preserved recording its name back; return whether there was one."""
        if not self._is_restorable:
            return False
        self._is_restorable = False
        os.replace(self.previous_path, self._target)
        with suppress(FileNotFoundError):  # a rename between two names of one file does nothing
            self.previous_path.unlink()
        return True

    def _discard_pending(self) -> None:
        """Remove a temporary file that did not get its name."""
        if self._pending is not None:
            self._pending.discard()
            self._pending = None
