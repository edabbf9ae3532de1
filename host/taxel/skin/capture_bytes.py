"""A capture whose end can be removed from any byte on that the reader has not confirmed."""

from collections import deque
from typing import NamedTuple

from taxel.link import CaptureWriter


class WrittenRecord(NamedTuple):
    """A record of a capture.

    start: position of its first byte in the stream. offset: position of the record in the file. time_ns: arrival time,
    nanoseconds.
    """

    start: int
    offset: int
    time_ns: int


class CaptureBytes:
    """Writer of received bytes into a capture. Each record is written at once, so that a killed program loses none."""

    def __init__(self, writer: CaptureWriter) -> None:
        """Create a writer on an open capture without records."""
        self._writer = writer
        self._position = 0
        self._unconfirmed: deque[WrittenRecord] = deque()

    @property
    def records(self) -> int:
        """Number of written records."""
        return self._writer.records

    def write(self, data: bytes, time_ns: int) -> None:
        """Append received bytes as one record; time_ns: their arrival, nanoseconds of the link's clock."""
        self._unconfirmed.append(WrittenRecord(self._position, self._writer.size, time_ns))
        self._writer.write(data, time_ns)
        self._position += len(data)

    def tick(self) -> None:
        """Do nothing: each record is written at once."""

    def confirm(self, position: int, splits: bool = False) -> None:
        """Mark the bytes before `position` of the stream as received by the reader, so that `cut` keeps them.

        The bytes are in the capture already. splits: not used.
        """
        while len(self._unconfirmed) > 1 and self._unconfirmed[1].start <= position:
            self._unconfirmed.popleft()

    def cut(self, position: int) -> None:
        """Remove all bytes from `position` of the stream on, which must not be before the last confirmed byte."""
        if position >= self._position:
            return
        while len(self._unconfirmed) > 1 and self._unconfirmed[-1].start >= position:
            self._unconfirmed.pop()
        record = self._unconfirmed.pop()
        length = max(position - record.start, 0)
        data = self._writer.read_data(record.offset, length)
        self._writer.truncate(record.offset)
        if data:
            self._writer.write(data, record.time_ns)
        self._position = position

    def close(self) -> None:
        """Close the capture."""
        self._writer.close()

    def discard(self) -> None:
        """Close the capture and delete its file."""
        self._writer.discard()
