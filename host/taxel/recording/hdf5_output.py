"""HDF5 files that are written through a Python file, so that a full disk cannot crash the program.

The HDF5 library cannot close a file after a failed write: it tries again when the program ends, and crashes. Therefore
the library writes to a `FaultTolerantFile`, which reports success to the library. The first failure is stored, nothing
is written to the disk from then on, and `WritableFile` raises the failure after the library's call. The file on the
disk then has the state of a program that was killed at the failed write.
"""

import atexit
import io
import os
import signal
import threading
import weakref
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from types import FrameType
from typing import Any, Final

from taxel.optional import optional_import
from taxel.output import LiveOutput
from taxel.recording.grasp_checks import Location
from taxel.recording.grasp_hdf5 import convert_opening_errors

with optional_import("h5py", "a grasp dataset (.h5)"):
    import h5py  # type: ignore[import-untyped, unused-ignore]
    from h5py import h5f, h5fd, h5p

_LARGEST_KEPT: Final = 1 << 16
"""Largest write that is kept in memory after a failure, bytes. The library reads back its metadata, whose blocks are
smaller, but not the chunks of arrays (`grasp_storage._CHUNK_BYTES`), which would fill the memory.
"""


class FaultTolerantFile:
    """Python file for the HDF5 library, on an unbuffered file; no method raises.

    Attributes:
        error: the first failure; None: all writes have succeeded.
    """

    def __init__(self, file: io.FileIO) -> None:
        """Wrap an unbuffered file that is open for reading and writing."""
        self._file = file
        self._descriptor = file.fileno()
        self._position = 0
        self._size = os.fstat(self._descriptor).st_size
        self._discarded: list[tuple[int, bytes]] = []
        self.error: BaseException | None = None

    def seek(self, offset: int, whence: int = os.SEEK_SET) -> int:
        """Set the position, bytes from the start, or from the end if `whence` is SEEK_END; return it."""
        self._position = offset + (self._size if whence == os.SEEK_END else 0)
        return self._position

    def tell(self) -> int:
        """Return the position in bytes."""
        return self._position

    def readinto(self, buffer: Any) -> int:
        """Fill `buffer` from the position and advance it; return the length of the buffer.

        Bytes beyond the end of the file are 0. Bytes whose write failed are read from memory.
        """
        view = memoryview(buffer).cast("B")
        try:
            count = os.preadv(self._descriptor, [view], self._position)
        except BaseException as error:
            count = 0
            self._fail(error)
        view[count:] = bytes(len(view) - count)
        for offset, data in self._discarded:
            start, end = max(offset, self._position), min(offset + len(data), self._position + len(view))
            if start < end:
                view[start - self._position : end - self._position] = data[start - offset : end - offset]
        self._position += len(view)
        return len(view)

    def write(self, data: Any) -> int:
        """Write bytes at the position and advance it; return their number, also after a failure.

        A failure is stored in `error` and not raised. After a failure nothing is written to the file; small writes are
        kept in memory, so that the HDF5 library can read them back.
        """
        view = memoryview(data).cast("B")
        offset, self._position = self._position, self._position + len(view)
        self._size = max(self._size, self._position)
        count = 0
        if self.error is None:
            try:
                while count < len(view):
                    count += os.pwrite(self._descriptor, view[count:], offset + count)
            except BaseException as error:
                self._fail(error)
        if self.error is not None and len(view) <= _LARGEST_KEPT:
            self._discarded.append((offset, bytes(view)))
        return len(view)

    def truncate(self, size: int) -> int:
        """Set the size of the file in bytes, and return the size. A failure is stored in `error`."""
        if self.error is None and size != self._size:
            try:
                os.ftruncate(self._descriptor, size)
            except BaseException as error:
                self._fail(error)
        self._size = size
        return size

    def flush(self) -> None:
        """Do nothing: the file has no buffer."""

    def sync(self) -> None:
        """Write the file to the disk. A failure is stored in `error`."""
        if self.error is None:
            try:
                os.fsync(self._descriptor)
            except BaseException as error:
                self._fail(error)

    def extend_to(self, size: int) -> None:
        """Extend a smaller file to a size in bytes."""
        if size > self._size:
            self.truncate(size)

    def _fail(self, error: BaseException) -> None:
        """Store the first failure."""
        self.error = self.error or error


