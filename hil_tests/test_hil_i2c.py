"""Boards accessed by an I2C adapter on their bus, with the calls of smbus2."""

import errno
import itertools

import pytest
from smbus2 import i2c_msg

from hil_tests.harness.frame_checks import get_address, read_frames
from hil_tests.harness.rig import Rig
from taxel.skin import Skin
from taxel_protocol import SNAPSHOT_OVERHEAD, crc32
from taxel_protocol.limits import (
    REGISTER_COMMAND,
    REGISTER_IDENTITY,
    REGISTER_SETTINGS,
    REGISTER_SNAPSHOT,
    REGISTER_STATUS,
    SMBUS_BLOCK,
)
from taxel_protocol.names import BoardCommand, ResetCause
from taxel_protocol.registers import Identity, SettingsRegister, Status, snapshot

pytestmark = pytest.mark.needs("i2c")
BOOTED_S = 0.2


@pytest.fixture
def bus(rig: Rig):
    """The I2C adapter, after all boards have booted."""
    rig.clock.wait(BOOTED_S)
    return rig.i2c


def read_register(bus, address: int, register: int, size: int) -> bytes:
    """Read `size` bytes of a register of the board at `address`, by a write and a read with a repeated start."""
    message = i2c_msg.read(address, size)
    bus.i2c_rdwr(i2c_msg.write(address, [register]), message)
    return bytes(message)


def write_register(bus, address: int, register: int, data: bytes) -> None:
    """Write bytes to a register of the board at `address`."""
    bus.i2c_rdwr(i2c_msg.write(address, bytes([register]) + data))


def read_status(bus, address: int) -> dict:
    """Read the status register of the board at `address` as a dictionary of its fields."""
    return dict(Status.parse(read_register(bus, address, REGISTER_STATUS, Status.sizeof())))


def encode_command(command: BoardCommand) -> bytes:
    """Encode a command for the register COMMAND: its code and the complement of the code."""
    return bytes([command, 0xFF - command])


def add_crc(address: int, settings: bytes) -> bytes:
    """Append the CRC that the board at this address expects to 8 bytes of scan settings."""
    return settings + crc32(bytes([address]) + settings).to_bytes(4, "little")


def test_identity_of_every_board_matches_the_hand_description(rig: Rig, bus) -> None:
    for board in rig.hand.boards:
        data = read_register(bus, board.address, REGISTER_IDENTITY, Identity.sizeof())
        identity = Identity.parse(data)
        assert identity.crc32 == crc32(data[:-4])
        assert (identity.address, identity.taxel_count) == (board.address, board.kind.taxel_count)


def test_identity_read_in_blocks_of_32_bytes_is_the_same(rig: Rig, bus) -> None:
    address = get_address(rig.hand, 0)
    blocks = [
        bytes(bus.read_i2c_block_data(address, REGISTER_IDENTITY + start, min(SMBUS_BLOCK, Identity.sizeof() - start)))
        for start in range(0, Identity.sizeof(), SMBUS_BLOCK)
    ]
    assert b"".join(blocks) == read_register(bus, address, REGISTER_IDENTITY, Identity.sizeof())


def test_quick_write_is_acknowledged_by_the_boards_only(rig: Rig, bus) -> None:
    found, refusals = set(), set()
    for address in range(0x08, 0x78):
        try:
            bus.write_quick(address)
            found.add(address)
        except OSError as error:
            refusals.add(error.errno)
    assert refusals <= {errno.ENXIO, errno.EREMOTEIO}
    # A quick write is an address without data. A physical bus may have further devices, a virtual bus has none.
    assert found >= {board.address for board in rig.hand.boards}
    if rig.description.is_virtual:
        assert found == {board.address for board in rig.hand.boards}


def test_snapshot_read_in_blocks_contains_one_scan(rig: Rig, bus) -> None:
    for board in rig.hand.boards:
        size = SNAPSHOT_OVERHEAD + 2 * board.kind.taxel_count
        blocks = []
        for k, start in enumerate(range(0, size, SMBUS_BLOCK)):
            length = min(SMBUS_BLOCK, size - start)  # register + k: block k; block 0 latches the newest scan
            blocks.append(bytes(bus.read_i2c_block_data(board.address, REGISTER_SNAPSHOT + k, length)))
            rig.clock.wait(0.003)  # the board continues to scan between the blocks
        data = b"".join(blocks)
        parsed = snapshot(board.kind.taxel_count).parse(data)
        assert parsed.crc32 == crc32(bytes([board.address]) + data[:-4])


def test_snapshot_does_not_change_without_a_new_scan(rig: Rig, bus) -> None:
    address = get_address(rig.hand, 0)
    size = SNAPSHOT_OVERHEAD + 2 * rig.hand.get_board(address).kind.taxel_count
    write_register(bus, address, REGISTER_COMMAND, encode_command(BoardCommand.STOP_SCAN))
    first = read_register(bus, address, REGISTER_SNAPSHOT, size)
    rig.clock.wait(0.1)
    assert read_register(bus, address, REGISTER_SNAPSHOT, size) == first
    write_register(bus, address, REGISTER_COMMAND, encode_command(BoardCommand.START_SCAN))
    rig.clock.wait(0.1)
    assert read_register(bus, address, REGISTER_SNAPSHOT, size) != first


def test_read_without_a_write_starts_at_the_register_pointer(rig: Rig, bus) -> None:
    address = get_address(rig.hand, 1)
    identity = read_register(bus, address, REGISTER_IDENTITY, 8)
    second_read = i2c_msg.read(address, 8)
    bus.i2c_rdwr(second_read)
    assert bytes(second_read) == identity


