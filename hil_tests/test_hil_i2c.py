"""Boards on the bus, spoken to directly: what is written for /dev/i2c-N and smbus2 runs here unchanged."""

import errno
import itertools

import pytest
from smbus2 import i2c_msg

from hil_tests.harness.rig import Rig
from hil_tests.harness.watching import board_at, watch
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
from taxel_protocol.registers import Identity, SettingsRegister, Status, snapshot

pytestmark = pytest.mark.needs("i2c")
BOOTED_S = 0.2


@pytest.fixture
def bus(rig: Rig):
    """The adapter, with every board booted."""
    rig.clock.wait(BOOTED_S)
    return rig.i2c


def read(bus, address: int, register: int, size: int) -> bytes:
    message = i2c_msg.read(address, size)
    bus.i2c_rdwr(i2c_msg.write(address, [register]), message)
    return bytes(message)


def write(bus, address: int, register: int, data: bytes) -> None:
    bus.i2c_rdwr(i2c_msg.write(address, bytes([register]) + data))


def status(bus, address: int) -> dict:
    return dict(Status.parse(read(bus, address, REGISTER_STATUS, Status.sizeof())))


def test_every_board_tells_who_it_is(rig: Rig, bus) -> None:
    for board in rig.hand.boards:
        data = read(bus, board.address, REGISTER_IDENTITY, Identity.sizeof())
        identity = Identity.parse(data)
        assert identity.crc32 == crc32(data[:-4])
        assert (identity.address, identity.taxel_count) == (board.address, board.kind.taxel_count)


def test_blocks_of_32_bytes_give_the_same_identity(rig: Rig, bus) -> None:
    address = board_at(rig.hand, 0)
    blocks = [
        bytes(bus.read_i2c_block_data(address, REGISTER_IDENTITY + start, min(SMBUS_BLOCK, Identity.sizeof() - start)))
        for start in range(0, Identity.sizeof(), SMBUS_BLOCK)
    ]
    assert b"".join(blocks) == read(bus, address, REGISTER_IDENTITY, Identity.sizeof())


def test_a_quick_write_finds_the_boards_and_nothing_else(rig: Rig, bus) -> None:
    found, refusals = set(), set()
    for address in range(0x08, 0x78):
        try:
            bus.write_quick(address)
            found.add(address)
        except OSError as error:
            refusals.add(error.errno)
    assert refusals <= {errno.ENXIO, errno.EREMOTEIO}
    assert found >= {board.address for board in rig.hand.boards}
    if rig.description.is_virtual:
        assert found == {board.address for board in rig.hand.boards}


def test_a_snapshot_in_blocks_is_one_scan(rig: Rig, bus) -> None:
    for board in rig.hand.boards:
        size = SNAPSHOT_OVERHEAD + 2 * board.kind.taxel_count
        blocks = []
        for k, start in enumerate(range(0, size, SMBUS_BLOCK)):
            length = min(SMBUS_BLOCK, size - start)
            blocks.append(bytes(bus.read_i2c_block_data(board.address, REGISTER_SNAPSHOT + k, length)))
            rig.clock.wait(0.003)  # scans go on between the blocks
        data = b"".join(blocks)
        parsed = snapshot(board.kind.taxel_count).parse(data)
        assert parsed.crc32 == crc32(bytes([board.address]) + data[:-4])


def test_two_reads_without_a_scan_between_give_the_same_snapshot(rig: Rig, bus) -> None:
    address = board_at(rig.hand, 0)
    size = SNAPSHOT_OVERHEAD + 2 * rig.hand.get_board(address).kind.taxel_count
    write(bus, address, REGISTER_COMMAND, bytes([2, 0xFD]))  # STOP_SCAN
    first = read(bus, address, REGISTER_SNAPSHOT, size)
    rig.clock.wait(0.1)
    assert read(bus, address, REGISTER_SNAPSHOT, size) == first
    write(bus, address, REGISTER_COMMAND, bytes([1, 0xFE]))  # START_SCAN
    rig.clock.wait(0.1)
    assert read(bus, address, REGISTER_SNAPSHOT, size) != first


def test_a_read_without_a_write_begins_where_the_pointer_stands(rig: Rig, bus) -> None:
    address = board_at(rig.hand, 1)
    identity = read(bus, address, REGISTER_IDENTITY, 8)
    again = i2c_msg.read(address, 8)
    bus.i2c_rdwr(again)
    assert bytes(again) == identity


def test_after_the_end_of_a_block_there_is_ff(rig: Rig, bus) -> None:
    address = board_at(rig.hand, 0)
    data = read(bus, address, REGISTER_IDENTITY, Identity.sizeof() + 6)
    assert data[Identity.sizeof() :] == b"\xff" * 6
    assert read(bus, address, 0xB0, 4) == b"\xff" * 4


