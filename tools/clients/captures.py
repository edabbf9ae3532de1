"""Captures for the comparison of the clients: a recorded emulated hand, and damage of its bytes."""

import random
from pathlib import Path

from taxel.hand import load_hand
from taxel.hand.world import WorldSettings, format_world
from taxel.link import CaptureWriter
from taxel.link.virtual import VirtualMemoryLink, VirtualWorld
from taxel.skin import Skin
from taxel.skin.capture_bytes import CaptureBytes
from taxel.skin.recording_link import RecordingLink
from taxel.skin.skin import FrameFormat

POLL_S = 0.005
PIECE = 62
"""Bytes of a packet of a common USB adapter (FTDI) behind its two status bytes."""

REPEATED_MAX = 8
"""Largest number of repeated bytes: shorter than a frame, because a repeated frame counts as 65,535 lost frames."""


def record_capture(path: Path, seconds: float, frames: FrameFormat) -> None:
    """Record the emulated hand `original`: its start, then `seconds` of virtual time. frames: "plain" or "compact"."""
    hand = load_hand("original")
    writer = CaptureBytes(CaptureWriter(path, {"clock": "hub", "hand": hand.name}, overwrite=True))
    with (
        VirtualWorld(format_world(hand, WorldSettings())) as world,
        Skin(RecordingLink(VirtualMemoryLink(world), writer), hand, frames=frames) as skin,
    ):
        end_s = world.now_s + seconds  # the start takes seconds of virtual time, too
        while world.now_s < end_s:
            skin.poll(POLL_S)


def damage(data: bytes, seed: int, mean_distance: float = 2000.0) -> bytes:
    """Damage a stream at random places: bytes are changed, lost, added, zeroed or repeated.

    mean_distance: mean number of bytes between two places. The seed repeats the damage.
    """
    draw = random.Random(seed)
    out = bytearray()
    position = 0
    while True:
        step = int(draw.expovariate(1.0 / mean_distance)) + 1
        out += data[position : position + step]
        position += step
        if position >= len(data):
            return bytes(out)
        kind, size = draw.randrange(6), draw.choice((1, 1, 2, 30, 700))
        if kind == 0:
            out.append(data[position] ^ draw.randint(1, 255))
            position += 1
        elif kind == 1:
            position += size
        elif kind == 2:
            out += draw.randbytes(size)
        elif kind == 3:
            out.append(0)
            position += 1
        elif kind == 4:
            out += data[max(position - min(size, REPEATED_MAX), 0) : position]
        else:
            out += bytes(draw.randint(1, 255) for _ in range(size))


def write_capture(path: Path, data: bytes) -> None:
    """Write a stream as a capture in pieces of PIECE bytes, at 1 Mbit/s."""
    with CaptureWriter(path, {"clock": "hub", "hand": "original"}, overwrite=True) as writer:
        for start in range(0, len(data), PIECE):
            writer.write(data[start : start + PIECE], start * 10_000)  # 10 bits of 1 us per byte, in nanoseconds
