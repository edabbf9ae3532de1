"""Messages of an original hub's stream by the definition of the framing rule: the oracle of all decoders.

Every position of the stream is tried with the construct definition of every board, and every candidate is compared with
all candidates that overlap it. Needs the complete stream, and time that grows with the square of the number of
candidates.
"""

from dataclasses import dataclass, replace

from construct import ConstructError

from taxel_protocol.original import (
    REFERENCE_TIMES,
    TIME_STEP_MAX_MS,
    OriginalFormat,
    OriginalMessage,
    parse_message,
)


@dataclass(frozen=True)
class Decoded:
    """Result of a whole stream: accepted messages in order, and the counters of the decoders."""

    messages: list[OriginalMessage]
    discarded_bytes: int
    rejected_candidates: int
    ambiguous_candidates: int

    @property
    def counters(self) -> tuple[int, int, int, int]:
        """Messages, discarded bytes, rejected candidates, ambiguous candidates."""
        return len(self.messages), self.discarded_bytes, self.rejected_candidates, self.ambiguous_candidates


@dataclass(frozen=True)
class _Candidate:
    """Bytes that may be a message.

    end: position after the last byte. has_evidence: whether its time is plausible, or, in a format without times,
    whether a header follows.
    """

    message: OriginalMessage
    end: int
    has_evidence: bool

    @property
    def start(self) -> int:
        return self.message.position

    @property
    def rank(self) -> tuple[bool, int]:
        """Rank by which the greater of two overlapping candidates wins."""
        return self.has_evidence, self.start


def decode_stream(known: OriginalFormat, stream: bytes) -> Decoded:
    """Return the messages and counters of a complete stream, by the rule of protocol/SPEC.md, part 7.

    A header is a candidate for a message if the end byte is at the distance that its length states. A candidate with a
    timestamp has evidence if its time is at most `TIME_STEP_MAX_MS` after the start of the hub (0) or after one of the
    last `REFERENCE_TIMES` accepted times. A candidate without a timestamp has evidence if a header, or the end of the
    stream, follows directly. Of two overlapping candidates, the one with evidence is accepted, otherwise the later one.
    """
    if known.record_size:
        return _split_records(known, stream)
    headers = [start for start in range(len(stream)) if find_address(known, stream, start) is not None]
    candidates: list[_Candidate] = []
    for start in headers:
        address = find_address(known, stream, start)
        assert address is not None
        try:
            message = parse_message(known, address, stream[start : start + known.lengths[address]])
        except ConstructError:
            continue
        times = [c.message.timestamp_ms for c in _list_accepted(candidates) if c.end <= start][-REFERENCE_TIMES:]
        end = start + known.lengths[address]
        if message.timestamp_ms is None:
            has_evidence = is_followed(known, stream, end)
        else:
            has_evidence = any(
                (message.timestamp_ms - time_ms) % 2**32 <= TIME_STEP_MAX_MS
                for time_ms in (0, *times)
                if time_ms is not None
            )
        message = replace(message, position=start, is_time_plausible=known.has_timestamp and has_evidence)
        candidates.append(_Candidate(message, end, has_evidence))
    messages = [candidate.message for candidate in _list_accepted(candidates)]
    covered = sum(known.lengths[message.address] for message in messages)
    return Decoded(messages, len(stream) - covered, len(headers) - len(candidates), len(candidates) - len(messages))


def _list_accepted(candidates: list[_Candidate]) -> list[_Candidate]:
    """Return the candidates that no overlapping candidate outranks."""
    return [
        one
        for one in candidates
        if all(one.rank >= other.rank for other in candidates if other.start < one.end and one.start < other.end)
    ]


def find_address(known: OriginalFormat, stream: bytes, start: int) -> int | None:
    """Return the board address in the header that begins at `start`; None if no header begins there."""
    for address, length in known.lengths.items():
        if stream[start : start + 3] == bytes([0x01, length, address]):
            return address
    return None


def is_followed(known: OriginalFormat, stream: bytes, end: int) -> bool:
    """Return whether a header follows position `end`; a header that the end of the stream cuts off is sufficient."""
    behind = stream[end : end + 3]
    return any(bytes([0x01, length, address]).startswith(behind) for address, length in known.lengths.items())


def _split_records(known: OriginalFormat, stream: bytes) -> Decoded:
    """Return the messages of a format whose stream consists of records of one size without headers.

    Bytes of an incomplete last record are discarded.
    """
    size = known.record_size
    (address,) = known.taxels
    messages = [
        replace(parse_message(known, address, stream[start : start + size]), position=start)
        for start in range(0, len(stream) - size + 1, size)
    ]
    return Decoded(messages, discarded_bytes=len(stream) % size, rejected_candidates=0, ambiguous_candidates=0)
