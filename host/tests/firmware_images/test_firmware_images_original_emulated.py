"""Images of the original boards and of the original hub on the emulated part, with the wiring of the original."""

import re
import struct
import tomllib
from pathlib import Path

import numpy as np
import pytest

from host.tests.firmware_images.conftest import PORT, ROOT
from host.tests.firmware_images.test_firmware_images_original import KINDS, LINES_MAX, read_pins
from taxel.hand import Board, BoardKind, Hand, load_hand
from taxel.hand.world import ScanSettings, WorldSettings, format_world
from taxel.link.errors import LinkError
from taxel.link.virtual import VirtualMemoryLink, VirtualWorld
from taxel.skin import Skin
from taxel_protocol import SNAPSHOT_OVERHEAD
from taxel_protocol.framing import crc32
from taxel_protocol.limits import REGISTER_SNAPSHOT

STACK_BYTES = 704
"""Reserve of the stack of a sensor image (CMakeLists.txt of the port)."""

FORCE_N = 3.0


def make_hand(kinds: tuple[str, ...]) -> Hand:
    """Create a hand with one board of each kind, at its address in the pins file.

    The kinds have the rows of the register map.
    """
    described = {board.kind.name: board.kind for board in load_hand("first_generation").boards}
    boards = []
    for name in kinds:
        count = described[name].taxel_count
        rows = -(-count // LINES_MAX)
        columns = -(-count // rows)
        crossings = (np.arange(rows * columns) < count).reshape(rows, columns)
        kind = BoardKind(name, described[name].code, crossings)
        boards.append(Board(name=name, address=read_pins(name)["address"], kind=kind))
    return Hand("original boards", "", 0.005, 0.003, tuple(boards))


def read_scan_settings(kind: str) -> ScanSettings:
    """Read the scan settings from the pins file of an original board."""
    return ScanSettings(**tomllib.loads((PORT / "original" / f"{kind}.toml").read_text())["scan"])


def format_board_world(kind: str, part: str | None, image: str = "board.hex") -> str:
    """Format the world file of one board. part: part that executes `image`; None: natively compiled firmware."""
    settings = WorldSettings(noise_counts=0.0, clock_spread_ppm=0.0, scan=read_scan_settings(kind))
    hand = make_hand((kind,))
    line = f"image 0x{hand.boards[0].address:02X} {image} {part}\n" if part else ""
    return format_world(hand, settings) + line


def read_counts(world: VirtualWorld, kind: str) -> list[int]:
    """Read the raw counts of a snapshot of the board, read over I2C without a hub; its CRC is checked."""
    board = make_hand((kind,)).boards[0]
    world.inject("hub_unplug")
    world.run(0.5)
    world.transfer(board.address, bytes([REGISTER_SNAPSHOT]), 0)
    code, data = world.transfer(board.address, b"", SNAPSHOT_OVERHEAD + 2 * board.kind.taxel_count)
    assert code == 0
    assert int.from_bytes(data[-4:], "little") == crc32(bytes([board.address]) + data[:-4])
    return list(struct.unpack(f"<{board.kind.taxel_count}H", data[6:-4]))


def press_taxels(world: VirtualWorld, count: int) -> None:
    """Apply a different force to each of `count` taxels, from 0 to `FORCE_N`."""
    world.set_stimulus(np.linspace(0.0, FORCE_N, count))


@pytest.mark.parametrize("kind", KINDS)
def test_an_executed_board_measures_the_counts_of_a_native_board(build_folder, kind):
    files = {"board.hex": build_folder / "images" / "original" / f"{kind}.hex"}
    count = len(read_pins(kind)["rx"])
    with VirtualWorld(format_board_world(kind, None), "none") as world:
        press_taxels(world, count)
        native = read_counts(world, kind)
    with VirtualWorld(format_board_world(kind, f"original-{kind}"), "none", files=files) as world:
        press_taxels(world, count)
        executed = read_counts(world, kind)
        processor = world.read_processor(read_pins(kind)["address"])
    assert executed == native
    assert len(set(native)) > count // 2, "the forces differ"
    assert not processor.is_broken
    assert processor.faults == 0
    assert processor.is_application
    assert 0 < processor.stack <= STACK_BYTES


def test_an_image_of_another_kind_reads_full_scale_because_its_capacitors_are_on_other_pins(build_folder):
    """The image of FingerSmall (6 taxels) runs on a part that is wired as FingerBig; the full scale is 4000 counts."""
    files = {"board.hex": build_folder / "images" / "original" / "finger_small.hex"}
    text = format_board_world("finger_small", "original-finger_big")
    with VirtualWorld(text, "none", files=files) as world:
        assert read_counts(world, "finger_small") == [4000] * 6


def test_the_original_hub_reads_original_boards(build_folder):
    """The bus of the hub is on SCB1 and P3, its UART on SCB0 and P4; the boards answer at 100 kbit/s."""
    folder = build_folder / "images" / "original"
    hand = make_hand(KINDS)
    text = format_world(hand, WorldSettings(noise_counts=0.0, clock_spread_ppm=0.0, scl_hz=100e3))
    text += "hub_image hub.hex original-hub\n"
    text += "".join(f"image 0x{board.address:02X} {board.name}.hex original-{board.name}\n" for board in hand.boards)
    files = {f"{name}.hex": folder / f"{name}.hex" for name in (*KINDS, "hub")}
    with VirtualWorld(text, files=files) as world, Skin(VirtualMemoryLink(world), hand) as skin:
        end_s = world.now_s + 2.0
        frames = []
        while world.now_s < end_s:
            frames += skin.poll(0.01)
        processors = [world.read_processor(address) for address in (0, *(board.address for board in hand.boards))]
        assert not skin.hub.faults
    assert {frame.address for frame in frames[-10:]} == {board.address for board in hand.boards}
    assert all(not processor.is_broken and processor.faults == 0 for processor in processors)
    assert all(processor.is_application for processor in processors)


def test_wiring_of_the_emulated_parts_equals_the_pins_of_the_original_boards():
    text = (ROOT / "firmware" / "emulator" / "psoc4" / "parts.c").read_text()
    for kind in KINDS:
        pins = read_pins(kind)
        part = text.split(f'"original-{kind}"')[1].split(".name")[0]
        for field, names in (("tx", pins["tx"]), ("rx", pins["rx"]), ("capacitors", [pins["cint_a"], pins["cint_b"]])):
            numbers = re.search(rf"\.{field} =\s*\{{([^}}]*)\}}", part)
            assert numbers is not None
            found = [int(number, 16) for number in numbers[1].split(",") if number.strip()]
            assert found == [int(name[1]) << 4 | int(name[3]) for name in names]


@pytest.mark.parametrize(
    ("part", "image", "message"),
    [("original-thumb", "palm.hex", "unknown part"), ("original-palm", "large.hex", "outside the flash")],
)
def test_a_wrong_part_or_an_image_beyond_its_flash_is_rejected_with_one_line(
    build_folder, tmp_path, part, image, message
):
    large = tmp_path / "large.hex"
    large.write_text(":0140000000BF\n:00000001FF\n")  # one byte at 16 KiB
    files = {"palm.hex": Path(build_folder / "images" / "original" / "palm.hex"), "large.hex": large}
    with (
        pytest.raises(LinkError, match=message),
        VirtualWorld(format_board_world("palm", part, image), "none", files=files),
    ):
        pass
