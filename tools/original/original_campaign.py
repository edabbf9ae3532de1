"""Decode damaged and imitated streams of the original hub with the C decoder, the Python decoder and the oracle.

python tools/original/original_campaign.py                              1,000,000 streams; prints the seed
python tools/original/original_campaign.py --streams 4000               a short campaign
python tools/original/original_campaign.py --seed 1 --first 77 --streams 1    replays one stream

A stream is a sequence of whole, damaged, truncated, nested and repeated messages and of bytes that are frequent in
headers, in one of the hub's formats or in a format with short messages, in which candidates overlap often. C and Python
get the stream in different random pieces; messages and counters must be equal. Every hundredth stream is also decoded
by the construct definition (original_oracle.py). Exit status 1 at the first difference.
"""

import multiprocessing
import random
import sys
import time
from collections import Counter
from itertools import pairwise
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
sys.path.insert(0, str(Path(__file__).parents[1] / "fuzz"))

from original_oracle import decode_stream
from stream_ranges import list_ranges, parse_options, print_difference

from taxel.stream.original import NativeOriginalDecoder
from taxel_protocol.original import FORMATS, OriginalFormat, OriginalMessage, encode_message
from taxel_protocol.original_stream import OriginalDecoder

ORACLE_EVERY = 100
DENSE = {0x01: 3, 0x0A: 1, 0x0B: 2, 0x10: 4, 0x12: 5, 0x1D: 6}
"""Taxels of the short messages: lengths and addresses equal start values, end values and each other."""

ALL_FORMATS: tuple[OriginalFormat, ...] = (
    *FORMATS.values(),
    OriginalFormat("dense", DENSE),
    OriginalFormat("dense_untimed", DENSE, has_timestamp=False),
    OriginalFormat("dense_accelerations", DENSE, is_big_endian=True, accelerated=(0x0B, 0x01)),
)
WEIGHTS = (2, 1, 2, 1, 2, 1, 8, 8, 3)
"""Shares of the formats: streams with short messages reach more overlaps per byte."""

Counters = tuple[int, ...]


def sample_stream(known: OriginalFormat, draw: random.Random) -> bytes:
    """Return a random byte stream of one to ten parts.

    A part is a valid, damaged or truncated message, a message inserted into the preceding bytes, a sequence of random
    bytes, or a repetition of the last bytes. known: format of the messages.
    """
    addresses = list(known.taxels)
    frequent = bytes([0x01, 0x0A, 0x00, *known.lengths.values(), *addresses])
    time_ms = draw.choice((0, 70_000, 2**32 - 100, draw.getrandbits(32)))
    stream = bytearray()
    for _ in range(draw.randint(1, 10)):
        time_ms = (time_ms + draw.choice((0, 7, 12, 60_000, 60_001, 2**31))) % 2**32
        message = sample_message(known, draw, draw.choice(addresses), time_ms, frequent)
        kind = draw.randrange(8)
        if kind < 3:
            stream += message
        elif kind == 3:  # changed, lost or added bytes
            for _ in range(draw.randint(1, 3)):
                at = draw.randrange(len(message) + 1)
                message[at : at + draw.randrange(3)] = draw.choices(frequent, k=draw.randrange(3))
            stream += message
        elif kind == 4:  # a message that lost its end
            stream += message[: draw.randrange(len(message) + 1)]
        elif kind == 5:  # a message inside the last bytes
            at = draw.randrange(max(len(stream) - 260, 0), len(stream) + 1)
            stream[at:at] = message
        elif kind == 6:
            stream += bytes(draw.choices(frequent, k=draw.randrange(40)))
        else:  # repeated bytes, as after a retransmission
            stream += stream[-draw.randint(1, 300) :]
    return bytes(stream)


def sample_message(
    known: OriginalFormat, draw: random.Random, address: int, time_ms: int, frequent: bytes
) -> bytearray:
    """Return one random valid message of a format.

    In half of the messages, the data bytes are random. In the other half, they are sampled from `frequent`, the bytes
    that occur in headers, so the counts resemble the start of another message.
    """
    length = known.lengths[address]
    offset = known.counts_offset
    data = bytes(draw.choices(frequent, k=length)) if draw.random() < 0.5 else draw.randbytes(length)
    if known.record_size:
        return bytearray(data)
    header = bytes([0x01, length, address]) + (time_ms.to_bytes(4, "big") if known.has_timestamp else b"")
    return bytearray(header + data[offset:-1] + b"\x0a")


