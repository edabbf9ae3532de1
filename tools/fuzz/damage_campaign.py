"""Damaged streams by the hundred thousand: C and Python must agree, and lose the frames that were hit, no more.

python tools/fuzz/damage_campaign.py                          500,000 streams, seed printed
python tools/fuzz/damage_campaign.py --streams 4000           a short form
python tools/fuzz/damage_campaign.py --seed 1 --first 77 --streams 1    replays one stream

A stream is a few frames of one hub with one to three damages: bits flipped, bytes inserted, deleted, repeated, a burst,
an end cut off. A frame is hit if its stuffed bytes no longer stand together; all others must come out of the C deframer
(the batch decoder of the host, the Python reference), in order, and nothing else, with the same losses counted. Every
hundredth stream is also parsed by construct. Exit status 1 on the first disagreement.
"""

import argparse
import multiprocessing
import sys
import time
from collections import Counter
from itertools import pairwise
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))

from construct_oracle import TO_HOST, Frame, losses_of, parse_stream

from taxel.stream import StreamDecoder
from taxel.stream.decoder import Batch
from taxel.stream.deframer import Deframer
from taxel.stream.native import codec_library
from taxel_protocol import FrameType, ReferenceDecoder, crc32, encode_frame
from taxel_protocol.frames import FRAMES
from taxel_protocol.limits import ADDRESS_MIN, WHO_AM_I

CONSTRUCT_EVERY = 100
BLOCK = 2_000
DAMAGES = ("flip", "byte", "insert", "delete", "repeat", "burst", "cut", "remove")
TYPES = (
    *(kind for kind in FRAMES if kind < 0x80 and kind != FrameType.COMPACT_TAXELS),
    FrameType.TAXELS,
    FrameType.TAXELS,
    FrameType.TAXELS,
)


class Decoders:
    """The decoders under test, each from the beginning of a stream to its end."""

    def __init__(self) -> None:
        self._library = codec_library()
        self._deframer = Deframer(self._library)
        self._decoder = StreamDecoder()

    def streaming(self, pieces: list[bytes]) -> list[Frame]:
        """The C deframer, frame by frame."""
        return self._deframer.decode(pieces)

    def batch(self, pieces: list[bytes]) -> tuple[list[Frame], list[Frame], list[int]]:
        """The host's decoder: taxel frames without their board's CRC, other frames, and what it counted."""
        self._library.taxel_batch_init(self._decoder._state, TO_HOST)
        batches = [batch for piece in pieces for batch in self._decoder.push(piece)] + self._decoder.finish()
        taxels = [frame for batch in batches for frame in _taxel_frames(batch)]
        others = [frame for batch in batches for frame in _other_frames(batch)]
        return taxels, others, self._decoder.totals.tolist()


def _taxel_frames(batch: Batch) -> list[Frame]:
    names = ("address", "size", "cycle", "hub_time_us", "board_sequence", "board_time_us", "sequence", "offset")
    frames = []
    for row in batch.taxel_rows[list(names)].tolist() if len(batch.taxel_rows) else []:
        address, size, cycle, hub_us, scan, board_us, sequence, offset = row
        head = bytes([address, size]) + cycle.to_bytes(2, "little") + hub_us.to_bytes(4, "little")
        head += scan.to_bytes(2, "little") + board_us.to_bytes(4, "little")
        frames.append((int(FrameType.TAXELS), sequence, head + batch.counts[offset : offset + size].tobytes()))
    return frames


def _other_frames(batch: Batch) -> list[Frame]:
    rows = batch.message_rows[["type", "sequence", "offset", "size"]].tolist() if len(batch.message_rows) else []
    return [(kind, sequence, batch.payloads[offset : offset + size]) for kind, sequence, offset, size in rows]


def reference(pieces: list[bytes]) -> list[Frame]:
    """The readable decoder of the protocol package, in Python."""
    decoder = ReferenceDecoder()
    found = [frame for piece in pieces for frame in decoder.push(piece)] + decoder.finish()
    return [frame for frame in found if frame[0] < 0x80]


def draw_frames(rng: np.random.Generator) -> list[Frame]:
    """Two to six frames of one hub: sequence, cycle and scan numbers go on."""
    sequence, cycle = (int(n) for n in rng.integers(0, 65536, 2))
    frames: list[Frame] = []
    for kind in rng.choice(TYPES, rng.integers(2, 7)):
        frame_type, spec = int(kind), FRAMES[FrameType(int(kind))]
        count = int(rng.integers(1, 241 if rng.random() < 0.05 else 24))
        length = 18 + 2 * count if frame_type == FrameType.TAXELS else int(rng.integers(spec.minimum, spec.maximum + 1))
        payload = bytearray(rng.bytes(length) if rng.random() < 0.7 else bytes([int(rng.integers(256))]) * length)
        if spec.has_address:
            payload[0] = ADDRESS_MIN + int(rng.integers(3))
        if frame_type == FrameType.BOARD_INFO:
            payload[0] = WHO_AM_I  # construct insists on it
        if frame_type == FrameType.TAXELS:
            cycle = (cycle + int(rng.integers(0, 3))) % 65536
            payload[1], payload[2:4], payload[8:10] = count, cycle.to_bytes(2, "little"), cycle.to_bytes(2, "little")
            if rng.random() < 0.9:
                payload[-4:] = crc32(bytes(payload[8:-4]), crc32(bytes(payload[:1]))).to_bytes(4, "little")
        frames.append((frame_type, sequence, bytes(payload)))
        sequence = (sequence + 1) % 65536
    return frames


