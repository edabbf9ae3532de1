"""The original hub as a link: messages of the original hub in, frames of the project out."""

import threading
import time
from collections import Counter
from typing import Any, Final

import numpy as np

from taxel.hand import Hand
from taxel.link import Chunk, Link, LinkError
from taxel.original_hub.hub_time import HubTime, Tick
from taxel.original_hub.read_sequence import Location, Placed, ReadSequence
from taxel.original_hub.replies import HubReplies, Statistics
from taxel.stream.encoder import encode_on_wire, encode_taxels
from taxel.stream.frame_stream import has_arrivals
from taxel.stream.frames import TaxelFrame
from taxel.stream.original import NativeOriginalDecoder
from taxel_protocol import PROTOCOL_VERSION, FrameType, ReferenceDecoder
from taxel_protocol.original import EARLY_ADDRESSES, TAXELS, OriginalFormat, OriginalMessage

STATUS_PERIOD_US: Final = 1_000_000
"""Period of HUB_STATUS and BOARD_STATUS frames, microseconds, as of a hub of the project."""

HUB_START_MS: Final = 1000
"""If the first message has a smaller timestamp, the stream is assumed to begin with the start of the hub, ms (chosen).
"""

LOOKAHEAD: Final = 2 * len(TAXELS)
"""Largest number of later messages on which the poll cycle of a message depends: two cycles of all boards."""

UNKNOWN_BOARD_MESSAGES: Final = 6
UNKNOWN_BOARD_SHARE: Final = 0.2
"""Smallest number of messages of a board that the hand does not have, and their smallest share of the messages of the
most frequent board, at which the stream is rejected. Damaged addresses produce a share below 0.001."""

_IDLE_S: Final = 0.005
_SEQUENCES: Final = 1 << 16
_FILLER: Final = b"\xff"


