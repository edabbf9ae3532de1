"""Ring buffer of fixed size between the thread that reads a port and the decoder."""

import threading
from collections import deque

from taxel.link import Chunk


class RingBuffer:
    """Queue of bytes with a limited size for one writer thread and one reader thread."""

    def __init__(self, capacity: int = 1 << 22, overwrite_oldest: bool = True) -> None:
        """Create an empty queue of at most `capacity` bytes. Raises ValueError for a capacity below 1.

        overwrite_oldest: True: the writer overwrites the oldest bytes of a full queue, which are counted in
        `overrun_bytes`; False: the writer waits for the reader.
        """
        if capacity < 1:
            raise ValueError(f"capacity: expected at least 1 byte, found {capacity}")
        self._buffer = bytearray(capacity)
        self._capacity = capacity
        self._overwrites_oldest = overwrite_oldest
        self._written = 0
        self._read = 0
        self._arrivals: deque[tuple[int, int]] = deque()
        self._condition = threading.Condition()
        self._failure: BaseException | None = None
        self._is_closed = False
        self.overrun_bytes = 0
        self.taken = 0
        """Position after the bytes that the last call of `read` returned, counted from the first written byte."""

    def __len__(self) -> int:
        return self._written - self._read

    def write(self, chunk: Chunk) -> None:
        """Append a chunk of bytes, in parts if it exceeds the capacity; return at once if the reader has closed."""
        data = chunk.data
        with self._condition:
            while data:
                step = data[: self._capacity]
                if self._overwrites_oldest:
                    self._overwrite_oldest(len(step))
                else:
                    while self._capacity == len(self) and not self._is_closed:
                        self._condition.wait()
                    if self._is_closed:
                        return
                    step = step[: self._capacity - len(self)]
                self._store(step)
                self._arrivals.append((self._written, chunk.arrival_ns))
                data = data[len(step) :]
                self._condition.notify_all()

    def _overwrite_oldest(self, size: int) -> None:
        """Discard the oldest bytes so that `size` bytes fit into the buffer, and count them as lost."""
        excess = len(self) + size - self._capacity
        if excess > 0:
            self._read += excess
            self.overrun_bytes += excess
            self._remove_read_arrivals()

    def _store(self, data: bytes) -> None:
        """Copy bytes to the write position of the ring buffer, across its end if needed."""
        start = self._written % self._capacity
        first = min(len(data), self._capacity - start)
        self._buffer[start : start + first] = data[:first]
        self._buffer[: len(data) - first] = data[first:]
        self._written += len(data)

    def _remove_read_arrivals(self) -> None:
        """Remove the arrival times of chunks whose bytes have all been read or overwritten."""
        while self._arrivals and self._arrivals[0][0] <= self._read:
            self._arrivals.popleft()

    def read(self, timeout_s: float | None = None) -> list[Chunk]:
        """Remove and return all chunks, waiting at most `timeout_s` seconds for the first (None: no limit).

        Raises the failure of the writer after all bytes written before it have been read.
        """
        with self._condition:
            self._condition.wait_for(lambda: len(self) > 0 or self._failure is not None, timeout_s)
            if len(self) == 0 and self._failure is not None:
                raise self._failure
            chunks = [Chunk(self._load(end), arrival) for end, arrival in self._arrivals]
            self._arrivals.clear()
            self.taken = self._read
            self._condition.notify_all()
            return chunks

    def _load(self, end: int) -> bytes:
        """Remove and return the bytes of the ring buffer up to `end`, a position in the stream."""
        start, size = self._read % self._capacity, end - self._read
        first = min(size, self._capacity - start)
        self._read = end
        return bytes(self._buffer[start : start + first]) + bytes(self._buffer[: size - first])

    def fail(self, failure: BaseException) -> None:
        """End the writing; after the last byte, `read` raises the exception `failure`."""
        with self._condition:
            self._failure = failure
            self._condition.notify_all()

    def close(self) -> None:
        """End the reading of the ring buffer; a waiting writer returns."""
        with self._condition:
            self._is_closed = True
            self._condition.notify_all()
