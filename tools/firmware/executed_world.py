"""Worlds with boards that execute the images of `make firmware`, and those images under other versions."""

from __future__ import annotations

import random
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Final

from taxel.hand import Hand
from taxel.hand.description import Board
from taxel.hand.world import WorldSettings, format_world
from taxel.link.virtual import VirtualWorld
from taxel_protocol.bootloader import BOOT_ROW_SIZE, BootDevice, image
from taxel_tools.files import Firmware
from taxel_tools.files.firmware import HEADER_SIZE, parse_image

IMAGES: Final = Path(__file__).parents[2] / "build" / "psoc4200" / "images"
BOARD_IMAGE: Final = "board-factory.hex"
HUB_IMAGE: Final = "hub-factory.hex"


def files(images: Path = IMAGES) -> dict[str, Path]:
    """The factory's images by the names that world files here have for them."""
    return {name: images / name for name in (BOARD_IMAGE, HUB_IMAGE)}


def image_line(address: int) -> str:
    """The line of a world file that makes a board, or the hub (0), execute its image."""
    return f"image 0x{address:02X} {BOARD_IMAGE}\n" if address else f"hub_image {HUB_IMAGE}\n"


def lone_board(hand: Hand, address: int, settings: WorldSettings | None = None) -> str:
    """The world file of that board alone; it is not executed yet."""
    lines = format_world(hand, settings).splitlines()
    kept = [line for line in lines if not line.startswith("board ") or f" 0x{address:02X} " in line]
    return "\n".join(kept) + "\n"


@contextmanager
def scanning(hand: Hand, board: Board, image: Path) -> Iterator[VirtualWorld]:
    """A world in which that board scans, and nobody asks it anything."""
    text = lone_board(hand, board.address, WorldSettings(clock_spread_ppm=0.0)) + image_line(board.address)
    with VirtualWorld(text, "none", files={BOARD_IMAGE: image}) as world:
        world.inject("hub_unplug")
        world.run(0.35)
        yield world


def firmware_with(version: tuple[int, int, int], images: Path = IMAGES, *, rows: int = 0) -> Firmware:
    """The board's images of both slots, under another version; behind the program are `rows` flash rows of other bytes
    for each version, so that there is something to write.
    """
    made = []
    for slot, name in enumerate("ab"):
        content = (images / f"board-{name}.bin").read_bytes()[HEADER_SIZE:]
        content += random.Random(f"{version} {slot}").randbytes(rows * BOOT_ROW_SIZE)
        made.append(parse_image(image(BootDevice.BOARD, slot, 0, version, content), f"board-{name} {version}"))
    return Firmware(tuple(made))