def split_randomly(stream: bytes, draw: random.Random) -> list[bytes]:
    """Split a stream into random pieces, some of them empty; with a probability of 10 %, into single bytes."""
    if draw.random() < 0.1:
        return [stream[i : i + 1] for i in range(len(stream))]
    places = sorted([0, len(stream), *(draw.randint(0, len(stream)) for _ in range(draw.randrange(6)))])
    return [stream[a:b] for a, b in pairwise(places)]


def decode_pieces(
    decoder: OriginalDecoder | NativeOriginalDecoder, pieces: list[bytes]
) -> tuple[list[OriginalMessage], Counters]:
    """Decode a stream that arrives in pieces.

    Returns the messages and four counters: messages, discarded bytes, rejected candidates, ambiguous candidates.
    """
    messages = [message for piece in pieces for message in decoder.push(piece)] + decoder.finish()
    return messages, (
        decoder.messages,
        decoder.discarded_bytes,
        decoder.rejected_candidates,
        decoder.ambiguous_candidates,
    )


def check_stream(seed: int, index: int, tally: Counter[str]) -> str | None:
    """Sample stream `index` and compare the results of all decoders; return the deviating comparison, or None.

    The Python decoder is compared with the C decoder, and in every `ORACLE_EVERY`-th stream with the parser by
    construct and with the encoder. If all agree, the counters of the stream are added to `tally`.
    """
    draw = random.Random(f"{seed} {index}")
    (known,) = draw.choices(ALL_FORMATS, WEIGHTS)
    stream = sample_stream(known, draw)
    messages, counters = decode_pieces(OriginalDecoder(known), split_randomly(stream, draw))
    native = NativeOriginalDecoder(known, capacity=draw.choice((512, 513, 4096)))
    if decode_pieces(native, split_randomly(stream, draw)) != (messages, counters):
        return f"C decoder, format {known.name}"
    if index % ORACLE_EVERY == 0:
        tally["by construct"] += 1
        expected = decode_stream(known, stream)
        if (expected.messages, expected.counters) != (messages, counters):
            return f"construct, format {known.name}"
        for message in messages:
            time_ms = message.timestamp_ms or 0
            wire = encode_message(known, message.address, message.counts, time_ms, message.accelerations)
            if stream[message.position : message.position + len(wire)] != wire:
                return f"bytes of a message, format {known.name}"
    names = ("messages", "discarded bytes", "rejected candidates", "ambiguous candidates")
    tally.update(dict(zip(names, counters, strict=True)) | {"streams": 1, "bytes": len(stream)})
    return None


def check_range(seed: int, first: int, count: int) -> tuple[Counter[str], str | None]:
    """Check the streams `first` to `first + count - 1`, up to the first difference.

    Returns the counters of the checked streams, and the description of the first difference, or None if there is none.
    """
    tally: Counter[str] = Counter()
    for index in range(first, first + count):
        difference = check_stream(seed, index, tally)
        if difference:
            return tally, f"stream {index}: {difference} differs"
    return tally, None


def _check_part(part: tuple[int, int, int]) -> tuple[Counter[str], str | None]:
    """Call `check_range` with the arguments (seed, first, count) as one tuple, as a process pool passes them."""
    return check_range(*part)


def main() -> int:
    """Run the campaign and print the counts; return the exit status: 1 after the first difference, otherwise 0."""
    arguments = parse_options(__doc__, 1_000_000)
    tally: Counter[str] = Counter()
    start_s = time.monotonic()
    with multiprocessing.Pool(arguments.jobs) as pool:
        for part, difference in pool.imap(_check_part, list_ranges(arguments)):
            tally += part
            if difference:
                print_difference(difference, arguments.seed)
                return 1
    print(f"{tally['streams']} streams, {tally['bytes']} bytes, no difference")
    print(f"{tally['messages']} messages, {tally['discarded bytes']} bytes discarded")
    print(f"{tally['rejected candidates']} candidates rejected, {tally['ambiguous candidates']} ambiguous")
    print(f"{tally['by construct']} of the streams decoded by construct")
    print(f"{time.monotonic() - start_s:.0f} s elapsed")
    return 0


if __name__ == "__main__":
    sys.exit(main())
