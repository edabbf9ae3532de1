"""Emulated worlds and firmware of random content, small or large, for what measures and cuts updates."""

from __future__ import annotations

import random
from collections.abc import Sequence

from taxel.hand import load_hand
from taxel.hand.world import WorldSettings, world_text
from taxel_protocol.bootloader import BOOT_ROW_SIZE, BootDevice, image
from taxel_tools.files import Firmware
from taxel_tools.files.firmware import parse_image

HEADER = 32


def firmware_of(device: BootDevice, rows: int, version: tuple[int, int, int], seed: int) -> Firmware:
    """Images for both slots that fill `rows` flash rows, nearly; their bytes hang on seed, slot and version."""
    size = rows * BOOT_ROW_SIZE - 40
    images = []
    for slot in (0, 1):
        content = random.Random(f"{seed} {slot} {version}").randbytes(max(size, HEADER + 8) - HEADER)
        images.append(parse_image(image(device, slot, 0, version, content), f"{rows}-rows-{'ab'[slot]}"))
    return Firmware(tuple(images))


def small_world(boards: int, lines: Sequence[str] = (), seed: int = 1) -> str:
    """World file of the first boards of a rig, without noise and quick to boot, with further lines."""
    settings = WorldSettings(seed=seed, noise_counts=0.0, boot_ms=4.0, usb_latency_ms=1.0)
    text = world_text(load_hand("rig4"), settings).splitlines()
    places = [place for place, line in enumerate(text) if line.startswith("board ")]
    kept = [line for place, line in enumerate(text) if place not in places[boards:]]
    return "\n".join([*kept, *lines]) + "\n"


def unique_ids(world: str) -> dict[int, bytes]:
    """Of each board of a world file, by its address there."""
    words = [line.split() for line in world.splitlines() if line.startswith("board ")]
    return {int(one[1], 0): bytes.fromhex(one[7]) for one in words}


def full_hand(lines: Sequence[str] = (), **settings: float) -> str:
    """World file of the Allegro hand with its 17 boards, with further lines."""
    text = world_text(load_hand("allegro"), WorldSettings(**settings))  # type: ignore[arg-type]
    return text + "".join(f"{line}\n" for line in lines)
