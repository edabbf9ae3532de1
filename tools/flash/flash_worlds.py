"""Emulated worlds and random firmware images for measurements and power cuts of updates."""

import random
from collections.abc import Sequence

from taxel.hand import load_hand
from taxel.hand.world import WorldSettings, format_world
from taxel_protocol.bootloader import BOOT_ROW_SIZE, BootDevice
from taxel_protocol.bootloader_images import build_image
from taxel_tools.files import Firmware
from taxel_tools.files.firmware import parse_image

HEADER = 32
"""Size of an image's header, bytes."""

CONTENT_MIN = 8
"""Smallest content of an image, bytes: initial stack pointer and reset vector."""

UNUSED_BYTES = 40
"""Bytes of the last row that an image leaves unused (chosen): the host then has to pad this row."""


def make_firmware_images(device: BootDevice, rows: int, version: tuple[int, int, int], seed: int) -> Firmware:
    """Create the images for both slots of a device, which almost fill `rows` flash rows.

    Their content is random and depends on seed, slot and version.
    """
    size = rows * BOOT_ROW_SIZE - UNUSED_BYTES
    images = []
    for slot in (0, 1):
        content = random.Random(f"{seed} {slot} {version}").randbytes(max(size, HEADER + CONTENT_MIN) - HEADER)
        images.append(parse_image(build_image(device, slot, 0, version, content), f"{rows}-rows-{'ab'[slot]}"))
    return Firmware(tuple(images))


def make_small_world(boards: int, lines: Sequence[str] = (), seed: int = 1) -> str:
    """Return the text of a world file with the first boards of the hand rig4, without noise and with a short boot time.

    boards: number of boards. lines: additional lines of the world file.
    """
    settings = WorldSettings(seed=seed, noise_counts=0.0, boot_ms=4.0, usb_latency_ms=1.0)
    text = format_world(load_hand("rig4"), settings).splitlines()
    board_lines = [i for i, line in enumerate(text) if line.startswith("board ")]
    kept_lines = [line for i, line in enumerate(text) if i not in board_lines[boards:]]
    return "\n".join([*kept_lines, *lines]) + "\n"


def read_unique_ids(world: str) -> dict[int, bytes]:
    """Read the unique id of each board of a world file, by address."""
    boards = [line.split() for line in world.splitlines() if line.startswith("board ")]
    return {int(fields[1], 0): bytes.fromhex(fields[7]) for fields in boards}


def make_full_hand_world(lines: Sequence[str] = (), **settings: float) -> str:
    """Return the text of a world file of the default hand with its 17 boards, followed by `lines`."""
    text = format_world(load_hand("original"), WorldSettings(**settings))  # type: ignore[arg-type]
    return text + "".join(f"{line}\n" for line in lines)
