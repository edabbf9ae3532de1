"""Coherence test: snapshots read from an executed board at random times must each contain one scan.

    python tools/firmware/random_snapshot_reads.py [--reads 100000] [--seed 1] [--board 0x2C]

The measured value increases all the time by a few steps per scan, so that each scan has distinct values: in a coherent
snapshot values never decrease from taxel to taxel, and no snapshot starts below the end of an earlier snapshot. The
CRC must be correct. The exit status is 1 otherwise.
"""

import argparse
import struct
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from executed_world import BOARD_IMAGE, IMAGES, find_image_files, format_image_line, make_board_world

from taxel.errors import TaxelError
from taxel.hand import load_hand
from taxel.hand.world import WorldSettings
from taxel.link.virtual import VirtualWorld
from taxel_protocol import SNAPSHOT_OVERHEAD
from taxel_protocol.framing import crc32
from taxel_protocol.limits import REGISTER_SNAPSHOT

HEADER: Final = struct.Struct("<HI")
PAUSE_MAX_S: Final = 0.002
STEP_S: Final = 0.0007
COUNT_MAX: Final = 6000
"""Counts increase from 1 to this value and restart; scans during the restart are ignored."""


@dataclass
class Reads:
    """Result of a series of reads.

    reads: number of snapshots. scans: number of distinct scans. skipped: ignored snapshots. stack: bytes used by the
    processor. faults: faults of the processor. error: first incoherent snapshot.
    """

    reads: int = 0
    scans: int = 0
    skipped: int = 0
    stack: int = 0
    faults: int = 0
    error: str | None = None


class _Board:
    """The board, its increasing stimulus, and the snapshots read from it."""

    def __init__(self, world: VirtualWorld, address: int, taxels: int, seed: int) -> None:
        """Select the snapshot register of an emulated board, whose raw counts increase with time.

        address: I2C address. taxels: number of taxels. seed: seed of the random times at which snapshots are read.
        """
        self._world, self._address, self._taxels = world, address, taxels
        self._random = np.random.default_rng(seed)
        self._value, self._steps_s = 1, 0.0
        self._previous: tuple[int, int] | None = None
        self._sequence = 0
        self._skip_until: int | None = None
        world.transfer(address, bytes([REGISTER_SNAPSHOT]), 0)

    def _advance(self, seconds: float) -> None:
        """Advance the virtual time by `seconds`; the raw count of every taxel increases by 1 every `STEP_S`."""
        end = self._world.now_s + seconds
        while self._world.now_s < end:
            self._value += 1
            if self._value > COUNT_MAX:
                # The next scans may contain counts before and after the restart, and are ignored.
                self._value, self._skip_until = 1, self._sequence + 3
            self._world.set_stimulus(np.full(self._taxels, self._value))
            self._world.run(min(STEP_S, max(end - self._world.now_s, 1e-9)))

    def read(self, result: Reads) -> None:
        """Read a snapshot at a random time and count it; set `result.error` if it cannot originate from one scan."""
        self._advance(float(self._random.uniform(0.0, PAUSE_MAX_S)))
        code, data = self._world.transfer(self._address, b"", SNAPSHOT_OVERHEAD + 2 * self._taxels)
        result.reads += 1
        body, crc = data[:-4], struct.unpack("<I", data[-4:])[0]
        if code or crc32(bytes([self._address]) + body) != crc:
            result.error = f"transfer result {code} or CRC wrong: {data.hex()}"
            return
        sequence = HEADER.unpack_from(body)[0]
        counts = np.frombuffer(body, "<u2", offset=HEADER.size).astype(int)
        if self._previous is None or sequence != self._previous[0]:
            result.scans += 1
        self._sequence = sequence
        # Sequence numbers have 16 bits: a difference below 32768 means that `_skip_until` is not yet exceeded.
        if self._skip_until is not None and (self._skip_until - sequence) % 65536 < 32768:
            self._previous = None
            result.skipped += 1
            return
        self._skip_until = None
        before = self._previous
        # The counts increase with time, and a scan measures the taxels in order: later counts are never smaller.
        if (np.diff(counts) < 0).any() or (before and sequence != before[0] and counts[0] < before[1]):
            result.error = f"scan {sequence}: {counts.tolist()} after {before}"
        self._previous = sequence, int(counts[-1])


def read_random_snapshots(reads: int, seed: int = 1, address: int = 0x2C, images: Path = IMAGES) -> Reads:
    """Read up to `reads` snapshots of a board at random times, up to the first that cannot originate from one scan.

    address: I2C address. images: folder of the firmware images that the board executes.
    """
    hand = load_hand("allegro")
    text = make_board_world(hand, address, WorldSettings(seed=seed)) + format_image_line(address)
    result = Reads()
    with VirtualWorld(text, "none", counts=True, files={BOARD_IMAGE: find_image_files(images)[BOARD_IMAGE]}) as world:
        world.inject("hub_unplug")
        world.run(0.3)
        board = _Board(world, address, hand.get_board(address).kind.taxel_count, seed)
        while result.reads < reads and result.error is None:
            board.read(result)
        processor = world.read_processor(address)
        result.stack, result.faults = processor.stack, processor.faults
    return result


def main() -> int:
    """Read snapshots at random times and print the result.

    The exit status is 1 after a snapshot with data of more than one scan, after a processor fault, or after an error.
    """
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--reads", type=int, default=100_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--board", type=lambda text: int(text, 0), default=0x2C)
    parser.add_argument("--images", type=Path, default=IMAGES, help="folder of the images that `make firmware` builds")
    options = parser.parse_args()
    try:
        result = read_random_snapshots(options.reads, options.seed, options.board, options.images)
    except (TaxelError, OSError) as error:
        print(f"random_snapshot_reads: {error}", file=sys.stderr)
        return 1
    finding = "all coherent" if result.error is None else result.error
    print(
        f"{result.reads} snapshots of {result.scans} scans, seed {options.seed}: {finding}; faults {result.faults}, "
        f"stack {result.stack} bytes"
    )
    return 0 if result.error is None and not result.faults else 1


if __name__ == "__main__":
    sys.exit(main())
