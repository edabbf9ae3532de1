"""Firmware images executed as ARM code.

The processor of an executed board runs the image of the board; a native board runs the same firmware compiled for the
PC.

Counts equal those of native boards, snapshots are consistent at any instant, and a power cut leaves a working program.
"""

import json
import struct
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from hil_tests.harness.parts import PARTS
from hil_tests.harness.virtual.images import PORTS, ROOT, build_images, find_missing_tool
from taxel.hand import Hand, load_hand
from taxel.hand.boards import Board
from taxel.hand.world import WorldSettings, format_world
from taxel.link.virtual import VirtualMemoryLink, VirtualSMBus, VirtualWorld
from taxel.skin import Skin
from taxel.version import VERSION
from taxel_protocol import SNAPSHOT_OVERHEAD
from taxel_protocol.limits import REGISTER_SNAPSHOT, REGISTER_STATUS
from taxel_protocol.registers import Status
from taxel_tools.errors import BoardError

pytestmark = pytest.mark.skipif(
    find_missing_tool() is not None, reason=f"the build of the images needs {find_missing_tool()}"
)

ADDRESS, PROXIMAL, MEDIAL = 0x1D, 0x19, 0x0E
MAX_TIME_DIFFERENCE_US = 100
"""Largest difference of the scan times of an executed board and a native board, microseconds: 3 parts in 100,000 of the
3.4 s that a test takes, less than the tolerance of the scan period.
"""
READS = 40


@pytest.fixture(params=sorted(PARTS))
def part(request: pytest.FixtureRequest) -> str:
    """Microcontroller whose images are executed."""
    return str(request.param)


def read_stack_limit(address: int, part: str = "psoc4200") -> int:
    """Return the largest stack in bytes that an image and its bootloader can use, as `make size` computed it.

    address: I2C address of a board; 0: the hub. part: microcontroller.
    """
    sizes = json.loads((PORTS / part / "size.json").read_text())["images"]
    names = ("board-a", "board-b", "bootloader-board") if address else ("hub-a", "hub-b", "bootloader-hub")
    return max(int(sizes[name]["stack"]) for name in names)


@pytest.fixture(scope="module")
def tools() -> Iterator[None]:
    """Make the modules of tools/firmware and tools/flash importable."""
    folders = [str(ROOT / "tools" / name) for name in ("firmware", "flash")]
    sys.path[:0] = folders
    yield
    for folder in folders:
        sys.path.remove(folder)


@pytest.fixture(scope="module")
def hand() -> Hand:
    return load_hand("original")


def find_image_files(part: str = "psoc4200") -> dict[str, Path]:
    return {name: build_images(part) / name for name in ("board-factory.hex", "hub-factory.hex")}


def format_image_lines(*addresses: int) -> str:
    """Format the lines of a world file that execute the images of these boards; address 0 is the hub."""
    return "".join(
        f"image 0x{address:02X} board-factory.hex\n" if address else "hub_image hub-factory.hex\n"
        for address in addresses
    )


def read_snapshot(world: VirtualWorld, board: Board) -> tuple[int, int, bytes]:
    """Read a snapshot of a board over I2C.

    Returns a tuple of scan number, start of the scan on the board's clock in microseconds, and bytes of the raw counts.
    """
    code, data = world.transfer(board.address, b"", SNAPSHOT_OVERHEAD + 2 * board.kind.taxel_count)
    assert code == 0
    return (*struct.unpack_from("<HI", data), data[6:-4])


def read_random_snapshots(world: VirtualWorld, board: Board, forces: np.ndarray) -> list[tuple[int, int, bytes]]:
    """Read `READS` snapshots of a board without a hub, at random instants that are fixed on the board's clock.

    forces: force on each taxel of the hand, N. Returns the snapshots as `read_snapshot` does.
    """
    world.inject("hub_unplug")
    world.set_stimulus(forces)
    world.run(0.3)
    request_s = world.now_s
    status = Status.parse(world.transfer(board.address, bytes([REGISTER_STATUS]), Status.sizeof())[1])
    clock_start_s = request_s - 1e-6 * status["clock_us"]
    world.transfer(board.address, bytes([REGISTER_SNAPSHOT]), 0)
    early = read_snapshot(world, board)
    world.run(1.0)
    late = read_snapshot(world, board)
    scan_s = 1e-6 * (late[1] - early[1]) / (late[0] - early[0])
    first_scan_s = 1e-6 * late[1] - scan_s * late[0]
    found_snapshots = []
    generator = np.random.default_rng(9)
    scans = int(1.6 / scan_s) + np.cumsum(generator.integers(1, 1 + int(0.09 / scan_s), READS))
    instants_s = first_scan_s + scan_s * (scans + generator.uniform(0.1, 0.9, READS))  # not near the end of a scan
    for instant_s in instants_s:
        world.run(clock_start_s + instant_s - world.now_s)
        found_snapshots.append(read_snapshot(world, board))
    return found_snapshots