def damage(stream: bytes, kind: str, rng: np.random.Generator) -> bytes:
    """The stream after one damage."""
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


def survivors(frames: list[Frame], bodies: list[bytes], stream: bytes) -> list[Frame]:
    """The frames whose stuffed bytes stand together in the stream, once for each time that they do, in its order."""
    places: list[tuple[int, int]] = []
    for index, body in enumerate(bodies):
        at = stream.find(body)
        while at >= 0:
            places.append((at, index))
            at = stream.find(body, at + 1)
    return [frames[index] for _, index in sorted(places)]


def cut(stream: bytes, rng: np.random.Generator) -> list[bytes]:
    """The stream in pieces."""
    if rng.random() < 0.1:
        return [stream[i : i + 1] for i in range(len(stream))]
    places = sorted({0, len(stream), *(int(n) for n in rng.integers(0, len(stream) + 1, rng.integers(0, 6)))})
    return [stream[a:b] for a, b in pairwise(places)]


def check_stream(seed: int, index: int, decoders: Decoders, tally: Counter[str]) -> str | None:
    """Draw stream `index`, decode it in every way, count; what disagrees, or None."""
    rng = np.random.default_rng([seed, index])
    frames = draw_frames(rng)
    wires = [encode_frame(*frame) for frame in frames]
    stream = b"".join(wires)
    for kind in rng.choice(DAMAGES, rng.integers(1, 4)):
        stream = damage(stream, str(kind), rng)
        tally[str(kind)] += 1
    pieces = cut(stream, rng)
    expected = survivors(frames, [wire[1:-1] for wire in wires], stream)
    tally["streams"] += 1
    tally["frames"] += len(frames)
    tally["out"] += len(expected)
    if decoders.streaming(pieces) != expected:
        return "C, frame by frame"
    if reference(pieces) != expected:
        return "Python reference"
    taxels, others, totals = decoders.batch(pieces)
    is_taxels = [frame[0] == FrameType.TAXELS for frame in expected]
    if taxels != [(k, s, p[:-4]) for (k, s, p), t in zip(expected, is_taxels, strict=True) if t]:
        return "C batch, taxel frames"
    if others != [frame for frame, t in zip(expected, is_taxels, strict=True) if not t]:
        return "C batch, other frames"
    if totals != losses_of(expected).totals():
        return "C batch, losses"
    if index % CONSTRUCT_EVERY == 0:
        tally["by construct"] += 1
        if parse_stream(stream, TO_HOST) != expected:
            return "construct"
    return None


def check_range(seed: int, first: int, count: int) -> tuple[Counter[str], float, str | None]:
    """(tally, seconds of this process, the first disagreement)."""
    tally: Counter[str] = Counter()
    decoders = Decoders()
    begin = time.process_time()
    for index in range(first, first + count):
        wrong = check_stream(seed, index, decoders, tally)
        if wrong:
            return tally, time.process_time() - begin, f"stream {index}: {wrong} disagrees"
    return tally, time.process_time() - begin, None


def main() -> int:
    """Print what was counted."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--streams", type=int, default=500_000)
    parser.add_argument("--seed", type=int, default=1, help="(default: 1)")
    parser.add_argument("--first", type=int, default=0, help="number of the first stream")
    parser.add_argument("--jobs", type=int, default=1, help="processes (default: 1)")
    arguments = parser.parse_args()
    print(f"seed {arguments.seed}")
    end = arguments.first + arguments.streams
    ranges = [(arguments.seed, i, min(BLOCK, end - i)) for i in range(arguments.first, end, BLOCK)]
    tally: Counter[str] = Counter()
    seconds = 0.0
    begin = time.monotonic()
    with multiprocessing.Pool(arguments.jobs) as pool:
        for part, spent, wrong in pool.imap(_check_one, ranges):
            tally += part
            seconds += spent
            if wrong:
                index = int(wrong.split()[1].rstrip(":"))
                print(f"{wrong}; replay: --seed {arguments.seed} --first {index} --streams 1")
                return 1
    wall = time.monotonic() - begin
    lost = tally["frames"] - tally["out"]
    print(f"{tally['streams']} streams, no disagreement")
    print(f"{tally['frames']} frames sent, {tally['out']} came out ({lost} fewer)")
    print("damages: " + ", ".join(f"{tally[kind]} {kind}" for kind in DAMAGES))
    print(f"{tally['by construct']} of the streams parsed by construct")
    print(f"{seconds:.0f} s of machine time, {wall:.0f} s by the clock")
    return 0


def _check_one(part: tuple[int, int, int]) -> tuple[Counter[str], float, str | None]:
    return check_range(*part)


if __name__ == "__main__":
    sys.exit(main())
