"""A fault at every byte of a poll: no count is wrong, nothing but a retry is counted, the next cycle is whole."""

import contextlib
from dataclasses import asdict

import pytest

from hil_tests.harness.rig import Rig
from hil_tests.harness.watching import KnownCounts, board_at, check_order, check_polls, counters_of, watch
from taxel.hand.world import ScanSettings
from taxel.skin import Skin
from taxel.stream import HubError, TaxelFrame
from taxel_protocol import SNAPSHOT_OVERHEAD

STRUCK = 2
CYCLE_S = 0.07  # 17 boards at 400 kHz take 53 to 63 ms
RETRY_S = 0.02  # from a poll that failed to the end of its retry, and more
GIVEN_UP_S = 2 * CYCLE_S  # to the end of a whole cycle after a poll that was given up
FATAL = ("nacks", "timeouts", "crc_errors", "bus_errors", "dropped")

# The fault, its second value, and which of the fatal counters it may raise.
KINDS = {
    "nack": ("nack_at", 0.0, ()),
    "flipped bit": ("flip_at", 5.0, ()),
    "lost arbitration": ("arbitration_at", 0.0, ()),
    "stray stop": ("bus_error_at", 0.0, ()),
    "stretch below the limit": ("stretch_at", 4000.0, ()),
    "stretch beyond the limit": ("stretch_at", 20000.0, ("timeouts",)),
    "brown-out": ("brown_out_at", 1.0, ("nacks", "crc_errors")),
}


def watch_strike(rig: Rig, skin: Skin, strikes: int, rest_s: float) -> list[TaxelFrame]:
    """Frames until so many strikes are in the log, and `rest_s` more: the next one would strike a retry too."""
    assert rig.faults is not None
    frames: list[TaxelFrame] = []
    end = rig.clock.now_s() + 2 * CYCLE_S
    while len(rig.faults.strikes()) < strikes and rig.clock.now_s() < end:
        frames += watch(rig, skin, 0.1 * CYCLE_S)
    return frames + watch(rig, skin, rest_s)


@pytest.mark.needs("faults", "counts")
@pytest.mark.parametrize("kind", KINDS)
def test_a_fault_at_every_byte_of_a_poll_costs_at_most_that_poll(rig: Rig, skin: Skin, kind: str) -> None:
    assert rig.faults is not None
    fault, second, may_rise = KINDS[kind]
    address = board_at(rig.hand, STRUCK)
    positions = 1 + SNAPSHOT_OVERHEAD + 2 * rig.hand.get_board(address).kind.taxel_count
    counts = KnownCounts(rig)
    watch(rig, skin, 0.3)  # until the counts are shown
    frames = []
    first, strikes = len(rig.faults.strikes()), 0
    for position in range(0, positions, 1 if kind != "brown-out" else 9):
        rig.faults.inject(fault, address, position, second if kind != "flipped bit" else position % 8)
        strikes += 1
        frames += watch_strike(rig, skin, first + 2 * strikes, GIVEN_UP_S if may_rise else RETRY_S)
        if position % 16 == 0:
            counts.go_on()
    assert len(rig.faults.strikes()) - first == 2 * strikes  # each was armed, and struck
    for frame in frames:
        counts.check(frame)
    check_order(frames)
    check_polls(skin)
    counted = counters_of(skin, address)
    assert {name for name in FATAL if counted[name]} <= set(may_rise)
    assert skin.losses.lost_on_wire == 0
    if not may_rise:
        assert skin.losses.boards[address].missing == 0


@pytest.mark.needs("faults")
@pytest.mark.parametrize("byte", range(14))
def test_a_settings_write_damaged_at_any_byte_is_not_taken_over(rig: Rig, skin: Skin, byte: int) -> None:
    """The whole write: address, pointer, 8 bytes of settings, 4 of CRC. The hub reads back, and writes again."""
    assert rig.faults is not None
    address = board_at(rig.hand, STRUCK)
    settings = asdict(ScanSettings(sub_conversions=120))
    rig.faults.inject("flip_at", address, byte, 3)
    with contextlib.suppress(HubError):  # refused by the board: an honest answer too
        skin.hub.set_scan_settings(settings, address)
    watch(rig, skin, 0.2)
    taken = skin.hub.transfer(address, bytes([0x60]), 8)
    assert int.from_bytes(taken[:2], "little") in {120, 160}  # the new ones or the old, never a mixture
    assert taken[2:] == bytes.fromhex("2800") + bytes([1, 16]) + bytes.fromhex("6000")