def check_processors(world: VirtualWorld, *addresses: int, part: str = "psoc4200") -> None:
    """Check that the processors at the addresses run the application without a fault and within their stack limits."""
    for address in addresses:
        processor = world.read_processor(address)
        assert not processor.is_broken
        assert processor.faults == 0, processor.fault
        assert processor.is_application
        assert 0 < processor.stack <= read_stack_limit(address, part)


@pytest.mark.parametrize(
    ("case", "address"),
    [("at rest", ADDRESS), ("pressed", ADDRESS), ("noisy", ADDRESS), ("pressed", PROXIMAL), ("noisy", MEDIAL)],
)
def test_executed_board_measures_the_counts_of_a_native_board(hand: Hand, case: str, address: int) -> None:
    """The executed board runs the ARM code of its image; the native board runs the same firmware compiled for the PC.

    Snapshots (scan number, time of the scan in microseconds, counts) are read at the same instants of the board's
    clock: scan numbers and counts are equal, and scan times differ by less than `MAX_TIME_DIFFERENCE_US`.
    """
    board = hand.get_board(address)
    settings = WorldSettings(seed=5, noise_counts=4.0 if case == "noisy" else 0.0, clock_spread_ppm=0.0)
    forces = np.random.default_rng(3).uniform(0.0, 4.0, hand.n_taxels) * (case != "at rest")
    with VirtualWorld(format_world(hand, settings), "none") as world:
        native = read_random_snapshots(world, board, forces)
    text = format_world(hand, settings) + format_image_lines(address)
    with VirtualWorld(text, "none", files=find_image_files()) as world:
        executed = read_random_snapshots(world, board, forces)
        check_processors(world, address)
    assert native[-1][1] > 3.5e6  # several seconds
    for native_snapshot, executed_snapshot in zip(native, executed, strict=True):
        assert native_snapshot[0] == executed_snapshot[0]
        assert native_snapshot[2] == executed_snapshot[2]
        assert abs(native_snapshot[1] - executed_snapshot[1]) < MAX_TIME_DIFFERENCE_US


def test_board_with_a_psoc_4100s_measures_the_counts_of_a_native_board(hand: Hand) -> None:
    """Without noise, a board that executes the image for a PSoC 4100S has the counts of the natively compiled firmware.

    A scan of the PSoC 4100S takes longer, because its converter charges the capacitors first.
    """
    board = hand.get_board(ADDRESS)
    settings = WorldSettings(noise_counts=0.0, clock_spread_ppm=0.0)
    forces = np.random.default_rng(3).uniform(0.0, 4.0, hand.n_taxels)
    counts = []
    for lines, part in (("", "psoc4200"), (format_image_lines(ADDRESS), "psoc4100s")):
        with VirtualWorld(format_world(hand, settings) + lines, "none", files=find_image_files(part)) as world:
            world.inject("hub_unplug")
            world.set_stimulus(forces)
            world.run(1.0)
            world.transfer(board.address, bytes([REGISTER_SNAPSHOT]), 0)
            counts.append(read_snapshot(world, board)[2])
    assert counts[0] == counts[1]


def test_executed_board_has_the_scan_period_of_a_native_board(hand: Hand) -> None:
    """On each of the 17 boards, which have different crossings, the two periods agree to 5 parts in 100,000.

    An executed board runs the ARM code of its image, a native board the same firmware compiled for the PC. The period
    of a board follows from two of its snapshot headers (scan number, board time in microseconds), which are read a
    second apart.
    """
    periods = []
    for lines in ("", format_image_lines(*(board.address for board in hand.boards))):
        world_file = format_world(hand, WorldSettings(noise_counts=0.0)) + lines
        with VirtualWorld(world_file, "none", files=find_image_files()) as world:
            world.inject("hub_unplug")  # the test itself reads the boards
            world.run(0.3)
            bus = VirtualSMBus(world)
            ends = []
            for _ in range(2):
                for board in hand.boards:
                    bus.write_byte(board.address, 0x80)
                    data = bus.read_i2c_block_data(board.address, 0x80, 6)
                    ends.append((int.from_bytes(bytes(data[:2]), "little"), int.from_bytes(bytes(data[2:]), "little")))
                world.run(1.0)
            scans, clock_us = np.diff(np.reshape(ends, (2, len(hand.boards), 2)), axis=0)[0].T
            periods.append(clock_us / scans)
    assert np.array(periods[1]) == pytest.approx(np.array(periods[0]), rel=5e-5)


def test_executed_hub_streams_frames_of_executed_boards(hand: Hand, part: str) -> None:
    """Hub (address 0 of the image lines) and boards run the ARM code of their images; all boards are in the stream."""
    addresses = [board.address for board in hand.boards]
    text = format_world(hand, WorldSettings(noise_counts=0.0)) + format_image_lines(0, *addresses)
    with VirtualWorld(text, files=find_image_files(part)) as world, Skin(VirtualMemoryLink(world), hand) as skin:
        end_s = world.now_s + 3.0
        frames = []
        while world.now_s < end_s:
            frames += skin.poll(0.01)
        # The last 40 frames are more than two poll cycles of the 17 boards.
        assert {frame.address for frame in frames[-40:]} == {board.address for board in hand.boards}
        check_processors(world, 0, ADDRESS, part=part)
        assert not skin.hub.faults


