"""Boards that differ from the hand description: address conflicts, other firmware versions, missing boards."""

import pytest

from hil_tests.harness.frame_checks import KnownCounts, get_address, read_frames
from hil_tests.harness.rig import Rig
from taxel.skin import BoardMismatchError, Skin
from taxel_protocol import BoardState
from taxel_protocol.registers import Identity

# A second board on the address of the first board, with fewer taxels and another clock.
SECOND_BOARD = f"board {{0}} 9 4 4 16 {'ffff' + 60 * '0'} 0102030405060708 1500.0 40.0"


@pytest.mark.needs("counts")
@pytest.mark.world(lines=["firmware {3} 2 7 1"])
def test_board_with_another_firmware_version_streams_and_its_version_is_reported(rig: Rig, skin: Skin) -> None:
    address = get_address(rig.hand, 3)
    read_frames(rig, skin, 0.3)
    info = skin.hub.boards[address]
    version = tuple(info[f"identity_firmware_{part}"] for part in ("major", "minor", "patch"))
    assert version == (2, 7, 1)
    assert address in {frame.address for frame in read_frames(rig, skin, 0.3)}


@pytest.mark.world(only=range(1, 17))
def test_missing_board_is_reported_by_name_and_the_other_boards_stream(rig: Rig, skin: Skin) -> None:
    read_frames(rig, skin, 0.3)
    assert skin.missing_boards == [rig.hand.boards[0].name]
    assert {frame.address for frame in read_frames(rig, skin, 0.3)} == {board.address for board in rig.hand.boards[1:]}


@pytest.mark.world(only=range(1, 17), lines=[SECOND_BOARD])
def test_board_with_an_unexpected_number_of_taxels_is_rejected_with_its_address(rig: Rig) -> None:
    with pytest.raises(BoardMismatchError, match=rf"0x{get_address(rig.hand, 0):02X} has 16 taxels"):
        Skin(rig.uart.open_link(), rig.hand)


@pytest.mark.needs("i2c")
@pytest.mark.world(lines=[SECOND_BOARD])
def test_two_boards_on_one_address_deliver_no_counts_while_the_other_boards_stream(rig: Rig) -> None:
    address = get_address(rig.hand, 0)
    rig.clock.wait(0.3)
    data = bytes(rig.i2c.read_i2c_block_data(address, 0, 32))
    assert data[:1] == b"T"  # both boards send the same first byte, so the wire carries it
    with Skin(rig.uart.open_link(), rig.hand) as skin:
        frames = read_frames(rig, skin, 1.0)
        assert address not in {frame.address for frame in frames}
        assert {frame.address for frame in frames} == {board.address for board in rig.hand.boards[1:]}
        skin.hub.read_status()
        assert skin.hub.board_status[address]["state"] != BoardState.STREAMING


@pytest.mark.needs("i2c")
@pytest.mark.world(clock_spread_ppm=0.0)
def test_all_boards_have_different_unique_ids(rig: Rig) -> None:
    rig.clock.wait(0.3)
    ids = set()
    for board in rig.hand.boards:
        # The identity has 58 bytes; a block read of SMBus returns at most 32.
        data = b"".join(bytes(rig.i2c.read_i2c_block_data(board.address, start, 29)) for start in (0, 29))
        ids.add(bytes(Identity.parse(data).unique_id))
    assert len(ids) == len(rig.hand.boards)


@pytest.mark.needs("counts", "faults")
def test_board_that_returns_before_the_hub_marks_it_absent_streams_correct_counts_again(rig: Rig, skin: Skin) -> None:
    address = get_address(rig.hand, 2)
    read_frames(rig, skin, 0.3)
    counts = KnownCounts(rig)
    read_frames(rig, skin, 0.2)
    rig.power.switch(False, address)
    read_frames(rig, skin, 0.05)  # fewer than three polls: the hub has not marked the board absent
    rig.power.switch(True, address)
    frames = read_frames(rig, skin, 0.5)
    for frame in frames:
        counts.check_frame(frame)
    assert address in {frame.address for frame in frames[-20:]}
