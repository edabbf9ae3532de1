"""Decoders of the host, compared with construct's uncompiled parse of the same frames and with memcpy + CRC-32."""

import tempfile
import zlib
from pathlib import Path

import numpy as np
from figures import Figure, compare
from recordings import record

from taxel.link import CaptureLink
from taxel.stream import LossAccount, StreamDecoder, decode_capture
from taxel.stream.clock import ClockMap
from taxel.stream.frames import build_taxel_frames
from taxel_protocol import FrameType
from taxel_protocol.framing import cobs_decode, whiten
from taxel_protocol.wire import Body

VIRTUAL_S = 60.0
CHUNK = 4096
CONSTRUCT_FRAMES = 200


def _read_stream(path: Path) -> bytes:
    """Read all bytes of a capture file, in the order in which the host received them."""
    data = bytearray()
    with CaptureLink(path) as link:
        try:
            while True:
                data += link.read().data
        except EOFError:
            return bytes(data)


def _decode_batches(data: bytes) -> None:
    """Decode a byte stream in chunks to arrays, as the host does, including both CRCs and loss accounting."""
    decoder = StreamDecoder()
    for start in range(0, len(data), CHUNK):
        decoder.push(data[start : start + CHUNK])
    assert LossAccount(decoder).lost_on_wire == 0


def _decode_frames(data: bytes) -> None:
    """Decode a byte stream to one `TaxelFrame` object per frame, including CRCs, loss accounting and clock mapping."""
    decoder, clock = StreamDecoder(), ClockMap(1e6, has_arrivals=False)
    for start in range(0, len(data), CHUNK):
        for batch in decoder.push(data[start : start + CHUNK]):
            rows = batch.taxel_rows
            build_taxel_frames(batch, rows, clock.host_times_s(clock.hub_times_us(rows)))


def measure() -> list[Figure]:
    """Run the benchmark of the decoders.

    It measures taxel frames per second relative to construct, and bytes per second relative to memcpy and CRC-32.
    """
    with tempfile.TemporaryDirectory() as name:
        capture, _ = record(Path(name), VIRTUAL_S)
        return _compare_decoders(capture)


def _compare_decoders(capture: Path) -> list[Figure]:
    """Compare the speed of all decoders on one capture file of the emulated hand. Returns the rows of the report.

    The arguments of `Figure` are: name, ratio to the reference, required minimum of the ratio, reference, details.
    """
    data, file = _read_stream(capture), np.fromfile(capture, dtype=np.uint8)
    bodies = [whiten(cobs_decode(chunk)) for chunk in data.split(b"\0")[:-1] if chunk]  # the last frame is truncated
    bodies = [body for body in bodies if body[0] == FrameType.TAXELS]
    sample = bodies[:CONSTRUCT_FRAMES]
    target = np.empty_like(file)

    def parse_with_construct() -> None:
        """Parse the bodies of sample frames with the library construct."""
        # Uses unstuffed, unwhitened bodies, so that only construct's own work is measured.
        for body in sample:
            Body.parse(body)

    def copy_and_checksum() -> None:
        """Copy the capture in memory and compute its CRC-32, a lower bound for the work of a decoder."""
        np.copyto(target, file)
        zlib.crc32(target.data)

    def decode_capture_batches() -> None:
        """Decode the capture file in batches, without use of the results."""
        for _ in decode_capture(capture):
            pass

    share = len(bodies) / len(sample)
    batches, frames = (
        compare(lambda: _decode_batches(data), parse_with_construct),
        compare(lambda: _decode_frames(data), parse_with_construct),
    )
    capture_decode, against_memory = (
        compare(decode_capture_batches, parse_with_construct),
        compare(decode_capture_batches, copy_and_checksum, repeats=41),
    )
    rate = f"construct {len(sample) / batches.reference_s:,.0f} frames/s, {len(data) / len(bodies):.0f} bytes per frame"
    return [
        Figure(
            "streaming decode to batches",
            batches.ratio * share,
            100.0,
            "construct, uncompiled",
            f"{len(bodies) / batches.measured_s:,.0f} frames/s, chunks of {CHUNK}; {rate}",
        ),
        Figure(
            "streaming decode to TaxelFrame objects",
            frames.ratio * share,
            40.0,
            "construct, uncompiled",
            f"{len(bodies) / frames.measured_s:,.0f} frames/s, chunks of {CHUNK}",
        ),
        Figure(
            "batch decode of a capture",
            capture_decode.ratio * share,
            200.0,
            "construct, uncompiled",
            f"{len(bodies) / capture_decode.measured_s:,.0f} frames/s, file read included",
        ),
        Figure(
            "batch decode of a capture",
            against_memory.ratio,
            0.3,
            "memcpy + zlib.crc32",
            f"file of {len(file) / 1e6:.1f} MB: {len(file) / against_memory.measured_s / 1e6:,.0f} against "
            f"{len(file) / against_memory.reference_s / 1e6:,.0f} MB/s; {len(data) / 1e6:.1f} MB are stream",
        ),
    ]