class WritableFile(h5py.File):  # type: ignore[misc]
    """An HDF5 file open for writing; its methods `flush` and `close` raise the failures of the system.

    raw: the file below. A file that is still open when the program ends is closed.
    """

    def __init__(self, identifier: Any, raw: FaultTolerantFile) -> None:
        """Wrap an open HDF5 file. identifier: `h5py.h5f.FileID`."""
        super().__init__(identifier)
        self.raw = raw
        _open_files.add(self)

    def flush(self) -> None:
        """Pass all data to the operating system. Raises OSError."""
        with hold_signals():
            super().flush()
        self.check()

    def close(self) -> None:
        """Close the file. Raises the first failure of a write: OSError."""
        with hold_signals():
            super().close()
        self.check()

    def check(self) -> None:
        """Raise the first failure of a write, if there was one."""
        if self.raw.error is not None:
            raise self.raw.error


_open_files: "weakref.WeakSet[WritableFile]" = weakref.WeakSet()


@atexit.register
def _close_open_files() -> None:
    """Close all files that are still open at the end of the program.

    Otherwise the HDF5 library would close them after the end of Python, and would call methods of Python objects.
    """
    for file in list(_open_files):
        with suppress(Exception):
            file.close()


def create_hdf5(output: LiveOutput) -> WritableFile:
    """Create an HDF5 file without time stamps in an empty output."""
    access, raw = _make_access(output)
    access.set_libver_bounds(h5f.LIBVER_V18, h5f.LIBVER_V18)
    creation = h5p.create(h5p.FILE_CREATE)
    creation.set_obj_track_times(False)
    with hold_signals():
        identifier = h5f.create(os.fsencode(output.path), h5f.ACC_TRUNC, creation, access)
    return WritableFile(identifier, raw)


def extend_hdf5(output: LiveOutput, location: Location, is_read_only: bool = False) -> WritableFile:
    """Open the HDF5 file of an output to change it, or only to read it if `is_read_only`.

    Raises DatasetError for a file that cannot be opened.
    """
    access, raw = _make_access(output)
    # Files of HDF5 1.8 have no "open for writing" mark. With later versions the file of a killed writer needs h5clear.
    access.set_libver_bounds(h5f.LIBVER_V18, h5f.LIBVER_V18)
    with convert_opening_errors(location), hold_signals():
        identifier = h5f.open(os.fsencode(output.path), h5f.ACC_RDONLY if is_read_only else h5f.ACC_RDWR, access)
    return WritableFile(identifier, raw)


def _make_access(output: LiveOutput) -> tuple[Any, FaultTolerantFile]:
    """Return (HDF5 access properties, Python file) with which the HDF5 library reads and writes an output."""
    access = h5p.create(h5p.FILE_ACCESS)
    raw = FaultTolerantFile(output.file)
    access.set_fileobj_driver(h5fd.fileobj_driver, raw)
    return access, raw


@contextmanager
def open_new_hdf5(path: str | os.PathLike[str]) -> Iterator[WritableFile]:
    """Context manager: a new HDF5 file, open for writing.

    path: of an empty temporary file, which the caller renames.
    """
    output = LiveOutput.without_name(path)
    with _closed(output, create_hdf5(output)) as file:
        yield file


@contextmanager
def change_hdf5(path: str | os.PathLike[str]) -> Iterator[WritableFile]:
    """Context manager: an existing temporary HDF5 file, open for changes.

    Raises DatasetError for a file that cannot be opened as HDF5.
    """
    output = LiveOutput.without_name(path)
    with _closed(output, extend_hdf5(output, Location(str(path)))) as file:
        yield file


@contextmanager
def _closed(output: LiveOutput, file: WritableFile) -> Iterator[WritableFile]:
    """Context manager that closes an HDF5 file and then its output."""
    try:
        with file:
            yield file
    finally:
        output.file.close()


@contextmanager
def hold_signals() -> Iterator[None]:
    """Context manager that delays Ctrl-C and SIGTERM to its end.

    The handler of a signal would otherwise run, and raise KeyboardInterrupt, within a write of the HDF5 library.
    """
    if threading.current_thread() is not threading.main_thread():  # handlers run in the main thread only
        yield
        return
    received: list[int] = []

    def store_signal(number: int, frame: FrameType | None) -> None:
        """Handle a signal by storing its number, for the end of the context."""
        received.append(number)

    previous: dict[int, Callable[[int, FrameType | None], Any]] = {}
    for number in (int(signal.SIGINT), int(signal.SIGTERM)):
        handler = signal.getsignal(number)
        if callable(handler):
            previous[number] = handler
            signal.signal(number, store_signal)
    try:
        yield
    finally:
        for number, handler in previous.items():
            signal.signal(number, handler)
        for late in received:
            previous[late](late, None)
