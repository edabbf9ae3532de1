"""Processor load of the firmware: cycles awake per scan and poll of a board, and per poll and frame of the hub.

The cycles are counted in the images of `make firmware`, executed in the emulator; the same images give the same
figures.
"""

import struct
from pathlib import Path
from typing import Final, NamedTuple

from executed_world import BOARD_IMAGE, HUB_IMAGE, format_image_line, open_scanning_world

from taxel.hand import Hand, load_hand
from taxel.hand.boards import Board
from taxel.hand.world import WorldSettings, format_world
from taxel.link.virtual import VirtualMemoryLink, VirtualWorld
from taxel.skin import Skin
from taxel_protocol import SNAPSHOT_OVERHEAD
from taxel_protocol.limits import REGISTER_SNAPSHOT

CYCLES_PER_US: Final = 48
POLLS: Final = 40
POLL_PERIOD_S: Final = 0.0113
RUN_S: Final = 1.0
FRAMES_S: Final = 2.0


class BoardCycles(NamedTuple):
    """Cycles of one kind of board.

    scan: cycles awake per scan. poll: additional cycles awake per read of a snapshot. length: cycles between scans
    without reads.
    """

    kind: str
    taxels: int
    scan: int
    length: int
    poll: int

    @property
    def budget(self) -> int:
        """Budget of scan and poll together: beyond it the conversions would be delayed."""
        return self.length


class HubCycles(NamedTuple):
    """Cycles of a hub that streams the whole hand.

    poll: cycles of its I2C interrupts per poll. frame: all other cycles awake per frame, including the UART's
    interrupts (`uart`). length: cycles between frames.
    """

    boards: int
    poll: int
    frame: int
    uart: int
    length: int

    @property
    def budget(self) -> int:
        """Budget of poll and frame together: beyond it the bus would be slowed down."""
        return self.length


class FirmwareCycles(NamedTuple):
    """All counted cycles; `boards` in ascending order of taxels."""

    boards: tuple[BoardCycles, ...]
    hub: HubCycles


def _read_snapshot_header(world: VirtualWorld, board: Board) -> tuple[int, int]:
    """Return the scan number and the board time in microseconds of an emulated board's current snapshot."""
    _, data = world.transfer(board.address, b"", SNAPSHOT_OVERHEAD + 2 * board.kind.taxel_count)
    sequence, time_us = struct.unpack_from("<HI", data)
    return int(sequence), int(time_us)


def _read_cycle_counts(world: VirtualWorld, address: int) -> tuple[int, int]:
    """Return the processor cycles of an executed board or hub since its start: all cycles, and cycles awake."""
    processor = world.read_processor(address)
    return processor.cycles, processor.cycles - processor.sleep_cycles


def measure_board(hand: Hand, board: Board, image: Path) -> BoardCycles:
    """Count the processor cycles of a board that executes its image, first without and then with polls."""
    address = board.address
    with open_scanning_world(hand, board, image) as world:
        world.transfer(address, bytes([REGISTER_SNAPSHOT]), 0)
        world.run(0.05)
        first = _read_snapshot_header(world, board)
        begin = _read_cycle_counts(world, address)
        world.run(RUN_S)
        end = _read_cycle_counts(world, address)
        last = _read_snapshot_header(world, board)
        # Cycle counts: [0] all cycles, [1] cycles awake. Snapshot headers: [0] scan number, [1] board time in us.
        share = (end[1] - begin[1]) / (end[0] - begin[0])
        length = (last[1] - first[1]) * CYCLES_PER_US / (last[0] - first[0])
        begin = _read_cycle_counts(world, address)
        for _ in range(POLLS):
            _read_snapshot_header(world, board)
            world.run(POLL_PERIOD_S)
        end = _read_cycle_counts(world, address)
    poll = (end[1] - begin[1] - share * (end[0] - begin[0])) / POLLS
    return BoardCycles(board.kind.name, board.kind.taxel_count, round(share * length), round(length), round(poll))


def measure_hub(hand: Hand, image: Path) -> HubCycles:
    """Count the processor cycles of a hub that executes its image and polls the whole hand.

    The boards are emulated natively.
    """
    text = format_world(hand, WorldSettings(noise_counts=0.0)) + format_image_line(0)
    with VirtualWorld(text, files={HUB_IMAGE: image}) as world, Skin(VirtualMemoryLink(world), hand) as skin:

        def count_frames(seconds: float) -> int:
            """Return the number of frames that the emulated hub delivers within `seconds` of virtual time."""
            end, frames = world.now_s + seconds, 0
            while world.now_s < end:
                frames += len(skin.poll(0.01))
            return frames

        count_frames(0.5)
        # SCB0 and SCB1 are the serial blocks of the I2C bus and of the UART.
        before = {name: world.read_handler_costs(0)[name].own for name in ("SCB0", "SCB1")}
        begin = _read_cycle_counts(world, 0)
        frames = count_frames(FRAMES_S)
        end = _read_cycle_counts(world, 0)
        after = {name: world.read_handler_costs(0)[name].own for name in ("SCB0", "SCB1")}
    bus, uart = ((after[name] - before[name]) / frames for name in ("SCB0", "SCB1"))
    awake, length = (end[1] - begin[1]) / frames, (end[0] - begin[0]) / frames
    return HubCycles(len(hand.boards), round(bus), round(awake - bus), round(uart), round(length))


def measure(images: Path) -> FirmwareCycles:
    """Count the processor cycles of every board kind of the default hand and of its hub.

    images: folder of the firmware images. Raises `TaxelError`, OSError.
    """
    hand = load_hand("original")
    kinds = {board.kind.name: board for board in hand.boards}
    ordered = sorted(kinds.values(), key=lambda board: board.kind.taxel_count)
    boards = tuple(measure_board(hand, board, images / BOARD_IMAGE) for board in ordered)
    return FirmwareCycles(boards, measure_hub(hand, images / HUB_IMAGE))
