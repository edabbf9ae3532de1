"""Watchdog and fault record in executed images: missed conversion interrupt, HardFault of a board and of the hub."""

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from taxel.hand import load_hand
from taxel.hand.world import WorldSettings, format_world
from taxel.link.virtual import VirtualMemoryLink, VirtualWorld
from taxel.stream import HubClient
from taxel.stream.fault_record import REGISTER_SIZE, FaultRecord, parse_fault_register
from taxel_protocol.bootloader import LAYOUTS, BootDevice
from taxel_protocol.layout import get_packer, unpack
from taxel_protocol.limits import REGISTER_FAULT, REGISTER_IDENTITY, REGISTER_STATUS
from taxel_protocol.names import BoardErrorFlag, FaultCode, ResetCause
from taxel_protocol.registers import Identity, Status

HAND = load_hand("rig4")
ADDRESS = HAND.boards[0].address
WATCHDOG_MAX_S = 65536 / 15000.0
"""Longest period of the watchdog: the 32 kHz oscillator has at least 15 kHz (docs/psoc4200.md)."""
STALL_S = 0.5
START_S = 0.4

OpenWorld = Callable[..., VirtualWorld]


@pytest.fixture(params=["native", "executed"])
def open_world(request, build_folder: Path) -> Iterator[OpenWorld]:
    """Opens a world whose boards, and whose hub with `hub=True`, run natively or execute their images."""
    worlds = []

    def build(hub: bool = False) -> VirtualWorld:
        """Create a world, without hub unless `hub` is True, and let its boards start."""
        text = format_world(HAND, WorldSettings(noise_counts=0.0, clock_spread_ppm=0.0))
        files = {}
        if request.param == "executed":
            files = {f"{name}.hex": build_folder / "images" / f"{name}-factory.hex" for name in ("board", "hub")}
            text += f"image 0x{ADDRESS:02X} board.hex\n" + ("hub_image hub.hex\n" if hub else "")
        world = VirtualWorld(text, "memory" if hub else "none", files=files)
        worlds.append(world)
        if not hub:
            world.inject("hub_unplug")
        world.run(START_S)
        return world

    yield build
    for world in worlds:
        world.close()


def read_register(world: VirtualWorld, pointer: int, size: int) -> bytes:
    """Read `size` bytes of the board's registers from the address `pointer` on."""
    result, data = world.transfer(ADDRESS, bytes([pointer]), size)
    assert result == 0
    return data


def read_status(world: VirtualWorld) -> dict[str, int]:
    return unpack(Status, read_register(world, REGISTER_STATUS, get_packer(Status).size))[0]


def read_fault(world: VirtualWorld) -> FaultRecord | None:
    return parse_fault_register(ADDRESS, read_register(world, REGISTER_FAULT, REGISTER_SIZE))


def test_a_board_without_a_fault_has_an_empty_record(open_world):
    world = open_world()
    identity = unpack(Identity, read_register(world, REGISTER_IDENTITY, get_packer(Identity).size))[0]
    assert (identity["map_version"], identity["map_revision"]) == (2, 1)
    assert read_fault(world) is None
    world.run(2 * WATCHDOG_MAX_S)
    status = read_status(world)
    assert (status["reset_cause"], status["error_flags"]) == (ResetCause.POWER_ON, 0), "the scan feeds the watchdog"


def test_a_missed_conversion_interrupt_is_reported_and_ends_in_a_reset_by_the_watchdog(open_world):
    world = open_world()
    world.inject("miss_conversion", ADDRESS)
    world.run(STALL_S + 0.02)
    status = read_status(world)
    assert status["error_flags"] == BoardErrorFlag.NOT_SCANNING, "reported before the reset"
    world.run(WATCHDOG_MAX_S)
    status = read_status(world)
    assert status["reset_cause"] == ResetCause.WATCHDOG
    assert status["scans"] > 0, "the board scans again"
    # no exception, one fault, no registers of interrupted code
    assert read_fault(world) == FaultRecord(FaultCode.NOT_SCANNING, 0, 1, 0, 0)


def test_a_hard_fault_preserves_pc_and_lr_over_the_reset(open_world):
    world = open_world()
    world.inject("hard_fault", ADDRESS, 0x1234, 0x1235)
    world.run(WATCHDOG_MAX_S + START_S)
    assert read_status(world)["reset_cause"] == ResetCause.WATCHDOG
    fault = read_fault(world)
    assert fault is not None
    assert (fault.code, fault.exception, fault.count) == (FaultCode.EXCEPTION, 3, 1)  # exception 3: HardFault
    begin = LAYOUTS[BootDevice.BOARD].slot_address(0)
    if (fault.program_counter, fault.link_register) != (0x1234, 0x1235):  # an executed image stores its own registers
        end = begin + LAYOUTS[BootDevice.BOARD].slot_size
        assert begin < fault.program_counter < end
        assert begin < fault.link_register < end
    assert "HardFault at PC 0x0000" in fault.describe()


def test_faults_are_counted_until_the_power_is_lost(open_world):
    world = open_world()
    for _ in range(2):
        world.inject("hard_fault", ADDRESS)
        world.run(WATCHDOG_MAX_S + START_S)
    world.inject("miss_conversion", ADDRESS)
    world.run(WATCHDOG_MAX_S + START_S)
    fault = read_fault(world)
    assert fault is not None
    assert (fault.code, fault.count) == (FaultCode.NOT_SCANNING, 3)
    world.inject("unplug", ADDRESS)
    world.run(0.1)
    world.inject("plug", ADDRESS)
    world.run(START_S)
    assert read_fault(world) is None


def test_the_hub_reports_its_own_fault_and_the_fault_of_a_board(open_world):
    world = open_world(hub=True)
    link = VirtualMemoryLink(world)
    hub = HubClient(link)
    hub.handshake()
    hub.read_boards()
    assert (hub.read_fault(), hub.read_board_fault(ADDRESS)) == (None, None)
    world.inject("hard_fault", ADDRESS, 0x1234, 0x1235)
    hub.wait(WATCHDOG_MAX_S + 1.0)
    board_fault = hub.read_board_fault(ADDRESS)
    assert board_fault is not None
    assert board_fault.exception == 3  # HardFault
    world.inject("hub_hard_fault", 0, 0x4321, 0x4323)
    hub.wait(WATCHDOG_MAX_S + 1.0)
    hub.handshake()
    assert hub.last_handshake is not None
    assert hub.last_handshake["reset_cause"] == ResetCause.WATCHDOG
    fault = hub.read_fault()
    assert fault is not None
    assert (fault.code, fault.exception, fault.count) == (FaultCode.EXCEPTION, 3, 1)
    assert fault.program_counter > LAYOUTS[BootDevice.HUB].slot_address(0)