class OriginalLink:
    """A link to an original hub that behaves as a hub of the project.

    Each message becomes a TAXELS frame. The frame's `cycle` and its board's `sequence` are the number of the poll
    cycle, so that a board without a message in a cycle is counted as missing. The frame's sequence number skips the
    messages that were damaged on the wire, as far as the discarded bytes show them; discarded bytes are passed on as
    bytes that belong to no frame. All times of a frame are the hub's timestamp, at which the hub built the message; the
    counts were scanned one cycle earlier.

    source: the link with the bytes of the original hub.
    """

    has_flow_control = False

    def __init__(self, source: Link, hand: Hand, message_format: OriginalFormat, baud: float | None = None) -> None:
        """Wrap the link `source`. baud: bits per second on the wire; None: the baud rate of `source`."""
        self.source = source
        self.name = source.name
        self.baud = source.baud if baud is None else baud
        self.is_real_time = source.is_real_time
        self.is_recorded = source.is_recorded
        self.has_arrivals = has_arrivals(source)
        self.header: dict[str, Any] = getattr(source, "header", {})
        self.decoder = NativeOriginalDecoder(message_format)
        self._hand = hand
        self._lengths = message_format.lengths
        self._hand_addresses = {  # by address in a message
            address: found for address in self._lengths if (found := _find_hand_address(address, hand)) is not None
        }
        self._statistics = Statistics()
        self._replies = HubReplies(self.name, hand, self._statistics, self._send)
        self._host_decoder = ReferenceDecoder()
        self._lock = threading.RLock()
        self._output = bytearray()
        self._arrival_ns = 0
        self._first_arrival_ns: int | None = None
        self._end: Exception | None = None
        self._status_us: int | None = None
        self._messages: Counter[int] = Counter()
        self._unknown: Counter[int] = Counter()
        self._reads = ReadSequence(self._lengths)
        self._clock = HubTime(10e3 / self.baud)  # ms per byte: 10 bits on the wire
        self._pending: list[tuple[OriginalMessage, int]] = []  # with the discarded bytes before each
        self._message_end = 0
        self._sequence = 0

    @property
    def read_sequence(self) -> tuple[int, ...]:
        """Addresses of the boards in the order in which the hub reads them; empty before this order is known."""
        with self._lock:
            return self._reads.order

    def read(self, timeout_s: float) -> Chunk | None:
        """Return the frames of the next messages; None if there are none within `timeout_s` seconds.

        Raises the errors of the source, but only after all frames before the error were returned. Raises LinkError if
        the stream regularly contains a board that the hand does not have.
        """
        while True:
            with self._lock:
                if (chunk := self._take_output()) is not None:
                    return chunk
                is_waiting = self._is_held and bool(self._reads.order)
                if self._end is not None and not is_waiting:
                    raise self._end
            if is_waiting:
                time.sleep(min(timeout_s, _IDLE_S))
                return None
            self._read_source(timeout_s)
            if not self.is_recorded:
                with self._lock:
                    return self._take_output()

    @property
    def _is_held(self) -> bool:
        """Whether messages are held back until the host sends the command START.

        This applies to a source whose virtual time waits for its reader: no message may be lost before START.
        """
        return not (self.is_real_time or self.is_recorded or self._replies.is_streaming)

    def _take_output(self) -> Chunk | None:
        """Return and clear the collected output, with the arrival time of the last read bytes; None without output."""
        if not self._output:
            return None
        data = bytes(self._output)
        self._output.clear()
        return Chunk(data, self._arrival_ns)

    def _read_source(self, timeout_s: float) -> None:
        """Read and decode the next bytes of the source; its end or failure is stored and raised by `read` later."""
        try:
            chunk = self.source.read(timeout_s)
        except (EOFError, LinkError) as end:
            with self._lock:
                self._end = end
                self._take_messages(self.decoder.finish())
                self._reads.use_public_order()
                self._flush()
                # Filler bytes belong to no frame; the reader of the link counts them as discarded bytes.
                self._output += _FILLER * (self.decoder.position - self._message_end)
            return
        if chunk is None:
            return
        with self._lock:
            self._arrival_ns = chunk.arrival_ns
            if self._first_arrival_ns is None:
                self._first_arrival_ns = chunk.arrival_ns
            self._take_messages(self.decoder.push(chunk.data))

    def _take_messages(self, messages: list[OriginalMessage]) -> None:
        """Learn the read sequence from decoded messages, and emit their frames as soon as the sequence is known."""
        for message in messages:
            if message.address not in self._hand_addresses:
                self._count_unknown_board(message.address)
                continue  # its bytes are treated as discarded before the next message
            discarded = message.position - self._message_end
            self._message_end = message.position + self._lengths[message.address]
            self._messages[message.address] += 1
            self._reads.learn(message.address, message.position, _as_float(message.timestamp_ms))
            self._pending.append((message, discarded))
        if self._reads.order:
            self._flush()
        self._replies.answer_handshake(bool(self._messages), bool(self._reads.order))

    def _count_unknown_board(self, address: int) -> None:
        """Count a message of a board that the hand does not have. Raises LinkError if there are too many of them."""
        self._unknown[address] += 1
        most = max(self._messages.values(), default=0)
        if self._unknown[address] >= max(UNKNOWN_BOARD_MESSAGES, UNKNOWN_BOARD_SHARE * most):
            raise LinkError(
                self.name,
                f"the hub sends messages of board 0x{address:02X}, which hand '{self._hand.name}' does not have; "
                "name the hand that is connected, such as original_complete for a hand with boards on the thumb",
            )

    def _flush(self) -> None:
        """Emit the frames of all pending messages up to the first one whose poll cycle depends on later messages.

        Nothing is emitted while messages are held back until START.
        """
        if self._is_held:
            return
        placed = [Placed(message.address, message.position) for message, _ in self._pending]
        done = 0
        for index, (message, discarded) in enumerate(self._pending):
            if self._is_first_after_hub_start(message):
                self._reads.assume_hub_start()
            location = self._reads.locate(
                placed[index], placed[index + 1 : index + 1 + LOOKAHEAD], self._end is not None
            )
            if location is None:
                break
            self._translate(message, discarded, location)
            done += 1
        del self._pending[:done]

    def _is_first_after_hub_start(self, message: OriginalMessage) -> bool:
        """Return whether the stream begins with this message and the hub has started shortly before."""
        is_early = message.timestamp_ms is not None and 0 < message.timestamp_ms < HUB_START_MS
        return is_early and not self._statistics.messages

    def _translate(self, message: OriginalMessage, discarded: int, location: Location) -> None:
        """Emit the TAXELS frame of a message, and count the losses before it.

        discarded: number of bytes between the previous message and this one that belong to no message. location: poll
        cycle of the message, and number of lost messages before it. Before the command START, a message that is not
        from a recording is only counted.
        """
        tick = self._compute_tick(message, discarded)
        if tick.is_restart:
            self._announce_restart(tick)
        cycle, lost = location
        if tick.lost_ms and self._clock.cycle_ms and self._reads.order:
            skipped = round(tick.lost_ms / self._clock.cycle_ms)
            lost += self._reads.skip_cycles(skipped)
            cycle += skipped
        statistics = self._statistics
        if cycle != statistics.cycle and self._reads.size:
            self._clock.begin_cycle(cycle, self._reads.size)
            statistics.cycle_us = round(1000.0 * (self._clock.cycle_ms or 0.0))
        address = self._hand_addresses[message.address]
        statistics.add(address, cycle, tick.time_us)
        if not (self._replies.is_streaming or self.is_recorded):
            return
        self._sequence = (self._sequence + lost) % _SEQUENCES
        statistics.frames += lost
        self._output += _FILLER * discarded  # the reader of the link counts them as discarded bytes
        self._send_status_if_due(tick.time_us)
        counts = np.array(message.counts, dtype=np.uint16)
        frame = TaxelFrame(address, cycle % _SEQUENCES, cycle % _SEQUENCES, 0.0, tick.time_us % (1 << 32), 0, counts)
        self._append(encode_taxels(frame, self._sequence, tick.time_us))

    def _compute_tick(self, message: OriginalMessage, discarded: int) -> Tick:
        """Compute the time of a message: the hub's time, if the format has timestamps.

        Otherwise the time is the arrival time since the first bytes, or, for a source without arrival times, the
        position in the stream times the duration of a byte. discarded: number of bytes discarded before the message.
        """
        if message.timestamp_ms is None and self.has_arrivals and self._first_arrival_ns is not None:
            return Tick((self._arrival_ns - self._first_arrival_ns) // 1000)
        return self._clock.take(message.timestamp_ms, message.position, discarded > 0)

    def _announce_restart(self, tick: Tick) -> None:
        """Report a restart of the hub to the host with a HUB_HANDSHAKE frame, and restart the sequence numbers at 0.

        The agreed protocol version remains valid, because the link itself has not restarted.
        """
        self._statistics.time_us = tick.time_us
        self._statistics.frames = 0
        self._status_us = None
        self._sequence = 0
        self._replies.send_handshake(0, PROTOCOL_VERSION)

    def _send_status_if_due(self, time_us: int) -> None:
        """Emit the status frames if `STATUS_PERIOD_US` has passed on the hub's clock since the last ones."""
        if self._status_us is None or not 0 <= time_us - self._status_us < STATUS_PERIOD_US:
            self._status_us = time_us
            self._replies.send_status()

    def _send(self, kind: FrameType, payload: bytes) -> None:
        """Append a frame other than a taxel frame to the output."""
        self._append(encode_on_wire(kind, self._sequence, payload))

    def _append(self, frame: bytes) -> None:
        """Append an encoded frame to the output, and count it."""
        self._output += frame
        self._sequence = (self._sequence + 1) % _SEQUENCES
        self._statistics.frames += 1
        self._statistics.size += len(frame)

    def write(self, data: bytes) -> None:
        """Reply to the frames of the host in `data`; nothing is sent to the original hub, which takes no commands.

        Raises LinkError for a command that needs the project's own firmware.
        """
        if self.is_recorded:
            self.source.write(data)  # raises the error of a recording
            return
        with self._lock:
            boards = [self._hand_addresses[address] for address in self._reads.order]
            if self.is_real_time:
                self._arrival_ns = max(self._arrival_ns, time.monotonic_ns())
            for kind, _, payload in self._host_decoder.push(data):
                self._replies.answer(FrameType(kind), payload, sorted(boards))
            self._replies.answer_handshake(bool(self._messages), bool(boards))
            self._flush()

    def close(self) -> None:
        """Close the source."""
        self.source.close()


def _find_hand_address(address: int, hand: Hand) -> int | None:
    """Return the hand's address of the board that sends with `address`; None if the hand has no such board.

    The two addresses can differ, because seven boards of the first generation had other addresses in early firmware.
    """
    known = {board.address for board in hand.boards}
    later = EARLY_ADDRESSES.get(address, address)
    return address if address in known else later if later in known else None


def _as_float(value: int | None) -> float | None:
    """Convert a timestamp to a float; None stays None."""
    return None if value is None else float(value)
