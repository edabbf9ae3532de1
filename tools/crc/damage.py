"""Decode millions of damaged frames with the C decoder and count the frames that it accepts.

python tools/crc/damage.py                       less than a minute; prints its seed
python tools/crc/damage.py --frames 5000000      frames of each kind of damage

The C codec is the library in $TAXEL_CODEC_LIBRARY, or the one in the installed package.
"""

import argparse
import ctypes
import importlib.resources
import os
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from taxel.stream.deframer import Deframer
from taxel.types import ByteArray
from taxel_protocol import crc32, encode_frame
from taxel_protocol.framing import whiten
from taxel_protocol.limits import BODY_MAX
from taxel_protocol.names import FrameType

Damage = Callable[[ByteArray, np.random.Generator], ByteArray]

BATCH = 50_000
SAMPLE = 1_000
"""Additional frames per batch that Python parses to determine which check rejects them.

Each of them has its own content, because the share that only the CRC rejects depends on the zero bytes of the body.
"""


def load_codec() -> ctypes.CDLL:
    """Load the C library that encodes and decodes frames.

    Exits the program with a one-line message if the library is not built.
    """
    configured = os.environ.get("TAXEL_CODEC_LIBRARY")
    try:
        path = (
            Path(configured)
            if configured
            else Path(str(importlib.resources.files("taxel") / "native" / "libtaxel_codec.so"))
        )
        library = ctypes.CDLL(str(path))
    except (ModuleNotFoundError, OSError) as error:
        sys.exit(f"no C codec ({error}): build firmware with CMake, set TAXEL_CODEC_LIBRARY to libtaxel_codec.so")
    return library


@dataclass
class Tally:
    """Results of the frames with one kind of damage.

    unchanged: accepted with the original content. altered: accepted with another content. reached_crc: sampled frames
    that only the CRC rejects.
    """

    frames: int = 0
    unchanged: int = 0
    altered: int = 0
    sampled: int = 0
    reached_crc: int = 0


def _sample_positions(frames: ByteArray, rng: np.random.Generator) -> NDArray[np.int64]:
    """Return a random byte index for each frame, i64[n]. frames: u8[n, size]."""
    return rng.integers(0, frames.shape[1], len(frames))


def _change_bytes(frames: ByteArray, rng: np.random.Generator, places: NDArray[np.int64]) -> ByteArray:
    """Change one byte of each frame to a different nonzero value.

    frames: u8[n, size], n frames of equal size. places: i64[n], index of the byte in each frame.
    """
    out = frames.copy()
    rows = np.arange(len(frames))
    # A shift of 1 to 254 steps in the cycle of the values 1 to 255 never gives 0 or the old value.
    shift = rng.integers(1, 255, len(frames), dtype=np.uint8)
    out[rows, places] = (out[rows, places].astype(np.int16) - 1 + shift) % 255 + 1
    return out


def change_byte(frames: ByteArray, rng: np.random.Generator) -> ByteArray:
    """Change one random byte of each frame to another value that is not zero. frames: u8[n, size]."""
    return _change_bytes(frames, rng, _sample_positions(frames, rng))


def change_two_bytes(frames: ByteArray, rng: np.random.Generator) -> ByteArray:
    """Change a random byte of each frame twice, to values that are not zero. frames: u8[n, size].

    Both changes may hit the same byte.
    """
    return change_byte(change_byte(frames, rng), rng)


def change_ten_bytes(frames: ByteArray, rng: np.random.Generator) -> ByteArray:
    """Change a random byte of each frame ten times, to values that are not zero. frames: u8[n, size].

    Several changes may hit the same byte.
    """
    for _ in range(10):
        frames = change_byte(frames, rng)
    return frames


def change_code_byte(frames: ByteArray, rng: np.random.Generator) -> ByteArray:
    """Change a random code byte of each frame's byte stuffing (COBS), which moves the boundaries of all later blocks.

    frames: u8[n, size]; the code bytes of all frames are at the same positions.
    """
    codes = [0]  # positions of the code bytes; a code byte states the distance to the next
    while codes[-1] + int(frames[0, codes[-1]]) < frames.shape[1]:
        codes.append(codes[-1] + int(frames[0, codes[-1]]))
    return _change_bytes(frames, rng, rng.choice(np.array(codes), len(frames)))


def flip_bit(frames: ByteArray, rng: np.random.Generator) -> ByteArray:
    """Flip one random bit of each frame; a byte may become zero and split the frame. frames: u8[n, size]."""
    out = frames.copy()
    masks = np.left_shift(1, rng.integers(0, 8, len(frames))).astype(np.uint8)
    out[np.arange(len(frames)), _sample_positions(frames, rng)] ^= masks
    return out


def remove_byte(frames: ByteArray, rng: np.random.Generator) -> ByteArray:
    """Remove one random byte of each frame. frames: u8[n, size]."""
    columns = np.arange(frames.shape[1] - 1)
    return np.take_along_axis(frames, columns + (columns >= _sample_positions(frames, rng)[:, None]), axis=1)


def insert_byte(frames: ByteArray, rng: np.random.Generator) -> ByteArray:
    """Insert one random byte that is not zero into each frame. frames: u8[n, size]."""
    places = rng.integers(1, frames.shape[1], len(frames))
    columns = np.arange(frames.shape[1] + 1)
    # Bytes behind the place move by one column; the byte at the place is overwritten below.
    out = np.take_along_axis(frames, columns - (columns > places[:, None]), axis=1)
    out[np.arange(len(frames)), places] = rng.integers(1, 256, len(frames), dtype=np.uint8)
    return out


