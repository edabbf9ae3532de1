"""Read snapshots of an executed board at random instants of its scans: every one must be of one time.

python tools/firmware/read_anywhere.py [--reads 100000] [--seed 1] [--board 0x2C]

What is measured grows all the while, a few steps a scan, so that each scan has values of its own: in a coherent
snapshot they never fall from taxel to taxel, and no snapshot begins below the end of an earlier one. The CRC must be
right. Exit status 1 if one is not so.
"""

from __future__ import annotations

import argparse
import struct
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from executed_world import BOARD_IMAGE, IMAGES, files, image_line, lone_board

from taxel.errors import TaxelError
from taxel.hand import load_hand
from taxel.hand.world import WorldSettings
from taxel.link.virtual import VirtualWorld
from taxel_protocol import SNAPSHOT_OVERHEAD
from taxel_protocol.framing import crc32
from taxel_protocol.limits import REGISTER_SNAPSHOT

HEADER: Final = struct.Struct("<HI")
LONGEST_PAUSE_S: Final = 0.002
STEP_S: Final = 0.0007
LARGEST: Final = 6000
"""Counts go from 1 to here and begin again; the scan that sees that is left out."""


@dataclass
class Reads:
    """What was read: snapshots and the scans that they show, those left out, and what was wrong; of the processor: the
    stack it took, bytes, and its faults.
    """

    reads: int = 0
    scans: int = 0
    skipped: int = 0
    stack: int = 0
    faults: int = 0
    wrong: str | None = None


class _Board:
    """The board, its stimulus that only grows, and the snapshots read from it."""

    def __init__(self, world: VirtualWorld, address: int, taxels: int, seed: int) -> None:
        self._world, self._address, self._taxels = world, address, taxels
        self._random = np.random.default_rng(seed)
        self._value, self._steps_s = 1, 0.0
        self._last: tuple[int, int] | None = None
        self._sequence = 0
        self._skip_until: int | None = None
        world.transfer(address, bytes([REGISTER_SNAPSHOT]), 0)

    def _grow(self, seconds: float) -> None:
        """Let time pass; the measured value grows by 1 every `STEP_S`."""
        end = self._world.now_s + seconds
        while self._world.now_s < end:
            self._value += 1
            if self._value > LARGEST:
                self._value, self._skip_until = 1, self._sequence + 3
            self._world.press(np.full(self._taxels, self._value))
            self._world.run(min(STEP_S, max(end - self._world.now_s, 1e-9)))

    def read(self, result: Reads) -> None:
        """One snapshot at a random instant; `result.wrong` is set if it cannot have been measured in one scan."""
        self._grow(float(self._random.uniform(0.0, LONGEST_PAUSE_S)))
        code, data = self._world.transfer(self._address, b"", SNAPSHOT_OVERHEAD + 2 * self._taxels)
        result.reads += 1
        body, crc = data[:-4], struct.unpack("<I", data[-4:])[0]
        if code or crc32(bytes([self._address]) + body) != crc:
            result.wrong = f"transfer {code}, CRC wrong: {data.hex()}"
            return
        sequence = HEADER.unpack_from(body)[0]
        counts = np.frombuffer(body, "<u2", offset=HEADER.size).astype(int)
        if self._last is None or sequence != self._last[0]:
            result.scans += 1
        self._sequence = sequence
        if self._skip_until is not None and (self._skip_until - sequence) % 65536 < 32768:
            self._last = None
            result.skipped += 1
            return
        self._skip_until = None
        before = self._last
        if (np.diff(counts) < 0).any() or (before and sequence != before[0] and counts[0] < before[1]):
            result.wrong = f"scan {sequence}: {counts.tolist()} after {before}"
        self._last = sequence, int(counts[-1])


def read_anywhere(reads: int, seed: int = 1, address: int = 0x2C, images: Path = IMAGES) -> Reads:
    """Read so many snapshots; ends with the first that is wrong."""
    hand = load_hand("allegro")
    text = lone_board(hand, address, WorldSettings(seed=seed)) + image_line(address)
    result = Reads()
    with VirtualWorld(text, "none", counts=True, files={BOARD_IMAGE: files(images)[BOARD_IMAGE]}) as world:
        world.inject("hub_unplug")
        world.run(0.3)
        board = _Board(world, address, hand.get_board(address).kind.taxel_count, seed)
        while result.reads < reads and result.wrong is None:
            board.read(result)
        processor = world.processor(address)
        result.stack, result.faults = processor.stack, processor.faults
    return result


def main() -> int:
    """Read, and say what came of it; an error is one line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--reads", type=int, default=100_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--board", type=lambda text: int(text, 0), default=0x2C)
    parser.add_argument("--images", type=Path, default=IMAGES, help="folder of the images that `make firmware` builds")
    options = parser.parse_args()
    try:
        result = read_anywhere(options.reads, options.seed, options.board, options.images)
    except (TaxelError, OSError) as error:
        print(f"read_anywhere: {error}", file=sys.stderr)
        return 1
    found = "all of one time" if result.wrong is None else result.wrong
    print(
        f"{result.reads} snapshots of {result.scans} scans, seed {options.seed}: {found}; faults {result.faults}, "
        f"stack {result.stack} bytes"
    )
    return 0 if result.wrong is None and not result.faults else 1


if __name__ == "__main__":
    sys.exit(main())