def test_snapshot_read_at_any_instant_contains_one_scan(tools: None, part: str) -> None:
    """Reads 3000 snapshots of a board whose raw counts increase all the time; `error` names a mixture of two scans."""
    import random_snapshot_reads

    result = random_snapshot_reads.read_random_snapshots(3000, seed=7, images=build_images(part))
    assert result.error is None
    assert result.scans > 1000
    assert result.faults == 0
    assert 0 < result.stack <= read_stack_limit(ADDRESS, part)


def test_power_cut_during_a_flash_write_leaves_the_old_or_the_new_program(tools: None, part: str) -> None:
    """Updates with 20 power cuts in total; `failure` is the first cut after which neither of the two versions runs."""
    import executed_power_cuts

    result = executed_power_cuts.cut_updates(20, seed=11, images=build_images(part))
    assert result.failure is None
    assert result.cut_count >= 20


def test_board_runs_the_image_that_taxel_flash_programmed(tools: None, part: str) -> None:
    """Bootloader, image selection, trial and confirmation run as ARM code; the image also boots after a power cycle."""
    import cut_routes
    import executed_world
    import flash_worlds

    text = flash_worlds.make_small_world(2, ["boot_listens 1"]) + executed_world.format_image_line(cut_routes.BOARD)
    with VirtualWorld(text, files={"board-factory.hex": build_images(part) / "board-factory.hex"}) as world:
        world.run(0.4)
        route = cut_routes.BoardRoute(world, through_hub=True)
        assert route.version() == tuple(map(int, VERSION.split(".")))
        route.update(executed_world.make_firmware((2, 7, 1), build_images(part)))
        assert route.version() == (2, 7, 1)
        world.inject("unplug", cut_routes.BOARD)
        world.run(0.1)
        world.inject("plug", cut_routes.BOARD)
        world.run(0.3)
        assert route.version() == (2, 7, 1)
        assert world.read_processor(cut_routes.BOARD).faults == 0


def test_image_for_another_part_is_refused_before_any_write(tools: None) -> None:
    import cut_routes
    import executed_world
    import flash_worlds

    text = flash_worlds.make_small_world(2, ["boot_listens 1"]) + executed_world.format_image_line(cut_routes.BOARD)
    with VirtualWorld(text, files={"board-factory.hex": build_images("psoc4100s") / "board-factory.hex"}) as world:
        world.run(0.4)
        route = cut_routes.BoardRoute(world, through_hub=True)
        before = world.read_flash(cut_routes.BOARD).data
        with pytest.raises(BoardError, match=r"the device is a sensor board with 64 KiB of flash, but .* 32 KiB"):
            route.update(executed_world.make_firmware((2, 7, 1), build_images("psoc4200")))
        assert world.read_flash(cut_routes.BOARD).data == before


def test_wiring_of_the_emulator_equals_the_pins_of_the_port(part: str) -> None:
    """Compares a part of parts.c with pins.toml of its port."""
    pins = tomllib.loads((PORTS / part / "pins.toml").read_text())
    text = (ROOT / "firmware" / "emulator" / "psoc4" / "parts.c").read_text()
    name = {"psoc4200": "standard"}.get(part, part)
    wiring = text.split(f'"{name}"')[1].split(".name")[0]

    def read_numbers(name: str) -> list[int]:
        """Read the integers of the field `name` of the part."""
        return [
            int(item, 0)
            for item in wiring.split(f".{name} =")[1].split("{")[1].split("}")[0].split(",")
            if item.strip()
        ]

    def encode_pin(name: str) -> int:
        """Encode a pin such as P4.1 as the emulator does: port in the high half of a byte, number in the low half."""
        port, number = name.removeprefix("P").split(".")
        return int(port) << 4 | int(number)

    assert read_numbers("tx") == [encode_pin(name) for name in pins["sensor"]["tx"]]
    assert read_numbers("rx") == [encode_pin(name) for name in pins["sensor"]["rx"]]
    assert f".rts = 0x{encode_pin(pins['hub']['uart_rts']):02X}" in wiring


def test_invalid_image_file_is_rejected_with_a_one_line_message(hand: Hand, tmp_path: Path) -> None:
    from taxel.link.errors import LinkError

    path = tmp_path / "bad.hex"
    for content, expected in {
        ":0100000041BF\n:00000001FF\n": "checksum",
        ":01800000413E\n:00000001FF\n": "outside the flash",
        ":0100000041BE\n": "no end record",
        "no records\n": "Intel HEX",
    }.items():
        path.write_text(content)
        with pytest.raises(LinkError, match=expected) as caught:
            VirtualWorld(format_world(hand, WorldSettings()) + "image 0x1D bad.hex\n", files={"bad.hex": path})
        assert "\n" not in str(caught.value)
