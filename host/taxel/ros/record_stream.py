"""Stream of whole records to a file: after a failed write the file ends with the last record before it."""

import contextlib
import io
import os
from typing import Final, NoReturn

LARGEST_BUFFER: Final = 1 << 20
"""Number of buffered bytes above which the buffer is written without a call of `flush`: one chunk of an MCAP file."""


class RecordStream:
    """Buffered binary stream to an unbuffered file, for a library that writes records.

    The library writes only whole records between two calls of `flush`. A failed write removes the records since the
    last successful `flush` from the file; all later calls raise the same error.
    """

    def __init__(self, file: io.FileIO) -> None:
        """Write to an open file from its current position."""
        self._file = file
        self._flushed = file.tell()
        self._written = self._flushed
        self._buffer = bytearray()
        self._error: OSError | None = None

    @property
    def has_failed(self) -> bool:
        """Whether a write has failed."""
        return self._error is not None

    def check(self) -> None:
        """Raise the error of an earlier failed write again."""
        if self._error is not None:
            raise OSError(self._error.errno, self._error.strerror)

    def write(self, data: bytes) -> int:
        """Append bytes; return their number. Raises OSError."""
        self.check()
        self._buffer += data
        if len(self._buffer) > LARGEST_BUFFER:
            self._write_buffer()
        return len(data)

    def tell(self) -> int:
        """Return the position in the stream, bytes from the start of the file."""
        return self._written + len(self._buffer)

    def flush(self) -> None:
        """Pass all buffered bytes to the operating system, at the end of a whole record. Raises OSError.

        After a later failed write, the file is truncated to the present position.
        """
        self.check()
        self._write_buffer()
        self._flushed = self._written

    def _write_buffer(self) -> None:
        """Write the buffer to the file. Raises OSError after the incomplete records were removed from the file."""
        try:
            while self._buffer:
                count = self._file.write(self._buffer) or 0
                del self._buffer[:count]
                self._written += count
        except OSError as error:
            self._fail(error)

    def _fail(self, error: OSError) -> NoReturn:
        """Truncate the file to the last successful `flush`, store the error for later calls, and raise it."""
        self._error = error
        self._buffer.clear()
        with contextlib.suppress(OSError):
            os.ftruncate(self._file.fileno(), self._flushed)
        raise error