@pytest.mark.parametrize("place", [0, 5, 16])
def test_the_clock_of_a_board_goes_with_the_rigs(rig: Rig, bus, place: int) -> None:
    address = board_at(rig.hand, place)
    begun_s, first = rig.clock.now_s(), status(bus, address)
    rig.clock.wait(0.5)
    passed_s, second = rig.clock.now_s() - begun_s, status(bus, address)
    measured_s = (second["clock_us"] - first["clock_us"]) % 2**32 / 1e6
    assert measured_s == pytest.approx(passed_s, rel=0.03, abs=0.005)  # the oscillator is off by up to 2 %
    assert second["scans"] > first["scans"]


def test_settings_with_a_right_crc_are_taken_over_and_others_counted(rig: Rig, bus) -> None:
    address = board_at(rig.hand, 0)
    old = read(bus, address, REGISTER_SETTINGS, SettingsRegister.sizeof())
    wanted = (120).to_bytes(2, "little") + old[2:8]
    write(bus, address, REGISTER_SETTINGS, wanted + crc32(bytes([address]) + wanted).to_bytes(4, "little"))
    assert read(bus, address, REGISTER_SETTINGS, 8) == wanted
    before = status(bus, address)["rejected_writes"]
    write(bus, address, REGISTER_SETTINGS, old[:8] + bytes(4))
    assert read(bus, address, REGISTER_SETTINGS, 8) == wanted
    assert status(bus, address)["rejected_writes"] == before + 1
    write(bus, address, REGISTER_SETTINGS, old)
    assert read(bus, address, REGISTER_SETTINGS, 12) == old


def test_settings_of_another_boards_address_are_refused(rig: Rig, bus) -> None:
    address, other = board_at(rig.hand, 0), board_at(rig.hand, 1)
    old = read(bus, address, REGISTER_SETTINGS, 12)
    wanted = (80).to_bytes(2, "little") + old[2:8]
    write(bus, address, REGISTER_SETTINGS, wanted + crc32(bytes([other]) + wanted).to_bytes(4, "little"))
    assert read(bus, address, REGISTER_SETTINGS, 12) == old


@pytest.mark.parametrize("bytes_written", [b"\x02\x02", b"\x02", b"\x00\xff", b"\xff\x00"])
def test_a_command_without_its_complement_does_nothing(rig: Rig, bus, bytes_written: bytes) -> None:
    address = board_at(rig.hand, 0)
    before = status(bus, address)
    write(bus, address, REGISTER_COMMAND, bytes_written)
    after = status(bus, address)
    assert after["state"] == before["state"] == 1
    assert after["rejected_writes"] == before["rejected_writes"] + 1


def test_a_thirteenth_byte_is_not_acknowledged(rig: Rig, bus) -> None:
    address = board_at(rig.hand, 0)
    with pytest.raises(OSError) as caught:
        write(bus, address, REGISTER_SETTINGS, bytes(13))
    assert caught.value.errno == errno.EREMOTEIO
    assert len(read(bus, address, REGISTER_IDENTITY, 4)) == 4


def test_a_board_restarts_when_it_is_told_to(rig: Rig, bus) -> None:
    address = board_at(rig.hand, 3)
    write(bus, address, REGISTER_COMMAND, bytes([4, 0xFB]))
    rig.clock.wait(BOOTED_S)
    fresh = status(bus, address)
    assert fresh["clock_us"] < 1e6 * (BOOTED_S + 0.05)
    assert fresh["reset_cause"] == 3


def test_a_second_master_costs_the_hub_nothing(rig: Rig, skin: Skin) -> None:
    address = board_at(rig.hand, 7)
    skin.hub.read_status()
    before = {a: dict(fields) for a, fields in skin.hub.board_status.items()}
    for _ in range(40):
        data = read(rig.i2c, address, REGISTER_IDENTITY, Identity.sizeof())
        assert Identity.parse(data).address == address
        watch(rig, skin, 0.021)
    assert skin.losses.lost_on_wire == 0
    assert all(count.missing == 0 for count in skin.losses.boards.values())
    skin.hub.read_status()
    for board in rig.hand.boards:
        now = skin.hub.board_status[board.address]
        for name in ("nacks", "timeouts", "bus_errors", "crc_errors"):
            assert now[name] == before[board.address][name]


@pytest.mark.needs("build")
def test_transfers_that_the_virtual_adapter_cannot_make_are_refused(rig: Rig, bus) -> None:
    address = board_at(rig.hand, 0)
    for kinds in itertools.product("rw", repeat=3):
        messages = [i2c_msg.read(address, 1) if kind == "r" else i2c_msg.write(address, [0]) for kind in kinds]
        with pytest.raises(OSError) as caught:
            bus.i2c_rdwr(*messages)
        assert caught.value.errno == errno.EOPNOTSUPP
