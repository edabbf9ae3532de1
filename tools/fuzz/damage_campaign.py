"""Decode damaged streams with the C and Python decoders: they must agree, and only damaged frames may be lost.

python tools/fuzz/damage_campaign.py                          500,000 streams; prints the seed
python tools/fuzz/damage_campaign.py --streams 4000           a short campaign
python tools/fuzz/damage_campaign.py --seed 1 --first 77 --streams 1    replays one stream

A stream consists of a few frames of one hub with one to three damages: bits flipped, bytes inserted, deleted or
repeated, a burst, or a truncated end. A frame is damaged if its stuffed bytes are no longer contiguous. The C deframer,
the batch decoder of the host and the Python reference must deliver all other frames in order, nothing else, and count
the same losses. Every hundredth stream is also parsed by construct. Exit status 1 at the first difference.
"""

import multiprocessing
import sys
import time
from collections import Counter
from itertools import pairwise
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))

from construct_oracle import TO_HOST, Frame, count_losses, parse_stream
from stream_ranges import list_ranges, parse_options, print_difference

from taxel.stream import StreamDecoder
from taxel.stream.decoder import Batch
from taxel.stream.deframer import Deframer
from taxel.stream.native import load_codec_library
from taxel_protocol import FrameType, ReferenceDecoder, crc32, encode_frame
from taxel_protocol.frames import FRAMES
from taxel_protocol.limits import ADDRESS_MIN, WHO_AM_I

CONSTRUCT_EVERY = 100
DAMAGES = ("flip", "byte", "insert", "delete", "repeat", "burst", "cut", "remove")
TYPES = (
    *(kind for kind in FRAMES if kind < 0x80 and kind != FrameType.COMPACT_TAXELS),
    FrameType.TAXELS,
    FrameType.TAXELS,
    FrameType.TAXELS,
)


class Decoders:
    """The C decoders under test; each method decodes a complete stream."""

    def __init__(self) -> None:
        """Load the codec's C library and create the decoders."""
        self._library = load_codec_library()
        self._deframer = Deframer(self._library)
        self._decoder = StreamDecoder()

    def decode_frames(self, pieces: list[bytes]) -> list[Frame]:
        """Decode a byte stream with the C deframer. pieces: consecutive parts of the stream."""
        return self._deframer.decode(pieces)

    def decode_batches(self, pieces: list[bytes]) -> tuple[list[Frame], list[Frame], list[int]]:
        """Decode a byte stream with the host's batch decoder. pieces: consecutive parts of the stream.

        Returns the taxel frames without the board's CRC, the other frames, and the totals of losses.
        """
        self._library.taxel_batch_init(self._decoder._state, TO_HOST)
        batches = [batch for piece in pieces for batch in self._decoder.push(piece)] + self._decoder.finish()
        taxels = [frame for batch in batches for frame in _list_taxel_frames(batch)]
        messages = [frame for batch in batches for frame in _list_other_frames(batch)]
        return taxels, messages, self._decoder.totals.tolist()


def _list_taxel_frames(batch: Batch) -> list[Frame]:
    """Return the taxel frames of a decoded batch as (type, sequence, payload without the board's CRC)."""
    names = ("address", "size", "cycle", "hub_time_us", "board_sequence", "board_time_us", "sequence", "offset")
    frames = []
    for row in batch.taxel_rows[list(names)].tolist() if len(batch.taxel_rows) else []:
        address, size, cycle, hub_us, scan, board_us, sequence, offset = row
        head = bytes([address, size]) + cycle.to_bytes(2, "little") + hub_us.to_bytes(4, "little")
        head += scan.to_bytes(2, "little") + board_us.to_bytes(4, "little")
        frames.append((int(FrameType.TAXELS), sequence, head + batch.counts[offset : offset + size].tobytes()))
    return frames


def _list_other_frames(batch: Batch) -> list[Frame]:
    """Return the frames of a decoded batch that are not taxel frames, as (type, sequence, payload)."""
    rows = batch.message_rows[["type", "sequence", "offset", "size"]].tolist() if len(batch.message_rows) else []
    return [(kind, sequence, batch.payloads[offset : offset + size]) for kind, sequence, offset, size in rows]