def randomise_end(frames: ByteArray, rng: np.random.Generator) -> ByteArray:
    """Replace all bytes from a random position on with random nonzero bytes, as after a bit slip in the receiver."""
    noise = rng.integers(1, 256, frames.shape, dtype=np.uint8)
    return np.where(np.arange(frames.shape[1]) < _sample_positions(frames, rng)[:, None], frames, noise)


def randomise_all(frames: ByteArray, rng: np.random.Generator) -> ByteArray:
    """Replace all bytes of each frame with random nonzero bytes. frames: u8[n, size]."""
    return rng.integers(1, 256, frames.shape, dtype=np.uint8)


KINDS: tuple[Damage, ...] = (
    flip_bit,
    change_byte,
    change_two_bytes,
    change_ten_bytes,
    change_code_byte,
    remove_byte,
    insert_byte,
    randomise_end,
    randomise_all,
)


def build_taxel_frame(rng: np.random.Generator, taxel_count: int) -> tuple[tuple[int, int, bytes], bytes]:
    """Build a taxel frame with random counts.

    Returns its content (type, sequence, payload), and its bytes on the wire without the delimiters.
    """
    counts = rng.normal(4000, 20, taxel_count).astype("<u2").tobytes()
    head = bytes([0x20, taxel_count]) + rng.bytes(6)  # board address, number of taxels, random other fields
    snapshot = rng.bytes(6) + counts
    # The CRC of the board covers its address and the snapshot.
    payload = head + snapshot + crc32(snapshot, crc32(head[:1])).to_bytes(4, "little")
    sequence = int(rng.integers(0, 1 << 16))
    return (FrameType.TAXELS, sequence, payload), encode_frame(FrameType.TAXELS, sequence, payload)[1:-1]


def reaches_crc(stuffed: bytes) -> bool:
    """Return whether only the CRC can reject a received frame, given with its byte stuffing.

    This is the case if the bytes are a taxel frame that passes all checks before the CRC: byte stuffing, type, I2C
    address (0x08 to 0x77) and length. A body consists of the header (type, sequence, length; 5 bytes), the payload
    (address, number n of taxels, ...; 18 + 2 n bytes) and the CRC (4 bytes).
    """
    body = bytearray()
    position = 0
    while position < len(stuffed) and len(body) <= BODY_MAX:
        end = position + stuffed[position]
        if end > len(stuffed):
            return False
        body += stuffed[position + 1 : end]
        if len(body) >= 7:
            head = whiten(bytes(body[:7]))
            length = int.from_bytes(head[3:5], "little")
            if head[0] != FrameType.TAXELS or not 0x08 <= head[5] <= 0x77 or length != 18 + 2 * head[6]:
                return False
            if len(body) >= length + 9:
                return len(body) == length + 9
        if stuffed[position] < 0xFF:
            body.append(0)
        position = end
    return False


def measure(kind: Damage, total: int, rng: np.random.Generator, decoder: Deframer, taxel_count: int) -> Tally:
    """Damage about `total` frames with the function `kind`, decode them with the C decoder, and count the results.

    A batch consists of copies of one frame, each with its own random damage. For each batch, `SAMPLE` further frames
    are built and damaged; these frames are not decoded, but checked for damage that only the CRC can detect.
    """
    tally = Tally()
    (sample_rng,) = rng.spawn(1)
    while tally.frames < total:
        size = min(BATCH, total - tally.frames)
        content, stuffed = build_taxel_frame(rng, taxel_count)
        damaged = kind(np.tile(np.frombuffer(stuffed, np.uint8), (size, 1)), rng)
        if kind in (change_ten_bytes, change_two_bytes, randomise_end):  # remove frames that random changes left intact
            width = min(damaged.shape[1], len(stuffed))
            damaged = damaged[(damaged[:, :width] != np.frombuffer(stuffed, np.uint8)[:width]).any(axis=1)]
        stream = np.zeros((len(damaged), damaged.shape[1] + 1), np.uint8)
        stream[:, :-1] = damaged
        for frame in decoder.decode([stream.tobytes()]):
            tally.unchanged += frame == content
            tally.altered += frame != content
        tally.frames += size
        for _ in range(SAMPLE):
            _, stuffed = build_taxel_frame(sample_rng, taxel_count)
            row = kind(np.frombuffer(stuffed, np.uint8)[None], sample_rng)[0]
            tally.sampled += 1
            tally.reached_crc += reaches_crc(row.tobytes())
    return tally


def main() -> int:
    """Print for each kind of damage how many damaged frames the decoder accepts; the exit status is 1 if it accepts
    altered ones.
    """
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--frames", type=int, default=1_000_000, help="frames of each kind (default: 1000000)")
    parser.add_argument("--taxels", type=int, default=63, help="taxels of a frame (default: 63, the average board)")
    parser.add_argument("--seed", type=int, default=20, help="seed of the random damage (default: 20)")
    arguments = parser.parse_args()
    rng = np.random.default_rng(arguments.seed)
    decoder = Deframer(load_codec())
    print(f"seed {arguments.seed}, frames of {arguments.taxels} taxels")
    print("damage             frames     altered  95 % bound   unchanged    only CRC fails")
    total = altered = 0
    for kind in KINDS:
        tally = measure(kind, arguments.frames, rng, decoder, arguments.taxels)
        total, altered = total + tally.frames, altered + tally.altered
        bound = f"{3 / tally.frames:10.1e}" if not tally.altered else "         -"
        share = tally.reached_crc / tally.sampled
        name = kind.__name__.replace("_", " ")
        print(f"{name:17s} {tally.frames:8d}  {tally.altered:8d}  {bound}  {tally.unchanged:10d}   {share:14.2%}")
    print(f"all               {total:8d}  {altered:8d}  {3 / total:10.1e}   (rule of three: share below 3 / n at 95 %)")
    return 1 if altered else 0


if __name__ == "__main__":
    sys.exit(main())
