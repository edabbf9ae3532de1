"""Stream decoder for the original hub: bytes in, messages out, without losing an undamaged message.

Framing rule (SPEC.md, part 7). A *candidate* begins at every byte 0x01 that a known address and the length of this
address follow, and that has 0x0A at its end. After a mismatch the search continues at the next byte. Candidates may
overlap, because start and end values also occur in data. A candidate is accepted if no candidate that overlaps it has

- better evidence: a plausible time (formats with a timestamp), or a header or the end of the stream directly behind
  its end (formats without);
- or equal evidence and a later start: a message whose end was lost continues into the next one, never the reverse.

The result depends only on the bytes of the stream, not on the pieces in which they arrive.
"""

import struct
from collections import deque
from dataclasses import dataclass

from taxel_protocol.original import (
    ACCELERATIONS,
    END,
    FORMATS,
    HEADER_SIZE,
    RECORD_ADDRESS,
    REFERENCE_TIMES,
    START,
    TIME_STEP_MAX_MS,
    OriginalFormat,
    OriginalMessage,
)

_CLOCK_RANGE_MS = 1 << 32


@dataclass(slots=True)
class _Candidate:
    """A complete candidate message in the buffer of the decoder.

    start: first byte. end: byte after the last. has_evidence: the timestamp or the next header confirms the message;
    None: not yet needed.
    """

    start: int
    end: int
    has_evidence: bool | None


