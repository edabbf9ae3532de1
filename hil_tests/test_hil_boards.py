"""Registers of the boards, accessed through the hub."""

import numpy as np
import pytest

from taxel.skin import Skin
from taxel.stream import HubError
from taxel_protocol import SNAPSHOT_OVERHEAD, crc32
from taxel_protocol.limits import (
    REGISTER_IDENTITY,
    REGISTER_SETTINGS,
    REGISTER_SNAPSHOT,
    REGISTER_STATUS,
    SMBUS_BLOCK,
)
from taxel_protocol.names import FrontEnd
from taxel_protocol.registers import Identity, ScanSettings, Status, snapshot


def read_in_blocks(skin: Skin, address: int, size: int) -> bytes:
    """Read a snapshot of `size` bytes as an SMBus host does: blocks of 32 bytes, block k at register 0x80 + k."""
    blocks = []
    for start in range(0, size, SMBUS_BLOCK):
        pointer = REGISTER_SNAPSHOT + start // SMBUS_BLOCK
        blocks.append(skin.hub.transfer(address, bytes([pointer]), min(SMBUS_BLOCK, size - start)))
    return b"".join(blocks)


def test_the_bus_scan_finds_every_board_of_the_hand(skin: Skin) -> None:
    assert set(skin.hub.scan_bus()) >= {board.address for board in skin.hand.boards}


def test_identity_of_every_board_matches_the_hand_description(skin: Skin) -> None:
    """The identity is read in blocks of at most 32 bytes, and ends with a CRC over the bytes before it."""
    for board in skin.hand.boards:
        data = b"".join(
            skin.hub.transfer(
                board.address, bytes([REGISTER_IDENTITY + offset]), min(SMBUS_BLOCK, Identity.sizeof() - offset)
            )
            for offset in range(0, Identity.sizeof(), SMBUS_BLOCK)
        )
        identity = Identity.parse(data)
        assert identity.crc32 == crc32(data[:-4])
        assert identity.taxel_count == board.kind.taxel_count
        assert identity.crossing_map == board.kind.crossing_bitmap()


def test_snapshot_read_in_blocks_has_a_valid_crc_while_the_hub_does_not_poll(skin: Skin) -> None:
    skin.hub.stop()
    for board in skin.hand.boards:
        taxels = board.kind.taxel_count
        data = read_in_blocks(skin, board.address, SNAPSHOT_OVERHEAD + 2 * taxels)
        parsed = snapshot(taxels).parse(data)
        assert parsed.crc32 == crc32(bytes([board.address]) + data[:-4])
        assert len(parsed.raw_counts) == taxels


def test_transfer_to_an_address_without_a_board_fails_with_nack(skin: Skin) -> None:
    unused_address = next(a for a in range(0x08, 0x78) if a not in {board.address for board in skin.hand.boards})
    with pytest.raises(HubError, match="nack"):
        skin.hub.transfer(unused_address, bytes([0]), 1)


def test_half_the_number_of_sub_conversions_halves_the_counts(skin: Skin) -> None:
    """A raw count is a sum over the sub-conversions of a conversion, so it is proportional to their number.

    The tolerance of 40 counts is ten times the noise of a raw count on the emulated skin.
    """
    board = skin.hand.boards[0]
    before = np.median([f.raw_counts for f in _read_frames_of(skin, board.address, 3)], axis=0)
    data = skin.hub.transfer(board.address, bytes([REGISTER_SETTINGS]), ScanSettings.sizeof())
    settings = dict(ScanSettings.parse(data))
    settings.pop("_io", None)
    halved = settings | {"sub_conversions": settings["sub_conversions"] // 2}
    skin.hub.set_scan_settings(halved, board.address)
    # The first frames may have been measured before the change; the later frames must have the new counts.
    frames = _read_frames_of(skin, board.address, 60)
    skin.hub.set_scan_settings(settings, board.address)
    is_halved = [np.allclose(frame.raw_counts, before / 2.0, atol=40.0) for frame in frames]
    assert all(is_halved[is_halved.index(True) :])


def test_settings_out_of_range_are_rejected_and_change_nothing(skin: Skin) -> None:
    """The current code 0 (`idac_code`) is out of range. The register of the settings keeps its content."""
    board = skin.hand.boards[0]
    data = skin.hub.transfer(board.address, bytes([REGISTER_SETTINGS]), ScanSettings.sizeof())
    settings = dict(ScanSettings.parse(data))
    settings.pop("_io", None)
    with pytest.raises(HubError, match="rejected by board"):
        skin.hub.set_scan_settings(settings | {"idac_code": 0}, board.address)
    assert skin.hub.transfer(board.address, bytes([REGISTER_SETTINGS]), ScanSettings.sizeof()) == data


def test_settings_for_another_converter_are_rejected_and_change_nothing(skin: Skin) -> None:
    """The settings are valid, but their CRC covers the converter 0x81, which is not the converter of the board."""
    board = skin.hand.boards[0]
    status = Status.parse(skin.hub.transfer(board.address, bytes([REGISTER_STATUS]), Status.sizeof()))
    assert status["front_end"] == FrontEnd.CAPSENSE
    data = skin.hub.transfer(board.address, bytes([REGISTER_SETTINGS]), ScanSettings.sizeof())
    settings = dict(ScanSettings.parse(data))
    settings.pop("_io", None)
    with pytest.raises(HubError, match="rejected by board"):
        skin.hub.set_scan_settings(settings | {"settle_cycles": 100}, board.address, front_end=0x81)
    assert skin.hub.transfer(board.address, bytes([REGISTER_SETTINGS]), ScanSettings.sizeof()) == data


def _read_frames_of(skin: Skin, address: int, count: int) -> list:
    """Receive the next `count` frames of the board at `address`; frames of other boards are skipped."""
    frames = []
    for frame in skin:
        if frame.address == address:
            frames.append(frame)
        if len(frames) == count:
            break
    return frames