def decode_reference(pieces: list[bytes]) -> list[Frame]:
    """Decode a byte stream with the Python reference decoder and return the frames to the host.

    pieces: consecutive parts of the stream.
    """
    decoder = ReferenceDecoder()
    frames = [frame for piece in pieces for frame in decoder.push(piece)] + decoder.finish()
    return [frame for frame in frames if frame[0] < 0x80]


def sample_frames(rng: np.random.Generator) -> list[Frame]:
    """Return two to six random frames of one hub with consecutive sequence numbers."""
    sequence, cycle = (int(n) for n in rng.integers(0, 65536, 2))
    frames: list[Frame] = []
    for kind in rng.choice(TYPES, rng.integers(2, 7)):
        frame_type, spec = int(kind), FRAMES[FrameType(int(kind))]
        # Number of taxels: most frames are short, every twentieth has up to 240 taxels.
        count = int(rng.integers(1, 241 if rng.random() < 0.05 else 24))
        # A TAXELS payload has 14 bytes before the counts and a CRC of 4 bytes after them.
        length = 18 + 2 * count if frame_type == FrameType.TAXELS else int(rng.integers(spec.minimum, spec.maximum + 1))
        payload = bytearray(rng.bytes(length) if rng.random() < 0.7 else bytes([int(rng.integers(256))]) * length)
        if spec.has_address:
            payload[0] = ADDRESS_MIN + int(rng.integers(3))
        if frame_type == FrameType.BOARD_INFO:
            payload[0] = WHO_AM_I  # construct rejects other values
        if frame_type == FrameType.TAXELS:
            cycle = (cycle + int(rng.integers(0, 3))) % 65536
            payload[1], payload[2:4], payload[8:10] = count, cycle.to_bytes(2, "little"), cycle.to_bytes(2, "little")
            if rng.random() < 0.9:
                payload[-4:] = crc32(bytes(payload[8:-4]), crc32(bytes(payload[:1]))).to_bytes(4, "little")
        frames.append((frame_type, sequence, bytes(payload)))
        sequence = (sequence + 1) % 65536
    return frames