def test_bytes_after_the_end_of_a_register_and_of_an_undefined_register_are_ff(rig: Rig, bus) -> None:
    address = get_address(rig.hand, 0)
    data = read_register(bus, address, REGISTER_IDENTITY, Identity.sizeof() + 6)
    assert data[Identity.sizeof() :] == b"\xff" * 6
    assert read_register(bus, address, 0xB0, 4) == b"\xff" * 4


@pytest.mark.parametrize("index", [0, 5, 16])
def test_board_clock_agrees_with_the_clock_of_the_rig(rig: Rig, bus, index: int) -> None:
    address = get_address(rig.hand, index)
    start_s, first = rig.clock.now_s(), read_status(bus, address)
    rig.clock.wait(0.5)
    elapsed_s, second = rig.clock.now_s() - start_s, read_status(bus, address)
    measured_s = (second["clock_us"] - first["clock_us"]) % 2**32 / 1e6
    assert measured_s == pytest.approx(elapsed_s, rel=0.03, abs=0.005)  # the oscillator has a tolerance of 2 %
    assert second["scans"] > first["scans"]


def test_settings_with_a_valid_crc_are_applied_and_others_are_rejected_and_counted(rig: Rig, bus) -> None:
    address = get_address(rig.hand, 0)
    old = read_register(bus, address, REGISTER_SETTINGS, SettingsRegister.sizeof())
    new_settings = (120).to_bytes(2, "little") + old[2:8]  # only sub_conversions, the first field, changes
    write_register(bus, address, REGISTER_SETTINGS, add_crc(address, new_settings))
    assert read_register(bus, address, REGISTER_SETTINGS, 8) == new_settings
    before = read_status(bus, address)["rejected_writes"]
    write_register(bus, address, REGISTER_SETTINGS, old[:8] + bytes(4))  # a wrong CRC
    assert read_register(bus, address, REGISTER_SETTINGS, 8) == new_settings
    assert read_status(bus, address)["rejected_writes"] == before + 1
    write_register(bus, address, REGISTER_SETTINGS, old)
    assert read_register(bus, address, REGISTER_SETTINGS, 12) == old


def test_settings_with_the_crc_of_another_address_are_rejected(rig: Rig, bus) -> None:
    address, other_address = get_address(rig.hand, 0), get_address(rig.hand, 1)
    old = read_register(bus, address, REGISTER_SETTINGS, 12)
    new_settings = (80).to_bytes(2, "little") + old[2:8]  # only sub_conversions, the first field, changes
    write_register(bus, address, REGISTER_SETTINGS, add_crc(other_address, new_settings))
    assert read_register(bus, address, REGISTER_SETTINGS, 12) == old


@pytest.mark.parametrize("bytes_written", [b"\x02\x02", b"\x02", b"\x00\xff", b"\xff\x00"])
def test_command_without_its_complement_is_rejected(rig: Rig, bus, bytes_written: bytes) -> None:
    address = get_address(rig.hand, 0)
    before = read_status(bus, address)
    write_register(bus, address, REGISTER_COMMAND, bytes_written)
    after = read_status(bus, address)
    assert after["state"] == before["state"] == 1  # 1: still scanning; the command 2 would stop the scan
    assert after["rejected_writes"] == before["rejected_writes"] + 1


def test_settings_write_of_more_than_twelve_bytes_is_not_acknowledged_and_the_board_still_answers(
    rig: Rig, bus
) -> None:
    address = get_address(rig.hand, 0)
    with pytest.raises(OSError) as caught:
        write_register(bus, address, REGISTER_SETTINGS, bytes(13))
    assert caught.value.errno == errno.EREMOTEIO
    assert len(read_register(bus, address, REGISTER_IDENTITY, 4)) == 4


def test_restart_command_restarts_the_board(rig: Rig, bus) -> None:
    address = get_address(rig.hand, 3)
    write_register(bus, address, REGISTER_COMMAND, encode_command(BoardCommand.RESTART))
    rig.clock.wait(BOOTED_S)
    status_after = read_status(bus, address)
    assert status_after["clock_us"] < 1e6 * (BOOTED_S + 0.05)
    assert status_after["reset_cause"] == ResetCause.COMMAND


def test_second_master_causes_no_losses_and_no_bus_errors(rig: Rig, skin: Skin) -> None:
    address = get_address(rig.hand, 7)
    skin.hub.read_status()
    before = {a: dict(fields) for a, fields in skin.hub.board_status.items()}
    for _ in range(40):
        data = read_register(rig.i2c, address, REGISTER_IDENTITY, Identity.sizeof())
        assert Identity.parse(data).address == address
        read_frames(rig, skin, 0.021)
    assert skin.losses.lost_on_wire == 0
    assert all(count.missing == 0 for count in skin.losses.boards.values())
    skin.hub.read_status()
    for board in rig.hand.boards:
        counters = skin.hub.board_status[board.address]
        for name in ("nacks", "timeouts", "bus_errors", "crc_errors"):
            assert counters[name] == before[board.address][name]


@pytest.mark.needs("build")
def test_virtual_adapter_rejects_transfers_of_three_messages(rig: Rig, bus) -> None:
    address = get_address(rig.hand, 0)
    for kinds in itertools.product("rw", repeat=3):
        messages = [i2c_msg.read(address, 1) if kind == "r" else i2c_msg.write(address, [0]) for kind in kinds]
        with pytest.raises(OSError) as caught:
            bus.i2c_rdwr(*messages)
        assert caught.value.errno == errno.EOPNOTSUPP
