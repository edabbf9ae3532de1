"""A ring buffer of fixed size between the thread that reads a port and the code that parses it."""

import threading
from collections import deque

from taxel.link import Chunk


class RingBuffer:
    """First in, first out, at most `capacity` bytes; safe between one writer and one reader thread.

    With `drop_oldest` a writer never waits: the oldest bytes make room, and are counted in `overrun_bytes` (a port
    does not wait either). Without it the writer waits for the reader.
    """

    def __init__(self, capacity: int = 1 << 22, drop_oldest: bool = True) -> None:
        if capacity < 1:
            raise ValueError("a ring buffer needs a capacity of at least 1 byte")
        self._buffer = bytearray(capacity)
        self._capacity = capacity
        self._drop_oldest = drop_oldest
        self._written = 0
        self._read = 0
        self._arrivals: deque[tuple[int, int]] = deque()
        self._condition = threading.Condition()
        self._failure: BaseException | None = None
        self._closed = False
        self.overrun_bytes = 0

    def __len__(self) -> int:
        return self._written - self._read

    def write(self, chunk: Chunk) -> None:
        """Append a chunk; a chunk longer than the capacity goes through in parts. Returns at once if the reader has
        closed.
        """
        data = chunk.data
        with self._condition:
            while data:
                step = data[: self._capacity]
                if self._drop_oldest:
                    self._make_room(len(step))
                else:
                    while self._capacity == len(self) and not self._closed:
                        self._condition.wait()
                    if self._closed:
                        return
                    step = step[: self._capacity - len(self)]
                self._store(step)
                self._arrivals.append((self._written, chunk.arrival_ns))
                data = data[len(step) :]
                self._condition.notify_all()

    def _make_room(self, size: int) -> None:
        excess = len(self) + size - self._capacity
        if excess > 0:
            self._read += excess
            self.overrun_bytes += excess
            self._forget_arrivals()

    def _store(self, data: bytes) -> None:
        start = self._written % self._capacity
        first = min(len(data), self._capacity - start)
        self._buffer[start : start + first] = data[:first]
        self._buffer[: len(data) - first] = data[first:]
        self._written += len(data)

    def _forget_arrivals(self) -> None:
        while self._arrivals and self._arrivals[0][0] <= self._read:
            self._arrivals.popleft()

    def read(self, timeout_s: float | None = None) -> list[Chunk]:
        """Everything that is there, waiting at most `timeout_s` for something.

        Raises what the writer failed with, but only after everything written before was read.
        """
        with self._condition:
            self._condition.wait_for(lambda: len(self) > 0 or self._failure is not None, timeout_s)
            if len(self) == 0 and self._failure is not None:
                raise self._failure
            chunks = [Chunk(self._load(end), arrival) for end, arrival in self._arrivals]
            self._arrivals.clear()
            self._condition.notify_all()
            return chunks

    def _load(self, end: int) -> bytes:
        start, size = self._read % self._capacity, end - self._read
        first = min(size, self._capacity - start)
        self._read = end
        return bytes(self._buffer[start : start + first]) + bytes(self._buffer[: size - first])

    def fail(self, failure: BaseException) -> None:
        """Nothing more will be written, and why."""
        with self._condition:
            self._failure = failure
            self._condition.notify_all()

    def close(self) -> None:
        """The reader is gone: a waiting writer returns."""
        with self._condition:
            self._closed = True
            self._condition.notify_all()
