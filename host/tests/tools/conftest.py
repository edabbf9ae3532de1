"""What the tests of the board tools share: worlds, wires, images."""

from __future__ import annotations

import random
from collections.abc import Callable, Iterator

import pytest

from taxel.hand import load_hand
from taxel.hand.world import WorldSettings, world_text
from taxel.link.virtual import VirtualMemoryLink, VirtualSMBus, VirtualWorld
from taxel_protocol.bootloader import BootDevice, image
from taxel_tools.files import Firmware, FirmwareImage
from taxel_tools.files.firmware import parse_image
from taxel_tools.wires import BoardWire, HubWire, SmbusWire

HANG = bytes(8) + b"HANG"


@pytest.fixture
def make_image() -> Callable[..., FirmwareImage]:
    """An image of random content for a slot of a board; `size` is that of the whole image."""

    def make(slot: int, version=(1, 2, 3), size=1000, kind=0, device=BootDevice.BOARD, content=None) -> FirmwareImage:
        random_bytes = random.Random(f"{slot} {version}").randbytes(size - 32)
        return parse_image(image(device, slot, kind, version, content or random_bytes), f"slot-{'ab'[slot]}.bin")

    return make


@pytest.fixture
def make_firmware(make_image) -> Callable[..., Firmware]:
    """Images for both slots."""
    return lambda **options: Firmware((make_image(0, **options), make_image(1, **options)))


@pytest.fixture
def worlds() -> Iterator[Callable[..., VirtualWorld]]:
    """Worlds of a hand, with further lines of the world file; running since 0.3 s. Closed at the end."""
    opened: list[VirtualWorld] = []

    def make(*lines: str, hand: str = "rig4", boards: int | None = None, **settings) -> VirtualWorld:
        text = world_text(load_hand(hand), WorldSettings(**settings)).splitlines()
        places = [place for place, line in enumerate(text) if line.startswith("board ")]
        left_out = set(places[boards:]) if boards is not None else set()
        kept = [line for place, line in enumerate(text) if place not in left_out]
        world = VirtualWorld("\n".join([*kept, *lines]) + "\n")
        opened.append(world)
        world.run(0.3)
        return world

    yield make
    for world in opened:
        world.close()


def wire_of(world: VirtualWorld, kind: str) -> BoardWire:
    """The hub's pass-through, or an adapter on the same bus."""
    if kind == "hub":
        return HubWire(VirtualMemoryLink(world))
    return SmbusWire(VirtualSMBus(world), "virtual", lambda: world.now_s, world.run)


@pytest.fixture(params=["hub", "i2c"])
def open_wire(request) -> Callable[[VirtualWorld], BoardWire]:
    """A wire to a world: each test that takes it runs over both kinds."""
    return lambda world: wire_of(world, request.param)


@pytest.fixture
def adapter() -> Callable[[VirtualWorld], BoardWire]:
    """An I2C adapter on a world's bus."""
    return lambda world: wire_of(world, "i2c")


@pytest.fixture
def hub() -> Callable[[VirtualWorld], BoardWire]:
    """The hub's pass-through."""
    return lambda world: wire_of(world, "hub")
