"""Frames of a link: decoding, loss counting and clock mapping; hub messages go to a callback."""

from collections import deque
from collections.abc import Callable

from taxel.link import Chunk, Link, SteppedLink
from taxel.stream.accounting import LossAccount
from taxel.stream.clock import ClockMap
from taxel.stream.decoder import Batch, StreamDecoder
from taxel.stream.frames import HubMessage, TaxelFrame, build_taxel_frames
from taxel.stream.pump import Pump
from taxel.stream.ring import RingBuffer
from taxel.stream.row_clock import RowClock
from taxel.stream.undelivered import UndeliveredBytes

RECORDED_BYTES_AT_ONCE = 1 << 17
"""Smallest number of bytes of a recording that are decoded at a time: large enough for speed, small enough for memory.
"""


def has_arrivals(link: Link) -> bool:
    """Whether the arrival times of the link's bytes are real: they follow the departure times from the hub.

    False for an emulator that runs as fast as it is read, and for a recording of such an emulator.
    """
    if link.is_recorded:
        return bool(getattr(link, "has_arrivals", True))
    return link.is_real_time or isinstance(link, SteppedLink)


class FrameStream:
    """Taxel frames of a link. `poll()` appends the received frames to `frames`; hub messages go to a callback.

    A separate thread reads a real-time link into a ring buffer. A recording, and a link whose time advances only while
    it is read, are read in `poll()`.
    """

    def __init__(
        self,
        link: Link,
        on_message: Callable[[HubMessage], None],
        ring_capacity: int = 1 << 22,
        on_acknowledgements: Callable[[bytes], None] | None = None,
    ) -> None:
        """Create the stream of the taxel frames of `link`, and start its reader thread for a link in real time.

        on_message: called with each hub message. ring_capacity: size of the buffer between the reader thread and the
        decoder, bytes. on_acknowledgements: called with the payload of each ACKNOWLEDGE frame to send; None: boards
        receive no acknowledgements, so their delta frames grow.
        """
        self.link = link
        self.frames: deque[TaxelFrame] = deque()
        self._is_stepped = isinstance(link, SteppedLink)
        self.clock = ClockMap(link.baud, has_arrivals(link))
        self.bytes_received = 0
        self._rows = RowClock(self.clock, on_message)
        self._on_acknowledgements = on_acknowledgements
        self._decoder = StreamDecoder()
        self.losses = LossAccount(self._decoder)
        self._arrival_ends: list[int] = []
        self._arrival_ns: list[int] = []
        self._ring: RingBuffer | None = None
        self._pump: Pump | None = None
        self._end: BaseException | None = None
        self._pending_end: Exception | None = None
        self._undelivered: UndeliveredBytes | None = None
        if not (link.is_recorded or self._is_stepped):
            self._ring = RingBuffer(ring_capacity, overwrite_oldest=link.is_real_time)
            self._pump = Pump(link, self._ring)

    @property
    def bytes_discarded(self) -> int:
        """Number of bytes that were part of no frame, or that the ring buffer lost because the reader was too slow."""
        return self._decoder.discarded_bytes + (self._ring.overrun_bytes if self._ring else 0)

    @property
    def bytes_waiting(self) -> int:
        """Number of received bytes that `poll()` has not taken yet; 0 for a link that is read in `poll()`."""
        return len(self._ring) if self._ring else 0

    def prepare_stream_start(self) -> None:
        """Reset the cycle tracking; call before START so that earlier cycles do not count as missing frames."""
        self._decoder.forget_cycles()

    def poll(self, timeout_s: float = 0.1) -> bool:
        """Decode the received bytes, waiting at most `timeout_s` seconds; return whether any had arrived.

        After the end or a failure of the link, all received frames are delivered before EOFError or the `LinkError`
        is raised.
        """
        if self._end is not None:
            raise self._end
        try:
            chunks = self._read(timeout_s)
        except Exception as end:
            self._end = end
            for batch in self._decoder.finish():
                self._append_frames(batch)
            if self.frames:
                return True
            raise
        if not chunks:
            return False
        data = self._store_arrivals(chunks)
        if self._undelivered is not None:
            self._undelivered.add(self._decoder, data, self.bytes_received - len(data), bool(self.frames))
        for batch in self._decoder.push(data):
            self._append_frames(batch)
        while self._on_acknowledgements is not None and (payload := self._decoder.take_acknowledgements()):
            self._on_acknowledgements(payload)
        return True

    def _read(self, timeout_s: float) -> list[Chunk]:
        """Return the chunks of bytes received within `timeout_s` seconds.

        Of a recording at least `RECORDED_BYTES_AT_ONCE` bytes are returned. Raises the end of the link, EOFError or
        `LinkError`, after all chunks before it are returned.
        """
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
                self._pending_end = end  # raised after the chunks before it are decoded
                break
            if chunk is None:
                break
            chunks.append(chunk)
            size += len(chunk.data)
        return chunks

    def _store_arrivals(self, chunks: list[Chunk]) -> bytes:
        """Store the end of each received chunk in the stream with its arrival time; return the joined bytes."""
        self._arrival_ends.clear()
        self._arrival_ns.clear()
        for chunk in chunks:
            self.bytes_received += len(chunk.data)
            self._arrival_ends.append(self.bytes_received)
            self._arrival_ns.append(chunk.arrival_ns)
        return b"".join(chunk.data for chunk in chunks)

    def _append_frames(self, batch: Batch) -> None:
        """Append the taxel frames of a decoded batch to `frames`, with their times on the host's clock."""
        if self._undelivered is not None:
            self._undelivered.note_batch(batch)
        for rows, times_s in self._rows.take(batch, self._arrival_ends, self._arrival_ns):
            if self._undelivered is not None:
                self._undelivered.note_frames(rows)
            self.frames.extend(build_taxel_frames(batch, rows, times_s))

    def keep_undelivered(self) -> None:
        """Keep the undelivered bytes and the decoder's state, which `cut` needs; call before the first `poll`.

        Each `poll` then copies 0.3 MB.
        """
        self._undelivered = UndeliveredBytes()

    @property
    def link_position(self) -> int:
        """Number of bytes of the link up to the last decoded byte, including those that the ring buffer has lost."""
        return self._ring.taken if self._ring is not None else self.bytes_received

    @property
    def delivered_position(self) -> int:
        """Number of bytes of the link up to the last frame that was taken from `frames`; needs `keep_undelivered`."""
        assert self._undelivered is not None
        return self.link_position - (self.bytes_received - self._undelivered.find_end(len(self.frames)))

    def cut(self) -> int:
        """End the stream after the last frame that was taken from `frames`; return the number of link bytes up to it.

        The counters are set to their values at this frame. If the link has ended and all frames were taken, nothing is
        removed. Requires calls of `keep_undelivered` before the first `poll` and of `release` before this method; the
        stream cannot be read afterwards.
        """
        assert self._undelivered is not None
        is_complete = self._end is not None and not self.frames
        end = self.bytes_received if is_complete else self._undelivered.find_end(len(self.frames))
        link_end = self.link_position if is_complete else self.delivered_position
        if not is_complete:
            self._undelivered.rewind(self._decoder, end)
            self.bytes_received = end
            self.frames.clear()
        self._end = self._end or EOFError()
        return link_end

    def release(self) -> None:
        """Stop reading the link and leave it open, so that another reader can use it."""
        if self._pump is not None:
            self._pump.stop()

    def close(self) -> None:
        """Stop reading the link and close it."""
        self.release()
        self.link.close()
