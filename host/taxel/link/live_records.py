"""Records of received bytes in a file that is readable while it is written, common to captures and PCAPNG files."""

import contextlib
import os
from typing import NoReturn

from taxel.link.errors import CaptureError
from taxel.output import LiveOutput, OutputError

EXISTS = "exists already; choose another name, or overwrite the file (--overwrite)"


def open_live_output(path: str | os.PathLike[str], overwrite: bool) -> LiveOutput:
    """Create a recording that is readable while it is written.

    Raises CaptureError if the file exists and `overwrite` is False, if another program writes the file, or if the
    system refuses.
    """
    if os.path.exists(path) and not overwrite:
        raise CaptureError(os.fspath(path), EXISTS)
    try:
        return LiveOutput(path, overwrite=overwrite)
    except OutputError as error:
        problem = f"expected {error.expected}, found {error.found}; {error.remedy}"
        raise CaptureError(os.fspath(path), problem) from None
    except OSError as error:
        raise CaptureError(os.fspath(path), f"cannot be written ({error.strerror})") from error


class LiveRecords:
    """A file that begins with a header and continues with records, each of which is complete or absent.

    Each record is passed to the operating system at once, so a killed process loses no record.
    """

    _has_failed = False

    def __init__(
        self, path: str | os.PathLike[str], header: bytes, overwrite: bool, output: LiveOutput | None, unit: str
    ) -> None:
        """Create a file and write its header.

        output: open output that is written instead of `path`; None: a new file, which replaces an existing one with its
        first record. unit: name of the records in error messages, in the plural, such as "packets". Raises CaptureError
        if the file exists and `overwrite` is False, or if it cannot be written.
        """
        self._path = os.fspath(path)
        self._unit = unit
        self._output = open_live_output(path, overwrite) if output is None else output
        self._file = self._output.file
        try:
            self._write_all(header)
            self._output.begin()
        except OutputError:
            self._output.discard()
            raise CaptureError(self._path, EXISTS) from None
        except OSError as error:
            self._output.discard()
            raise CaptureError(self._path, f"cannot be written ({error.strerror})") from error

    @property
    def size(self) -> int:
        """Size of the file so far, bytes."""
        return self._file.tell()

    @property
    def is_closed(self) -> bool:
        """Whether the file is closed."""
        return self._file.closed

    def append(self, data: bytes) -> None:
        """Write one or several records; after a failure the file is truncated to its complete records.

        Raises `CaptureError`.
        """
        end = self._file.tell()
        try:
            self._write_all(data)
        except OSError as error:
            with contextlib.suppress(OSError):
                os.ftruncate(self._file.fileno(), end)
            self._fail(error)
        try:
            self._output.publish()
        except OSError as error:
            self._fail(error)

    def _write_all(self, data: bytes) -> None:
        """Write all bytes to the file. Raises OSError.

        On a full disk, a write stores only a part of the bytes, and the next write raises OSError.
        """
        written = self._file.write(data) or 0
        while written < len(data):
            written += self._file.write(data[written:]) or 0

    def _fail(self, error: OSError) -> NoReturn:
        """Raise `CaptureError` for a failed write; the file then contains the complete records before it."""
        self._has_failed = True
        problem = f"cannot be written ({error.strerror}); the {self._unit} before are complete"
        raise CaptureError(self._path, problem + self._output.describe_previous()) from error

    def read_at(self, offset: int, size: int) -> bytes:
        """Return `size` bytes of the file from byte `offset` on. Raises `CaptureError`."""
        try:
            return os.pread(self._file.fileno(), size, offset)
        except OSError as error:
            self._fail(error)

    def truncate(self, size: int) -> None:
        """Remove everything behind the first `size` bytes; the argument is an earlier value of the property `size`.

        Raises `CaptureError`.
        """
        try:
            self._file.truncate(size)
        except OSError as error:
            self._fail(error)
        self._file.seek(size)

    def close(self, has_records: bool) -> None:
        """Flush the file to the disk and close it. A second call has no effect.

        has_records: whether the file contains records; a file without records does not replace an existing one. Raises
        `CaptureError`.
        """
        try:
            if self._has_failed:
                self._output.fail()
            elif has_records or self._output.is_published:
                self._output.close()
            else:
                self._output.discard()
        except OSError as error:
            raise CaptureError(self._path, f"cannot be written ({error.strerror})") from error

    def discard(self) -> None:
        """Close the file and remove it."""
        self._output.discard()