def apply_damage(stream: bytes, kind: str, rng: np.random.Generator) -> bytes:
    """Return a byte stream with one damage at a random position. kind: one of `DAMAGES`, such as "flip" or "delete"."""
    at = int(rng.integers(len(stream) + (kind == "insert"))) if stream else 0
    size = int(rng.integers(1, 12 if rng.random() < 0.8 else 200))
    part = stream[at : at + size]
    noise = rng.bytes(max(size, 1))
    return {
        "flip": stream[:at] + bytes(b ^ (1 << noise[0] % 8) for b in stream[at : at + 1]) + stream[at + 1 :],
        "byte": stream[:at] + noise[:1] + stream[at + 1 :],
        "insert": stream[:at] + noise[:1] + stream[at:],
        "delete": stream[:at] + stream[at + 1 :],
        "repeat": stream[:at] + part + stream[at:],
        "burst": stream[:at] + noise[: len(part)] + stream[at + size :],
        "cut": stream[: max(at, len(stream) // 2)],
        "remove": stream[:at] + stream[at + size :],
    }[kind]


def find_intact_frames(frames: list[Frame], bodies: list[bytes], stream: bytes) -> list[Frame]:
    """Return the sent frames whose encoded bytes are complete in the damaged stream, in the order of the stream.

    A frame that occurs twice is returned twice. bodies: encoded bytes of each frame.
    """
    places: list[tuple[int, int]] = []
    for index, body in enumerate(bodies):
        at = stream.find(body)
        while at >= 0:
            places.append((at, index))
            at = stream.find(body, at + 1)
    return [frames[index] for _, index in sorted(places)]


def split_randomly(stream: bytes, rng: np.random.Generator) -> list[bytes]:
    """Split a byte stream into random pieces, as a serial port delivers them.

    A tenth of the streams into single bytes.
    """
    if rng.random() < 0.1:
        return [stream[i : i + 1] for i in range(len(stream))]
    places = sorted({0, len(stream), *(int(n) for n in rng.integers(0, len(stream) + 1, rng.integers(0, 6)))})
    return [stream[a:b] for a, b in pairwise(places)]


def check_stream(seed: int, index: int, decoders: Decoders, tally: Counter[str]) -> str | None:
    """Compare all decoders on the damaged stream number `index`.

    Returns the name of the first decoder that differs from the expected frames, or None. tally: counts of streams,
    frames and damages, updated.
    """
    rng = np.random.default_rng([seed, index])
    frames = sample_frames(rng)
    wires = [encode_frame(*frame) for frame in frames]
    stream = b"".join(wires)
    for kind in rng.choice(DAMAGES, rng.integers(1, 4)):
        stream = apply_damage(stream, str(kind), rng)
        tally[str(kind)] += 1
    pieces = split_randomly(stream, rng)
    expected = find_intact_frames(frames, [wire[1:-1] for wire in wires], stream)
    tally["streams"] += 1
    tally["frames"] += len(frames)
    tally["intact"] += len(expected)
    if decoders.decode_frames(pieces) != expected:
        return "C deframer"
    if decode_reference(pieces) != expected:
        return "Python reference"
    taxels, messages, totals = decoders.decode_batches(pieces)
    is_taxels = [frame[0] == FrameType.TAXELS for frame in expected]
    if taxels != [(k, s, p[:-4]) for (k, s, p), t in zip(expected, is_taxels, strict=True) if t]:
        return "C batch, taxel frames"
    if messages != [frame for frame, t in zip(expected, is_taxels, strict=True) if not t]:
        return "C batch, other frames"
    if totals != count_losses(expected).to_totals():
        return "C batch, losses"
    if index % CONSTRUCT_EVERY == 0:
        tally["by construct"] += 1
        if parse_stream(stream, TO_HOST) != expected:
            return "construct"
    return None


def check_range(seed: int, first: int, count: int) -> tuple[Counter[str], float, str | None]:
    """Compare all decoders on `count` damaged streams, beginning with number `first`, up to the first difference.

    Returns the counts, the processor time of this process in seconds, and a text on the difference or None.
    """
    tally: Counter[str] = Counter()
    decoders = Decoders()
    start_s = time.process_time()
    for index in range(first, first + count):
        difference = check_stream(seed, index, decoders, tally)
        if difference:
            return tally, time.process_time() - start_s, f"stream {index}: {difference} differs"
    return tally, time.process_time() - start_s, None


def main() -> int:
    """Compare the decoders on damaged streams and print the counts; the exit status is 1 after a difference."""
    arguments = parse_options(__doc__, 500_000)
    tally: Counter[str] = Counter()
    seconds = 0.0
    start_s = time.monotonic()
    with multiprocessing.Pool(arguments.jobs) as pool:
        for part, spent_s, difference in pool.imap(_check_part, list_ranges(arguments)):
            tally += part
            seconds += spent_s
            if difference:
                print_difference(difference, arguments.seed)
                return 1
    wall = time.monotonic() - start_s
    lost = tally["frames"] - tally["intact"]
    print(f"{tally['streams']} streams, no difference")
    print(f"{tally['frames']} frames sent, {tally['intact']} delivered ({lost} damaged)")
    print("damages: " + ", ".join(f"{tally[kind]} {kind}" for kind in DAMAGES))
    print(f"{tally['by construct']} of the streams parsed by construct")
    print(f"{seconds:.0f} s of processor time, {wall:.0f} s elapsed")
    return 0


def _check_part(part: tuple[int, int, int]) -> tuple[Counter[str], float, str | None]:
    """Call `check_range` with (seed, number of the first stream, number of streams), in a worker process."""
    return check_range(*part)


if __name__ == "__main__":
    sys.exit(main())
