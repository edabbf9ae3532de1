"""World files whose boards execute the images of `make firmware`, and these images under other versions."""

import random
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Final

from taxel.hand import Hand
from taxel.hand.boards import Board
from taxel.hand.world import WorldSettings, format_world
from taxel.link.virtual import VirtualWorld
from taxel_protocol.bootloader import BOOT_ROW_SIZE
from taxel_protocol.bootloader_images import build_image
from taxel_tools.files import Firmware
from taxel_tools.files.firmware import HEADER_SIZE, parse_image

IMAGES: Final = Path(__file__).parents[2] / "build" / "psoc4200" / "images"
BOARD_IMAGE: Final = "board-factory.hex"
HUB_IMAGE: Final = "hub-factory.hex"


def find_image_files(images: Path = IMAGES) -> dict[str, Path]:
    """Return the paths of the factory images of board and hub, by the names that the world files use."""
    return {name: images / name for name in (BOARD_IMAGE, HUB_IMAGE)}


def format_image_line(address: int) -> str:
    """Return the world-file line that makes a board, or the hub (address 0), execute its firmware image."""
    return f"image 0x{address:02X} {BOARD_IMAGE}\n" if address else f"hub_image {HUB_IMAGE}\n"


def make_board_world(hand: Hand, address: int, settings: WorldSettings | None = None) -> str:
    """Return the text of a world file with only the board at `address`, without branches of the bus.

    The board runs natively unless a line of `format_image_line` is appended.
    """
    lines = format_world(hand, settings).splitlines()
    of_boards, of_all = ("board ", "surface ", "margin "), ("wiring ", "branch ")  # a branch lists several boards
    lines_of_board = [
        line
        for line in lines
        if not line.startswith(of_all) and (not line.startswith(of_boards) or f" 0x{address:02X} " in line)
    ]
    return "\n".join(lines_of_board) + "\n"


@contextmanager
def open_scanning_world(hand: Hand, board: Board, image: Path) -> Iterator[VirtualWorld]:
    """Open an emulated world in which a board executes its firmware image and scans its taxels.

    No hub reads the board. The scans have started when the world is yielded.
    """
    text = make_board_world(hand, board.address, WorldSettings(clock_spread_ppm=0.0)) + format_image_line(board.address)
    with VirtualWorld(text, "none", files={BOARD_IMAGE: image}) as world:
        world.inject("hub_unplug")
        world.run(0.35)
        yield world


def make_firmware(version: tuple[int, int, int], images: Path = IMAGES, *, rows: int = 0) -> Firmware:
    """Create the images of both slots of a board from the built images, with the version replaced by `version`.

    rows: number of flash rows with version-dependent bytes after the program, so that an update has rows to write.
    """
    images_of_slots = []
    for slot, name in enumerate("ab"):
        built = parse_image((images / f"board-{name}.bin").read_bytes(), f"board-{name}.bin")
        content = built.data[HEADER_SIZE:]
        content += random.Random(f"{version} {slot}").randbytes(rows * BOOT_ROW_SIZE)
        images_of_slots.append(
            parse_image(build_image(built.device, slot, 0, version, content), f"board-{name} {version}")
        )
    return Firmware(tuple(images_of_slots))
