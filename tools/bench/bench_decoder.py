"""The host's streaming decoder against construct's own uncompiled parse of the same taxel frames."""

import tempfile
from pathlib import Path

from figures import Figure, seconds
from recorded import record

from taxel.link import CaptureLink
from taxel.stream import LossAccount, StreamDecoder
from taxel.stream.clock import ClockMap
from taxel.stream.frames import taxel_frames_of
from taxel_protocol import FrameType
from taxel_protocol.framing import cobs_decode, whiten
from taxel_protocol.wire import Body

CHUNK = 4096
CONSTRUCT_FRAMES = 600


def _stream(path: Path) -> bytes:
    link = CaptureLink(path)
    data = bytearray()
    try:
        while True:
            data += link.read().data
    except EOFError:
        link.close()
    return bytes(data)


def _decode(data: bytes) -> int:
    """As the host does: chunks in, `TaxelFrame` objects out, CRCs checked, losses counted, times mapped."""
    decoder, clock = StreamDecoder(), ClockMap(1e6, has_arrivals=False)
    frames = 0
    for start in range(0, len(data), CHUNK):
        for batch in decoder.push(data[start : start + CHUNK]):
            rows = batch.taxels
            frames += len(taxel_frames_of(batch, rows, clock.host_times_s(clock.hub_times_us(rows))))
    assert LossAccount(decoder).lost_on_wire == 0
    return frames


def measure() -> list[Figure]:
    """Taxel frames a second, ours over construct's."""
    with tempfile.TemporaryDirectory() as name:
        capture, _ = record(Path(name), 120.0)
        data = _stream(capture)
    bodies = [whiten(cobs_decode(chunk)) for chunk in data.split(b"\0")[:-1] if chunk]  # the last is cut off
    bodies = [body for body in bodies if body[0] == FrameType.TAXELS]
    sample = bodies[:CONSTRUCT_FRAMES]
    # construct is given the unstuffed, unwhitened bodies: only its own work counts.
    construct = len(sample) / seconds(lambda: [Body.parse(body) for body in sample], repeats=3)
    ours = len(bodies) / seconds(lambda: _decode(data))
    detail = (
        f"{ours:,.0f} against {construct:,.0f} frames/s, {len(data) / len(bodies):.0f} bytes a frame, chunks of {CHUNK}"
    )
    return [Figure("streaming decode to TaxelFrame objects", ours / construct, 40.0, "construct, uncompiled", detail)]
