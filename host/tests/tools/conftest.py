"""Fixtures for the tests of the board commands: worlds, bus connections, firmware images."""

import importlib
import random
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType

import pytest

from taxel.hand import load_hand
from taxel.hand.world import WorldSettings, format_world
from taxel.link.virtual import VirtualMemoryLink, VirtualSMBus, VirtualWorld
from taxel_protocol.bootloader import BootDevice
from taxel_protocol.bootloader_images import build_image
from taxel_tools.files import Firmware, FirmwareImage
from taxel_tools.files.firmware import parse_image
from taxel_tools.wires import BoardWire, HubWire, SmbusWire

HANG = bytes(8) + b"HANG"


TOOLS = Path(__file__).resolve().parents[3] / "tools"


@pytest.fixture
def import_tool(monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[[str, str], ModuleType]]:
    """Function that imports a module from a folder of tools/, and the modules beside it.

    The modules are removed after the test, because other folders contain modules of the same name; those of the
    installed package `taxel_tools` stay.
    """
    before = set(sys.modules)

    def import_module(folder: str, name: str) -> ModuleType:
        """Import the module `name` of tools/`folder`."""
        monkeypatch.syspath_prepend(str(TOOLS / folder))
        return importlib.import_module(name)

    yield import_module
    for name in set(sys.modules) - before:
        path = Path(getattr(sys.modules[name], "__file__", None) or "/")
        if path.is_relative_to(TOOLS) and not path.is_relative_to(TOOLS / "taxel_tools"):
            del sys.modules[name]


@pytest.fixture
def make_image() -> Callable[..., FirmwareImage]:
    """Factory of images with random content for one slot of a board; `size` is the size of the whole image."""

    def make(slot: int, version=(1, 2, 3), size=1000, kind=0, device=BootDevice.BOARD, content=None) -> FirmwareImage:
        """Create an image for a slot (0 or 1).

        size: bytes of the whole image. content: bytes behind the header; None for random bytes, which depend on slot
        and version.
        """
        random_bytes = random.Random(f"{slot} {version}").randbytes(size - 32)
        return parse_image(build_image(device, slot, kind, version, content or random_bytes), f"slot-{'ab'[slot]}.bin")

    return make


@pytest.fixture
def make_firmware(make_image) -> Callable[..., Firmware]:
    """Factory of images for both slots."""
    return lambda **options: Firmware((make_image(0, **options), make_image(1, **options)))


@pytest.fixture
def worlds() -> Iterator[Callable[..., VirtualWorld]]:
    """Factory of worlds of a hand, with additional lines of the world file, 0.3 s after power-up; closed at the end."""
    open_worlds: list[VirtualWorld] = []

    def make(*lines: str, hand: str = "rig4", boards: int | None = None, **settings) -> VirtualWorld:
        """Create a world of a hand and run it for 0.3 s.

        lines: additional lines of its world file. boards: number of boards that are kept; None for all. settings: of
        `WorldSettings`.
        """
        text = format_world(load_hand(hand), WorldSettings(**settings)).splitlines()
        board_lines = [i for i, line in enumerate(text) if line.startswith("board ")]
        removed_lines = set(board_lines[boards:]) if boards is not None else set()
        kept_lines = [line for i, line in enumerate(text) if i not in removed_lines]
        world = VirtualWorld("\n".join([*kept_lines, *lines]) + "\n")
        open_worlds.append(world)
        world.run(0.3)
        return world

    yield make
    for world in open_worlds:
        world.close()


def connect(world: VirtualWorld, kind: str) -> BoardWire:
    """Connect to the boards of a world, through the hub ("hub") or by an adapter on the same bus ("i2c")."""
    if kind == "hub":
        return HubWire(VirtualMemoryLink(world))
    return SmbusWire(VirtualSMBus(world), "virtual", lambda: world.now_s, world.run)


@pytest.fixture(params=["hub", "i2c"])
def open_wire(request) -> Callable[[VirtualWorld], BoardWire]:
    """Connection to a world; each test runs with both kinds."""
    return lambda world: connect(world, request.param)


@pytest.fixture
def adapter() -> Callable[[VirtualWorld], BoardWire]:
    """I2C adapter on the bus of a world."""
    return lambda world: connect(world, "i2c")


@pytest.fixture
def hub() -> Callable[[VirtualWorld], BoardWire]:
    """The hub's pass-through."""
    return lambda world: connect(world, "hub")
