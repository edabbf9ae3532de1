"""Executed images: counts of native boards, coherent snapshots at any instant, a program that works after any cut."""

import json
import struct
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from hil_tests.harness.virtual.images import PORT, ROOT, images, missing_tool
from taxel.hand import Hand, load_hand
from taxel.hand.description import Board
from taxel.hand.world import WorldSettings, format_world
from taxel.link.virtual import VirtualMemoryLink, VirtualSMBus, VirtualWorld
from taxel.skin import Skin
from taxel.version import VERSION
from taxel_protocol import SNAPSHOT_OVERHEAD
from taxel_protocol.limits import REGISTER_SNAPSHOT, REGISTER_STATUS
from taxel_protocol.registers import Status

pytestmark = pytest.mark.skipif(
    missing_tool() is not None, reason=f"the images need {missing_tool()}, which is not here"
)

ADDRESS, PROXIMAL, MEDIAL = 0x2C, 0x28, 0x30
AGREE_US = 50
READS = 40
FIRST_SCAN_S, SCAN_S = 391e-6, 4019e-6
"""Of the board above, on its own clock."""


def stack_of(address: int) -> int:
    """Worst case of an image and the bootloader before it, bytes, as `make size` has computed it."""
    images = json.loads((PORT / "size.json").read_text())["images"]
    names = ("board-a", "board-b", "bootloader-board") if address else ("hub-a", "hub-b", "bootloader-hub")
    return max(int(images[name]["stack"]) for name in names)


@pytest.fixture(scope="module")
def tools() -> Iterator[None]:
    """The modules of tools/firmware and tools/flash."""
    folders = [str(ROOT / "tools" / name) for name in ("firmware", "flash")]
    sys.path[:0] = folders
    yield
    for folder in folders:
        sys.path.remove(folder)


@pytest.fixture(scope="module")
def hand() -> Hand:
    return load_hand("allegro")


def files() -> dict[str, Path]:
    return {name: images() / name for name in ("board-factory.hex", "hub-factory.hex")}


def executed(*addresses: int) -> str:
    return "".join(
        f"image 0x{one:02X} board-factory.hex\n" if one else "hub_image hub-factory.hex\n" for one in addresses
    )


def one_snapshot(world: VirtualWorld, board: Board) -> tuple[int, int, bytes]:
    """(sequence, board's clock in us, counts)."""
    code, data = world.transfer(board.address, b"", SNAPSHOT_OVERHEAD + 2 * board.kind.taxel_count)
    assert code == 0
    return (*struct.unpack_from("<HI", data), data[6:-4])


def snapshots(world: VirtualWorld, board: Board, forces: np.ndarray) -> list[tuple[int, int, bytes]]:
    """Those of a board alone, read at random instants that hang on its own clock."""
    world.inject("hub_unplug")
    world.press(forces)
    world.run(0.3)
    asked_s = world.now_s
    status = Status.parse(world.transfer(board.address, bytes([REGISTER_STATUS]), Status.sizeof())[1])
    zero_s = asked_s - 1e-6 * status["clock_us"]
    world.transfer(board.address, bytes([REGISTER_SNAPSHOT]), 0)
    early = one_snapshot(world, board)
    world.run(1.0)
    late = one_snapshot(world, board)
    scan_s = 1e-6 * (late[1] - early[1]) / (late[0] - early[0])
    begin_s = 1e-6 * late[1] - scan_s * late[0]
    found = []
    generator = np.random.default_rng(9)
    scans = int(1.6 / scan_s) + np.cumsum(generator.integers(1, 1 + int(0.09 / scan_s), READS))
    instants = begin_s + scan_s * (scans + generator.uniform(0.1, 0.9, READS))  # not while a scan ends
    for instant_s in instants:
        world.run(zero_s + instant_s - world.now_s)
        found.append(one_snapshot(world, board))
    return found


def check_processors(world: VirtualWorld, *addresses: int) -> None:
    for address in addresses:
        processor = world.processor(address)
        assert not processor.is_broken
        assert processor.faults == 0, processor.fault
        assert processor.is_application
        assert 0 < processor.stack <= stack_of(address)


@pytest.mark.parametrize(
    ("case", "address"),
    [("at rest", ADDRESS), ("pressed", ADDRESS), ("noisy", ADDRESS), ("pressed", PROXIMAL), ("noisy", MEDIAL)],
)
def test_an_executed_board_shows_what_a_native_one_does(hand: Hand, case: str, address: int) -> None:
    """Read at the same instants of its clock: the same scans, begun at the same time, with the same counts."""
    board = hand.get_board(address)
    settings = WorldSettings(seed=5, noise_counts=4.0 if case == "noisy" else 0.0, clock_spread_ppm=0.0)
    forces = np.random.default_rng(3).uniform(0.0, 4.0, hand.n_taxels) * (case != "at rest")
    with VirtualWorld(format_world(hand, settings), "none") as world:
        native = snapshots(world, board, forces)
    with VirtualWorld(format_world(hand, settings) + executed(address), "none", files=files()) as world:
        found = snapshots(world, board, forces)
        check_processors(world, address)
    assert native[-1][1] > 3.5e6  # several seconds
    for own, other in zip(native, found, strict=True):
        assert own[0] == other[0]
        assert own[2] == other[2]
        assert abs(own[1] - other[1]) < AGREE_US


