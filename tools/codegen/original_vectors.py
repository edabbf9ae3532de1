"""Write protocol/vectors/original.json: messages of the original hub, and damaged streams with their decoded messages.

python tools/codegen/original_vectors.py            write it
python tools/codegen/original_vectors.py --check    exit status 1 if the file on disk is stale

The expected result of a stream comes from the definition of the framing rule (tools/original/original_oracle.py).
`undamaged` lists the positions of the messages whose bytes are contiguous in the stream. Times of formats without a
timestamp are 0; accelerations are unsigned numbers modulo 2^16.
"""

import json
import random
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from generated_files import write_or_check

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "original"))

from original_oracle import decode_stream

from taxel_protocol.original import ACCELERATIONS, FORMATS, OriginalFormat, encode_message

VECTORS = Path(__file__).resolve().parents[2] / "protocol" / "vectors"
SEED = 39
ORIGINAL = FORMATS["original"]
UNTIMED = FORMATS["first_generation_untimed"]


def build_message(
    name: str, known: OriginalFormat, address: int, words: Sequence[int], time_ms: int = 0
) -> dict[str, Any]:
    """Build the test vector of one message: its fields, and its bytes on the wire as hexadecimal digits.

    words: raw counts, then accelerations as unsigned numbers modulo 2^16. time_ms: ignored for formats without a
    timestamp.
    """
    taxels = known.taxels[address]
    counts, accelerations = list(words[:taxels]), list(words[taxels:])
    signed = [(value ^ 0x8000) - 0x8000 for value in accelerations]  # two's complement of 16 bits
    time_ms = time_ms if known.has_timestamp else 0
    wire = encode_message(known, address, counts, time_ms, signed)
    fields = {"address": address, "timestamp_ms": time_ms, "counts": counts, "accelerations": accelerations}
    return {"name": name, "format": known.name, **fields, "wire": wire.hex()}


def count_words(known: OriginalFormat, address: int) -> int:
    """Return the number of 16-bit words in a message of the board `address`: its counts and its accelerations."""
    return known.taxels[address] + ACCELERATIONS * (address in known.accelerated)


def build_messages() -> list[dict[str, Any]]:
    """Build one message with arbitrary counts for every board of every format, and messages with extreme counts.

    The shortest and the longest message have the extreme counts; "starts" repeats the start byte 0x01 of a message.
    """
    messages = []
    for known in FORMATS.values():
        draw = random.Random(f"{SEED} {known.name}")
        for address in known.taxels:
            words = [draw.getrandbits(16) for _ in range(count_words(known, address))]
            name = f"{known.name}_0x{address:02x}"
            messages.append(build_message(name, known, address, words, draw.getrandbits(32)))
        for address in {
            min(known.lengths, key=known.lengths.__getitem__),
            max(known.lengths, key=known.lengths.__getitem__),
        }:
            for filling, word, time_ms in (
                ("zeros", 0, 0),
                ("ones", 0xFFFF, 0xFFFFFFFF),
                ("starts", 0x0101, 0x01010101),
            ):
                words = [word] * count_words(known, address)
                name = f"{known.name}_0x{address:02x}_{filling}"
                messages.append(build_message(name, known, address, words, time_ms))
    return messages


def build_stream(name: str, known: OriginalFormat, stream: bytes, undamaged: Iterable[int]) -> dict[str, Any]:
    """Build a test vector of a stream: its bytes, and the messages that the framing rule finds in it.

    undamaged: stream positions of the messages that were sent and are complete in the stream.
    """
    decoded = decode_stream(known, stream)
    return {
        "name": name,
        "format": known.name,
        "stream": stream.hex(),
        "undamaged": list(undamaged),
        "accepted": [message.position for message in decoded.messages],
        "plausible": [int(message.is_time_plausible) for message in decoded.messages],
        "discarded_bytes": decoded.discarded_bytes,
        "rejected_candidates": decoded.rejected_candidates,
        "ambiguous_candidates": decoded.ambiguous_candidates,
    }


def find_undamaged(stream: bytes, sent: Iterable[bytes]) -> list[int]:
    """Return the positions of the sent messages whose bytes are contiguous in the stream, in ascending order."""
    return sorted({stream.find(wire) for wire in sent if wire in stream})


