"""Received bytes that are written to a recording when its reader has confirmed them."""

from abc import ABC, abstractmethod
from collections import deque

from taxel.link import Chunk
from taxel.link.pcapng import PcapngWriter


class ConfirmedBytes(ABC):
    """Queue of received bytes that are written when the reader has confirmed them, for files that cannot be cut.

    A subclass writes the bytes to a file.
    """

    def __init__(self) -> None:
        """Create a queue without bytes."""
        self._unconfirmed: deque[Chunk] = deque()
        self._written = 0

    def write(self, data: bytes, time_ns: int) -> None:
        """Add received bytes to the queue; time_ns: their arrival time, nanoseconds of the link's clock."""
        self._unconfirmed.append(Chunk(data, time_ns))

    def confirm(self, position: int, splits: bool = False) -> None:
        """Write the chunks that end within the first `position` bytes of the stream, which the reader has received.

        splits: also write the first part of the chunk that contains `position`.
        """
        while self._unconfirmed and self._written + len(self._unconfirmed[0].data) <= position:
            self._write_chunk(self._unconfirmed.popleft())
        if splits and self._unconfirmed and position > self._written:
            data, time_ns = self._unconfirmed[0]
            size = position - self._written
            self._unconfirmed[0] = Chunk(data[size:], time_ns)
            self._write_chunk(Chunk(data[:size], time_ns))

    def cut(self, position: int) -> None:
        """Write the bytes up to `position` of the stream, and discard all later bytes."""
        self.confirm(position, splits=True)
        self._unconfirmed.clear()

    def _write_chunk(self, chunk: Chunk) -> None:
        """Append a chunk to the recording, and count its bytes."""
        self._append(chunk)
        self._written += len(chunk.data)

    @abstractmethod
    def _append(self, chunk: Chunk) -> None:
        """Append a chunk to the recording."""


class PcapngBytes(ConfirmedBytes):
    """Writer of received bytes into a PCAPNG file, whose packets are frames and therefore cannot be cut anywhere."""

    def __init__(self, writer: PcapngWriter) -> None:
        """Create a writer on an open PCAPNG file without packets."""
        super().__init__()
        self._writer = writer

    def _append(self, chunk: Chunk) -> None:
        """Append a chunk to the PCAPNG file."""
        self._writer.write(chunk.data, chunk.arrival_ns)

    def tick(self) -> None:
        """Do nothing: each packet is written at once."""

    def close(self) -> None:
        """Close the PCAPNG file."""
        self._writer.close()

    def discard(self) -> None:
        """Close the PCAPNG file; remove a file without bytes."""
        self._writer.discard()
