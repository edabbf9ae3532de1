"""A link's bytes as frames: decoded, counted, on the host's clock, and with the hub's messages set aside."""

from collections import deque
from collections.abc import Callable

from taxel.link import Chunk, Link, SteppedLink
from taxel.stream.accounting import LossAccount
from taxel.stream.clock import ClockMap
from taxel.stream.decoder import Batch, StreamDecoder
from taxel.stream.frames import HubMessage, TaxelFrame, taxel_frames_of
from taxel.stream.pump import Pump
from taxel.stream.ring import RingBuffer
from taxel.stream.row_clock import RowClock

RECORDED_BYTES_AT_ONCE = 1 << 17
"""A recording is decoded in pieces of this size: large enough for speed, small enough for constant memory."""


def has_arrivals(link: Link) -> bool:
    """Whether the times at which the link's bytes arrive tell when they were sent.

    Not those of an emulator that runs as fast as it is read, nor of a recording of one, which says so.
    """
    if link.is_recorded:
        return bool(getattr(link, "has_arrivals", True))
    return link.is_real_time or isinstance(link, SteppedLink)


class FrameStream:
    """Frames of a link. `poll()` moves what has arrived into `frames`; messages go to `on_message`.

    A link in real time is read by a thread of its own into a ring buffer; a recording, and a link whose time goes on
    only while it is read, are read when they are asked for. `on_answers` gets what boards of compact snapshots wait
    for, payloads of ACKNOWLEDGE frames; without it they get no answer, and come to code less and less well.
    """

    def __init__(
        self,
        link: Link,
        on_message: Callable[[HubMessage], None],
        ring_capacity: int = 1 << 22,
        on_answers: Callable[[bytes], None] | None = None,
    ) -> None:
        self.link = link
        self.frames: deque[TaxelFrame] = deque()
        self._is_stepped = isinstance(link, SteppedLink)
        self.clock = ClockMap(link.baud, has_arrivals(link))
        self.bytes_received = 0
        self._rows = RowClock(self.clock, on_message)
        self._on_answers = on_answers
        self._decoder = StreamDecoder()
        self.losses = LossAccount(self._decoder)
        self._arrival_ends: list[int] = []
        self._arrival_ns: list[int] = []
        self._ring: RingBuffer | None = None
        self._pump: Pump | None = None
        self._end: BaseException | None = None
        self._pending_end: Exception | None = None
        if not (link.is_recorded or self._is_stepped):
            self._ring = RingBuffer(ring_capacity, drop_oldest=link.is_real_time)
            self._pump = Pump(link, self._ring)

    @property
    def bytes_discarded(self) -> int:
        """Bytes that were part of no frame, or that a slow reader let the ring buffer lose."""
        return self._decoder.discarded_bytes + (self._ring.overrun_bytes if self._ring else 0)

    @property
    def bytes_waiting(self) -> int:
        """Bytes that have arrived and that nobody has polled yet; 0 for what is only read when it is asked for."""
        return len(self._ring) if self._ring else 0

    def begin_anew(self) -> None:
        """The hub is about to be asked to stream: what it did before is no measure of what is missing."""
        self._decoder.forget_cycles()

    def poll(self, timeout_s: float = 0.1) -> bool:
        """Take in what has arrived, waiting at most `timeout_s`; True if anything had.

        When the link has ended or failed, what had arrived is delivered first; then EOFError or the `LinkError` is
        raised.
        """
        if self._end is not None:
            raise self._end
        try:
            chunks = self._read(timeout_s)
        except Exception as end:
            self._end = end
            for batch in self._decoder.finish():
                self._take(batch)
            if self.frames:
                return True
            raise
        if not chunks:
            return False
        for batch in self._decoder.push(self._note_arrivals(chunks)):
            self._take(batch)
        while self._on_answers is not None and (answers := self._decoder.answers()):
            self._on_answers(answers)
        return True

    def _read(self, timeout_s: float) -> list[Chunk]:
        if self._ring is not None:
            return self._ring.read(timeout_s)
        if self._is_stepped:
            chunk = self.link.read(timeout_s)
            return [chunk] if chunk is not None else []
        if self._pending_end is not None:
            raise self._pending_end
        chunks: list[Chunk] = []
        size = 0
        while size < RECORDED_BYTES_AT_ONCE:
            try:
                chunk = self.link.read(timeout_s)
            except Exception as end:
                if not chunks:
                    raise
                self._pending_end = end  # first what stands before the end
                break
            if chunk is None:
                break
            chunks.append(chunk)
            size += len(chunk.data)
        return chunks

    def _note_arrivals(self, chunks: list[Chunk]) -> bytes:
        self._arrival_ends.clear()
        self._arrival_ns.clear()
        for chunk in chunks:
            self.bytes_received += len(chunk.data)
            self._arrival_ends.append(self.bytes_received)
            self._arrival_ns.append(chunk.arrival_ns)
        return b"".join(chunk.data for chunk in chunks)

    def _take(self, batch: Batch) -> None:
        for rows, times_s in self._rows.take(batch, self._arrival_ends, self._arrival_ns):
            self.frames.extend(taxel_frames_of(batch, rows, times_s))

    def release(self) -> None:
        """Stop reading; the link stays open for others. What they do not read is lost to this stream."""
        if self._pump is not None:
            self._pump.stop()

    def close(self) -> None:
        """Stop reading and close the link."""
        self.release()
        self.link.close()