def build_random_streams(known: OriginalFormat) -> list[dict[str, Any]]:
    """Build five streams of six random messages each: undamaged, and with changed, lost, inserted and mixed bytes."""
    draw = random.Random(f"{SEED} {known.name} streams")
    streams = []
    for name in ("intact", "changed", "lost", "inserted", "mixed"):
        time_ms = draw.getrandbits(20)
        sent = []
        for i, address in enumerate(draw.choices(list(known.taxels), k=6)):
            words = [draw.randrange(1500, 2500) for _ in range(count_words(known, address))]
            sent.append(bytes.fromhex(build_message("", known, address, words, time_ms + 12 * i)["wire"]))
        stream = bytearray(b"".join(sent))
        for _ in range(0 if name == "intact" else 6):
            kind = draw.choice(("changed", "lost", "inserted")) if name == "mixed" else name
            at = draw.randrange(len(stream))
            noise = [draw.choice((0x01, 0x0A, draw.randrange(256)))]  # start byte, end byte or any byte
            # An inserted byte replaces an empty slice; a changed or lost byte replaces or removes one byte.
            stream[at : at + (kind != "inserted")] = noise if kind != "lost" else []
        # Records without framing: the boundaries of the messages cannot be found again after a lost byte.
        undamaged = [] if known.record_size else find_undamaged(bytes(stream), sent)
        streams.append(build_stream(f"{known.name}_{name}", known, bytes(stream), undamaged))
    return streams


def _to_wire(known: OriginalFormat, address: int, time_ms: int, counts: Sequence[int] = ()) -> bytes:
    """Return the wire bytes of a message with the given first counts; all further words are 2000."""
    words = list(counts) + [2000] * (count_words(known, address) - len(counts))
    return bytes.fromhex(build_message("", known, address, words, time_ms)["wire"])


def _to_counts(data: bytes) -> list[int]:
    """Return the 16-bit little-endian counts whose bytes in a message are `data`; an odd last byte is dropped."""
    return [data[i] | data[i + 1] << 8 for i in range(0, len(data) - 1, 2)]


def build_edge_streams() -> list[dict[str, Any]]:
    """Build the test vectors of streams at the edge cases of the framing rule, such as a message inside another
    message.
    """
    palm, follower, first = (_to_wire(ORIGINAL, a, t) for a, t in ((0x15, 5012), (0x0A, 5024), (0x1D, 5000)))
    inner_late = _to_wire(ORIGINAL, 0x18, 0xDEADBEEF)
    nested = _to_wire(ORIGINAL, 0x15, 5012, _to_counts(inner_late))
    untimed_inner = _to_wire(UNTIMED, 0x18, 0)
    untimed = _to_wire(UNTIMED, 0x15, 0, [2000, *_to_counts(untimed_inner)])
    untimed_follower = _to_wire(UNTIMED, 0x16, 0)
    cases = [
        ("empty", ORIGINAL, b"", []),
        ("only_a_start", ORIGINAL, b"\x01", []),
        ("header_without_end", ORIGINAL, palm[:-1], []),
        ("header_then_message", ORIGINAL, palm[:3] + first, [first]),
        ("length_of_another_board", ORIGINAL, bytes([0x01, 62, 0x15]) + first, [first]),
        ("length_zero", ORIGINAL, b"\x01\x00\x15" * 9 + first, [first]),
        ("only_starts", ORIGINAL, b"\x01" * 600 + first, [first]),
        (
            "three_bytes_lost_end_in_the_next_address",
            ORIGINAL,
            first + palm[:90] + palm[93:] + follower,
            [first, follower],
        ),
        ("message_in_the_counts_with_another_time", ORIGINAL, first + nested + follower, [first, nested, follower]),
        ("message_in_the_counts_at_the_start", ORIGINAL, nested, []),
        ("message_that_replaces_a_tail", ORIGINAL, palm[:40] + palm, [palm]),
        ("message_inserted_into_a_message", ORIGINAL, palm[:40] + first + palm[40:] + b"\x0a" * 3, [first]),
        (
            "restart_of_the_hub",
            ORIGINAL,
            _to_wire(ORIGINAL, 0x1D, 10**7) + palm[:60] + first + follower,
            [first, follower],
        ),
        ("untimed_message_in_the_counts", UNTIMED, untimed + untimed_follower, [untimed, untimed_follower]),
        ("untimed_message_in_the_counts_at_the_end", UNTIMED, untimed, [untimed]),
        (
            "untimed_end_lost",
            UNTIMED,
            untimed_follower[:30] + untimed_inner + untimed_follower,
            [untimed_inner, untimed_follower],
        ),
    ]
    return [build_stream(name, known, stream, find_undamaged(stream, sent)) for name, known, stream, sent in cases]


def format_text() -> str:
    """Return the whole text of original.json, with one message or stream per line."""
    head = json.dumps({"about": "original hub: messages, and damaged streams", "made_by": Path(__file__).name})
    streams = [stream for known in FORMATS.values() for stream in build_random_streams(known)] + build_edge_streams()
    messages_text = ",\n".join(json.dumps(message) for message in build_messages())
    streams_text = ",\n".join(json.dumps(stream) for stream in streams)
    return f'{head[:-1]}, "messages": [\n{messages_text}\n], "streams": [\n{streams_text}\n]}}\n'


def main() -> int:
    """Write original.json, or with --check compare it with the file on disk.

    The exit status is 1 if the file on disk is stale.
    """
    return write_or_check({VECTORS / "original.json": format_text()})


if __name__ == "__main__":
    sys.exit(main())
