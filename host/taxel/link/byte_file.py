"""A file of bytes without times, such as the output of `cat /dev/ttyUSB0`, as a link."""

import os

from taxel.input_files import open_regular_file
from taxel.link.base import Chunk
from taxel.link.capture import MAGIC, CaptureLink
from taxel.link.errors import CaptureError, LinkError

READ_SIZE = 512
"""Largest number of bytes of one read: 44 ms at 115,200 baud, so that a playback at the recorded speed is smooth."""


class ByteFileLink:
    """A file whose bytes are the stream of a hub; each `read` returns the next bytes without waiting.

    Raises `LinkError` if the file cannot be read.
    """

    is_real_time = False
    is_recorded = True
    has_flow_control = False
    has_arrivals = False

    def __init__(self, path: str | os.PathLike[str], baud: float) -> None:
        """Open a file of bytes; baud: bits per second of the recorded wire."""
        self.name = str(path)
        self.baud = baud
        self.header: dict[str, object] = {}
        self._position = 0
        try:
            self._file = open_regular_file(path)
        except OSError as error:
            raise LinkError(self.name, f"cannot be read ({error.strerror})") from error

    def read(self, timeout_s: float = 0.0) -> Chunk:
        """Return the next bytes of the file.

        Their arrival time is computed as if all bytes of the file were sent without a pause. `timeout_s` has no effect.
        Raises EOFError at the end of the file.
        """
        try:
            data = self._file.read(READ_SIZE)
        except OSError as error:
            raise LinkError(self.name, f"cannot be read ({error.strerror})") from error
        if not data:
            raise EOFError
        self._position += len(data)
        return Chunk(data, round(self._position * 10e9 / self.baud))  # ns; a byte takes 10 bits on the wire

    def write(self, data: bytes) -> None:
        """Raise `CaptureError`: a file accepts no commands."""
        raise CaptureError(self.name, "is a recording; it takes no commands")

    def close(self) -> None:
        """Close the file."""
        self._file.close()


def open_byte_file(path: str | os.PathLike[str], baud: float) -> CaptureLink | ByteFileLink:
    """Open a file of bytes, or a capture file, which also contains their arrival times. Raises `LinkError`."""
    try:
        with open_regular_file(path) as file:
            is_capture = file.read(len(MAGIC)) == MAGIC
    except OSError as error:
        raise LinkError(str(path), f"cannot be read ({error.strerror})") from error
    return CaptureLink(path) if is_capture else ByteFileLink(path, baud)
