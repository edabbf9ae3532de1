"""The ring buffer agrees with a simple model: FIFO order, bounded size, every lost byte counted."""

import random
import threading

import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, precondition, rule

from taxel.link import Chunk, PortVanishedError
from taxel.stream import RingBuffer

TIMEOUT_S = 20.0


class RingAgainstModel(RuleBasedStateMachine):
    """Comparison of a ring buffer with a model: a list of (byte, arrival time) pairs, oldest first."""

    @initialize(capacity=st.integers(1, 40), overwrite_oldest=st.booleans())
    def begin(self, capacity, overwrite_oldest):
        """Make an empty ring buffer and an empty model."""
        self.capacity = capacity
        self.overwrite_oldest = overwrite_oldest
        self.ring = RingBuffer(capacity, overwrite_oldest)
        self.model = []
        self.lost = 0
        self.written = 0
        self.read_bytes = 0
        self.arrival = 0
        self.failure = None

    @rule(data=st.binary(max_size=100), same_time=st.booleans())
    def write(self, data, same_time):
        """Write bytes to the ring buffer and to the model; the model loses its oldest bytes above the capacity."""
        if not self.overwrite_oldest:
            data = data[: self.capacity - len(self.model)]  # the writer would wait for a reader
        self.arrival += not same_time
        self.ring.write(Chunk(data, self.arrival))
        self.written += len(data)
        self.model += [(byte, self.arrival) for byte in data]
        excess = max(len(self.model) - self.capacity, 0)
        del self.model[:excess]
        self.lost += excess

    @rule()
    @precondition(lambda self: self.model)
    def read(self):
        """Read all bytes of the ring buffer, and compare them with the model."""
        chunks = self.ring.read(0.0)
        assert [(byte, chunk.arrival_ns) for chunk in chunks for byte in chunk.data] == self.model
        assert all(chunk.data for chunk in chunks)
        self.read_bytes += len(self.model)
        self.model = []

    @rule()
    @precondition(lambda self: not self.model)
    def read_nothing(self):
        """Read an empty ring buffer, which gives [] or raises the failure of the writer."""
        if self.failure is None:
            assert self.ring.read(0.0) == []
        else:
            with pytest.raises(PortVanishedError) as caught:
                self.ring.read(0.0)
            assert caught.value is self.failure

    @rule()
    @precondition(lambda self: self.failure is None)
    def fail(self):
        self.failure = PortVanishedError("port", "is gone")
        self.ring.fail(self.failure)

    @invariant()
    def every_byte_is_accounted_for(self):
        """Check after every step: written bytes = read + lost + contained bytes."""
        assert len(self.ring) == len(self.model) <= self.capacity
        assert self.ring.overrun_bytes == self.lost
        assert self.written == self.read_bytes + self.lost + len(self.ring)


RingAgainstModel.TestCase.settings = settings(max_examples=60, stateful_step_count=30, deadline=None)
TestRingAgainstModel = RingAgainstModel.TestCase


def run_writer(ring, data, sizes, end=None):
    """Start a thread that writes `data` in pieces of the given sizes, which repeat, and then reports `end`.

    The arrival time of a piece is its number. end: None: EOFError. Return the thread.
    """

    def write():
        position = 0
        for number in range(len(data)):
            if position >= len(data):
                break
            size = sizes[number % len(sizes)]
            ring.write(Chunk(data[position : position + size], number))
            position += size
        ring.fail(end or EOFError())

    thread = threading.Thread(target=write, daemon=True)
    thread.start()
    return thread


def read_to_the_end(ring):
    """Read a ring buffer until it raises; return (bytes, arrival time of each chunk, exception)."""
    data, arrivals = bytearray(), []
    while True:
        try:
            chunks = ring.read(TIMEOUT_S)
        except Exception as end:
            return bytes(data), arrivals, end
        assert chunks, "the writer stopped without an end"
        assert sum(len(chunk.data) for chunk in chunks) <= 4096
        for chunk in chunks:
            data += chunk.data
            arrivals.append(chunk.arrival_ns)


@pytest.mark.parametrize("capacity", [1, 7, 64, 4096])
def test_a_waiting_writer_loses_nothing(capacity):
    random_bytes = random.Random(capacity).randbytes(100 * capacity + 50)
    ring = RingBuffer(capacity, overwrite_oldest=False)
    thread = run_writer(ring, random_bytes, [3, 1, 500, 64])
    data, arrivals, end = read_to_the_end(ring)
    thread.join(TIMEOUT_S)
    assert data == random_bytes
    assert arrivals == sorted(arrivals)
    assert isinstance(end, EOFError)
    assert ring.overrun_bytes == 0


def test_every_byte_lost_by_an_overrun_is_counted():
    size = 200_000
    ring = RingBuffer(512)
    thread = run_writer(ring, random.Random(5).randbytes(size), [40, 700, 3])
    data, arrivals, _ = read_to_the_end(ring)
    thread.join(TIMEOUT_S)
    assert len(data) + ring.overrun_bytes == size
    assert arrivals == sorted(arrivals)


def test_an_overrun_keeps_the_newest_bytes():
    ring = RingBuffer(10)
    ring.write(Chunk(b"0123456789abc", 1))
    ring.write(Chunk(b"de", 2))
    chunks = ring.read(0.0)
    assert b"".join(chunk.data for chunk in chunks if chunk.arrival_ns == 1) == b"56789abc"
    assert b"".join(chunk.data for chunk in chunks if chunk.arrival_ns == 2) == b"de"
    assert ring.overrun_bytes == 5


def test_a_failure_wakes_a_waiting_reader():
    ring = RingBuffer(10)
    failure = PortVanishedError("port", "is gone")
    timer = threading.Timer(0.05, ring.fail, [failure])
    timer.start()
    with pytest.raises(PortVanishedError):
        ring.read(TIMEOUT_S)
    timer.join()


def test_a_waiting_writer_returns_when_the_reader_closes():
    ring = RingBuffer(4, overwrite_oldest=False)
    thread = run_writer(ring, bytes(100), [100])
    ring.read(TIMEOUT_S)
    ring.close()
    thread.join(TIMEOUT_S)
    assert not thread.is_alive()


@pytest.mark.parametrize("capacity", [0, -1])
def test_a_capacity_below_one_byte_is_rejected(capacity):
    with pytest.raises(ValueError, match="at least 1 byte"):
        RingBuffer(capacity)


@pytest.mark.parametrize("remaining", [1, 2, 3])
def test_the_remainder_of_a_chunk_after_an_overrun_keeps_its_arrival_time(remaining):
    ring = RingBuffer(4, overwrite_oldest=True)
    ring.write(Chunk(b"abc", 1))
    ring.write(Chunk(b"defg"[: 4 - remaining], 2))
    assert ring.read(0.0) == [Chunk(b"abc"[3 - remaining :], 1), Chunk(b"defg"[: 4 - remaining], 2)]
