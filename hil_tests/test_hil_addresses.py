"""Boards that are not what was expected: two on one address, other firmware, none."""

import pytest

from hil_tests.harness.rig import Rig
from hil_tests.harness.watching import KnownCounts, board_at, watch
from taxel.skin import BoardMismatchError, Skin
from taxel_protocol import BoardState
from taxel_protocol.registers import Identity

# A second board on the first one's address, smaller and with a clock of its own.
DOUBLE = f"board {{0}} 9 4 4 16 {'ffff' + 60 * '0'} 0102030405060708 1500.0 40.0"


@pytest.mark.needs("counts")
@pytest.mark.world(lines=["firmware {3} 2 7 1"])
def test_another_firmware_version_streams_and_is_told(rig: Rig, skin: Skin) -> None:
    address = board_at(rig.hand, 3)
    watch(rig, skin, 0.3)
    info = skin.hub.boards[address]
    version = tuple(info[f"identity_firmware_{part}"] for part in ("major", "minor", "patch"))
    assert version == (2, 7, 1)
    assert address in {frame.address for frame in watch(rig, skin, 0.3)}


@pytest.mark.world(only=range(1, 17))
def test_a_board_that_is_not_there_is_missing_by_name(rig: Rig, skin: Skin) -> None:
    watch(rig, skin, 0.3)
    assert skin.missing_boards == [rig.hand.boards[0].name]
    assert {frame.address for frame in watch(rig, skin, 0.3)} == {board.address for board in rig.hand.boards[1:]}


@pytest.mark.world(only=range(1, 17), lines=[DOUBLE])
def test_a_board_that_the_hand_does_not_have_there_is_refused_by_name(rig: Rig) -> None:
    with pytest.raises(BoardMismatchError, match=rf"0x{board_at(rig.hand, 0):02X} has 16 taxels"):
        Skin(rig.uart.link(), rig.hand)


@pytest.mark.needs("i2c")
@pytest.mark.world(lines=[DOUBLE])
def test_two_boards_on_one_address_give_no_count_at_all(rig: Rig) -> None:
    address = board_at(rig.hand, 0)
    rig.clock.wait(0.3)
    data = bytes(rig.i2c.read_i2c_block_data(address, 0, 32))
    assert data[:1] == b"T"  # where both say the same, the wire does too
    with Skin(rig.uart.link(), rig.hand) as skin:
        frames = watch(rig, skin, 1.0)
        assert address not in {frame.address for frame in frames}
        assert {frame.address for frame in frames} == {board.address for board in rig.hand.boards[1:]}
        skin.hub.read_status()
        assert skin.hub.board_status[address]["state"] != BoardState.STREAMING


@pytest.mark.needs("i2c")
@pytest.mark.world(clock_spread_ppm=0.0)
def test_every_board_has_an_id_of_its_own(rig: Rig) -> None:
    rig.clock.wait(0.3)
    ids = set()
    for board in rig.hand.boards:
        data = b"".join(bytes(rig.i2c.read_i2c_block_data(board.address, start, 29)) for start in (0, 29))
        ids.add(bytes(Identity.parse(data).unique_id))
    assert len(ids) == len(rig.hand.boards)


@pytest.mark.needs("counts", "faults")
def test_a_board_that_is_back_before_it_was_given_up_is_identified_anew(rig: Rig, skin: Skin) -> None:
    address = board_at(rig.hand, 2)
    watch(rig, skin, 0.3)
    counts = KnownCounts(rig)
    watch(rig, skin, 0.2)
    rig.power.switch(False, address)
    watch(rig, skin, 0.05)  # less than three polls: the hub has not given it up
    rig.power.switch(True, address)
    frames = watch(rig, skin, 0.5)
    for frame in frames:
        counts.check(frame)
    assert address in {frame.address for frame in frames[-20:]}