def test_an_executed_board_scans_as_often_as_a_native_one(hand: Hand) -> None:
    """All 17: the time of a scan to 5 in 100,000, whatever crossings a board has."""
    periods = []
    for lines in ("", executed(*(board.address for board in hand.boards))):
        world_file = format_world(hand, WorldSettings(noise_counts=0.0)) + lines
        with VirtualWorld(world_file, "none", files=files()) as world:
            world.inject("hub_unplug")
            world.run(0.3)
            wire = VirtualSMBus(world)
            ends = []
            for _ in range(2):
                for board in hand.boards:
                    wire.write_byte(board.address, 0x80)
                    data = wire.read_i2c_block_data(board.address, 0x80, 6)
                    ends.append((int.from_bytes(bytes(data[:2]), "little"), int.from_bytes(bytes(data[2:]), "little")))
                world.run(1.0)
            scans, clock_us = np.diff(np.reshape(ends, (2, len(hand.boards), 2)), axis=0)[0].T
            periods.append(clock_us / scans)
    assert np.array(periods[1]) == pytest.approx(np.array(periods[0]), rel=5e-5)


def test_an_executed_hub_streams_executed_boards(hand: Hand) -> None:
    text = format_world(hand, WorldSettings(noise_counts=0.0)) + executed(0, *(board.address for board in hand.boards))
    with VirtualWorld(text, files=files()) as world, Skin(VirtualMemoryLink(world), hand) as skin:
        end = world.now_s + 3.0
        frames = []
        while world.now_s < end:
            frames += skin.poll(0.01)
        assert {frame.address for frame in frames[-40:]} == {board.address for board in hand.boards}
        check_processors(world, 0, ADDRESS)
        assert not skin.hub.faults


def test_snapshots_read_at_any_instant_of_a_scan_are_of_one_time(tools: None) -> None:
    import random_snapshot_reads

    result = random_snapshot_reads.read_random_snapshots(3000, seed=7, images=images())
    assert result.error is None
    assert result.scans > 1000
    assert result.faults == 0
    assert 0 < result.stack <= stack_of(ADDRESS)


def test_power_cuts_in_any_write_leave_the_old_or_the_new_program(tools: None) -> None:
    import executed_power_cuts

    result = executed_power_cuts.cut_updates(20, seed=11, images=images())
    assert result.failure is None
    assert result.cut_count >= 20


def test_a_board_runs_the_image_that_taxel_flash_gave_it(tools: None) -> None:
    """Bootloader, image choice, trial and confirmation, all executed; it boots the image after a power cycle too."""
    import cut_routes
    import executed_world
    import flash_worlds

    text = flash_worlds.make_small_world(2, ["boot_listens 1"]) + executed_world.image_line(cut_routes.BOARD)
    with VirtualWorld(text, files={"board-factory.hex": images() / "board-factory.hex"}) as world:
        world.run(0.4)
        way = cut_routes.BoardRoute(world, through_hub=True)
        assert way.version() == tuple(map(int, VERSION.split(".")))
        way.update(executed_world.firmware_with((2, 7, 1), images()))
        assert way.version() == (2, 7, 1)
        world.inject("unplug", cut_routes.BOARD)
        world.run(0.1)
        world.inject("plug", cut_routes.BOARD)
        world.run(0.3)
        assert way.version() == (2, 7, 1)
        assert world.processor(cut_routes.BOARD).faults == 0


def test_the_emulator_is_wired_as_the_boards_are() -> None:
    """psoc4200/wiring.h against the pins of the port."""
    pins = tomllib.loads((PORT / "pins.toml").read_text())
    text = (ROOT / "firmware" / "emulator" / "psoc4200" / "wiring.h").read_text()

    def numbers(name: str) -> list[int]:
        return [
            int(word, 0) for word in text.split(f"{name}[")[1].split("{")[1].split("}")[0].split(",") if word.strip()
        ]

    def pin(name: str) -> int:
        port, number = name.removeprefix("P").split(".")
        return int(port) << 4 | int(number)

    assert numbers("wiring_tx") == [pin(name) for name in pins["sensor"]["tx"]]
    assert numbers("wiring_rx") == [pin(name) for name in pins["sensor"]["rx"]]
    assert f"WIRING_RTS 0x{pin(pins['hub']['uart_rts']):02X}u" in text


def test_an_image_that_cannot_be_read_is_refused_in_one_line(hand: Hand, tmp_path: Path) -> None:
    from taxel.link.errors import LinkError

    path = tmp_path / "bad.hex"
    for content, expected in {
        ":0100000041BF\n:00000001FF\n": "checksum",
        ":01800000413E\n:00000001FF\n": "outside the flash",
        ":0100000041BE\n": "no end record",
        "hello\n": "Intel HEX",
    }.items():
        path.write_text(content)
        with pytest.raises(LinkError, match=expected) as caught:
            VirtualWorld(format_world(hand, WorldSettings()) + "image 0x2C bad.hex\n", files={"bad.hex": path})
        assert "\n" not in str(caught.value)