class OriginalDecoder:
    """Decoder of one stream of the original hub.

    `messages`: accepted messages. `discarded_bytes`: bytes in no accepted message. `rejected_candidates`: headers
    without an end byte at their length. `ambiguous_candidates`: complete candidates that overlap a better one. Bytes
    that wait for a decision are not counted before it, at the latest by `finish`.
    """

    def __init__(self, message_format: OriginalFormat = FORMATS["original"]) -> None:
        """Create a decoder of a stream of the original hub; message_format: variant of its messages."""
        self.format = message_format
        self.messages = 0
        self.discarded_bytes = 0
        self.rejected_candidates = 0
        self.ambiguous_candidates = 0
        self._lengths = dict(message_format.lengths)
        self._count_code = ">H" if message_format.is_big_endian else "<H"
        self._buffer = bytearray()
        self._base = 0  # stream position of the buffer's first byte
        self._scan = 0  # buffer position of the first byte that is not searched yet
        self._covered = 0  # stream position up to which bytes belong to messages or are discarded
        self._current: _Candidate | None = None  # best candidate that overlaps the byte at _scan
        self._strong_end = 0  # buffer position of the end of the farthest candidate with evidence
        self._times: deque[int] = deque(maxlen=REFERENCE_TIMES)

    @property
    def position(self) -> int:
        """Bytes of the stream processed so far."""
        return self._base + len(self._buffer)

    @property
    def pending_bytes(self) -> int:
        """Bytes that wait for the remainder of a candidate."""
        return self.position - self._covered

    def push(self, data: bytes) -> list[OriginalMessage]:
        """Return the messages of the original hub that the received bytes `data` complete, in order."""
        self._buffer += data
        return self._process(is_end=False)

    def finish(self) -> list[OriginalMessage]:
        """Return the messages in the remaining bytes when the stream ends; incomplete candidates are rejected.

        A live receiver may also call this function after a pause of the hub; the bytes that follow begin a new stream
        with the same counters and reference times.
        """
        return self._process(is_end=True)

    def _process(self, is_end: bool) -> list[OriginalMessage]:
        """Return the messages that can be decided with the bytes in the buffer.

        is_end: the stream has ended, so all messages are decided.
        """
        accepted: list[OriginalMessage] = []
        if self.format.record_size:
            self._split_records(accepted, is_end)
        else:
            while self._step(accepted, is_end):
                pass
        self._remove_settled_bytes()
        return accepted

    def _split_records(self, accepted: list[OriginalMessage], is_end: bool) -> None:
        """Divide the stream into records of `record_size` bytes; nothing in an unframed stream marks a start.

        accepted: list to which the messages are appended. is_end: the stream has ended.
        """
        size = self.format.record_size
        while len(self._buffer) - self._scan >= size:
            self._accept(_Candidate(self._scan, self._scan + size, False), accepted)
            self._scan += size
        if is_end:
            self._scan = len(self._buffer)

    def _step(self, accepted: list[OriginalMessage], is_end: bool) -> bool:
        """Search up to the next possible start of a message, or to the end of the current candidate message.

        accepted: list to which accepted messages are appended. is_end: the stream has ended. Returns False if bytes are
        missing.
        """
        current = self._current
        until = current.end if current else len(self._buffer)
        start = self._buffer.find(START, self._scan, until)
        if start < 0:
            self._scan = until
            if current is None:
                return False
            self._accept(current, accepted)
            self._current = None
            return True
        self._scan = start
        length = self._match_header(start)
        if length is None or (length and start + length > len(self._buffer)):
            if not is_end:
                return False
            self.rejected_candidates += length is not None  # None: not even the header is complete
        elif length:
            if self._buffer[start + length - 1] != END:
                self.rejected_candidates += 1
            elif not self._resolve(_Candidate(start, start + length, None), is_end):
                return False
        self._scan = start + 1
        return True

    def _match_header(self, start: int) -> int | None:
        """Return the length of the message whose header begins at `start` in the buffer.

        A header is the start byte, the length and a known address with this length. Returns 0 if no header begins
        there, None if bytes are missing for the decision.
        """
        buffer = self._buffer
        available = len(buffer) - start
        if available >= HEADER_SIZE:
            length = self._lengths.get(buffer[start + 2], 0)
            return length if buffer[start] == START and length == buffer[start + 1] else 0
        if available < 1 or (buffer[start] == START and (available < 2 or buffer[start + 1] in self._lengths.values())):
            return None
        return 0

    def _resolve(self, candidate: _Candidate, is_end: bool) -> bool:
        """Compare a complete candidate message with those that overlap it, and keep the better one.

        A candidate has evidence if its timestamp is plausible; in a format without timestamps, if the next header or
        the end of the stream follows it directly. A candidate with evidence beats one without; of two equal ones, the
        later is kept. is_end: the stream has ended. Returns False if bytes are missing for the comparison.
        """
        current = self._current
        if self.format.has_timestamp:
            candidate.has_evidence = self._is_plausible(self._get_time(candidate.start))
        elif current or self._strong_end > candidate.start:
            for one in (candidate, current):
                if one and one.has_evidence is None:
                    length = self._match_header(one.end)
                    if length is None and not is_end:
                        return False
                    # None: the stream ends directly behind the candidate or inside the next header.
                    one.has_evidence = length != 0
        if current and current.has_evidence:
            self._strong_end = max(self._strong_end, current.end)
        # `_strong_end` behind the start: an earlier candidate with evidence overlaps this one.
        is_beaten = not candidate.has_evidence and self._strong_end > candidate.start
        if is_beaten:
            self.ambiguous_candidates += 1
        if current and (candidate.has_evidence or not current.has_evidence):
            self.ambiguous_candidates += 1
            self._current = None
        if not is_beaten:
            self._current = candidate
        if candidate.has_evidence:
            self._strong_end = max(self._strong_end, candidate.end)
        return True

    def _get_time(self, start: int) -> int:
        """Return the timestamp of the message that begins at `start` in the buffer, milliseconds."""
        return int.from_bytes(self._buffer[start + HEADER_SIZE : start + HEADER_SIZE + 4], "big")

    def _is_plausible(self, time_ms: int) -> bool:
        """Return whether a time follows a reference time by at most `TIME_STEP_MAX_MS`.

        The reference times are those of the latest messages, and 0, the time at which the hub starts.
        """
        return time_ms <= TIME_STEP_MAX_MS or any(
            (time_ms - reference) % _CLOCK_RANGE_MS <= TIME_STEP_MAX_MS for reference in self._times
        )

    def _accept(self, candidate: _Candidate, accepted: list[OriginalMessage]) -> None:
        """Append the message of an accepted candidate to the list `accepted`; update counters and reference times."""
        start, buffer = candidate.start, self._buffer
        layout = self.format
        address = RECORD_ADDRESS if layout.record_size else buffer[start + 2]
        time_ms = self._get_time(start) if layout.has_timestamp else None
        taxels, offset = layout.taxels[address], start + layout.counts_offset
        order = self._count_code[0]
        counts = struct.unpack_from(f"{order}{taxels}H", buffer, offset)
        accelerations: tuple[int, ...] = ()
        if address in layout.accelerated:
            accelerations = struct.unpack_from(f"{order}{ACCELERATIONS}h", buffer, offset + 2 * taxels)
        is_plausible = time_ms is not None and bool(candidate.has_evidence)
        position = self._base + start
        accepted.append(OriginalMessage(address, time_ms, counts, accelerations, position, is_plausible))
        self.messages += 1
        self.discarded_bytes += position - self._covered
        self._covered = self._base + candidate.end
        if time_ms is not None:
            self._times.append(time_ms)

    def _remove_settled_bytes(self) -> None:
        """Remove the bytes from the buffer that no later step of the search needs.

        These are the bytes before the current candidate message, or before the search position without a candidate.
        Removed bytes that belong to no accepted message are counted as discarded.
        """
        settled = self._current.start if self._current else self._scan
        if self._base + settled > self._covered:
            self.discarded_bytes += self._base + settled - self._covered
            self._covered = self._base + settled
        del self._buffer[:settled]
        self._base += settled
        self._scan -= settled
        self._strong_end = max(self._strong_end - settled, 0)
        if self._current:
            self._current.start -= settled
            self._current.end -= settled
