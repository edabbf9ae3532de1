"""A fault at each byte of a poll: no wrong counts, at most one retry, and a complete next cycle."""

import contextlib
from dataclasses import asdict

import pytest

from hil_tests.harness.frame_checks import (
    KnownCounts,
    check_order,
    check_polls,
    get_address,
    read_counters,
    read_frames,
)
from hil_tests.harness.rig import Rig
from taxel.hand.world import ScanSettings
from taxel.skin import Skin
from taxel.stream import HubError, TaxelFrame
from taxel_protocol import SNAPSHOT_OVERHEAD

BOARD_INDEX = 2
CYCLE_S = 0.07  # 17 boards at 400 kHz take 53 to 63 ms
RETRY_S = 0.02  # longer than the time from a failed poll to the end of its retry
ABANDONED_S = 2 * CYCLE_S  # time from an abandoned poll to the end of a complete cycle
ERROR_COUNTERS = ("nacks", "timeouts", "crc_errors", "bus_errors", "dropped")

# Name of the fault, its second value, and the error counters that it may increase.
KINDS = {
    "nack": ("nack_at", 0.0, ()),
    "flipped bit": ("flip_at", 5.0, ()),
    "lost arbitration": ("arbitration_at", 0.0, ()),
    "stray stop": ("bus_error_at", 0.0, ()),
    "stretch below the limit": ("stretch_at", 4000.0, ()),
    "stretch beyond the limit": ("stretch_at", 20000.0, ("timeouts",)),
    "brown-out": ("brown_out_at", 1.0, ("nacks", "crc_errors")),
}


def read_frames_until_events(rig: Rig, skin: Skin, n_events: int, settling_s: float) -> list[TaxelFrame]:
    """Receive frames until the log contains `n_events` fault events, and for another `settling_s`, until a retry is
    complete. Stops after two poll cycles without the events.
    """
    assert rig.faults is not None
    frames: list[TaxelFrame] = []
    end_s = rig.clock.now_s() + 2 * CYCLE_S
    while len(rig.faults.read_events()) < n_events and rig.clock.now_s() < end_s:
        frames += read_frames(rig, skin, 0.1 * CYCLE_S)
    return frames + read_frames(rig, skin, settling_s)


@pytest.mark.needs("faults", "counts")
@pytest.mark.parametrize("kind", KINDS)
def test_fault_at_any_byte_of_a_poll_loses_at_most_that_poll(rig: Rig, skin: Skin, kind: str) -> None:
    """One fault of a kind is injected at each byte of a poll: the address, then the bytes of the snapshot.

    No frame has a wrong count. A fault that may increase no error counter is repaired by the retry, so no frame of the
    board is missing; any other fault may cost the poll and increases only the counters listed in `KINDS`.
    """
    assert rig.faults is not None
    fault, second_value, permitted_counters = KINDS[kind]
    address = get_address(rig.hand, BOARD_INDEX)
    positions = 1 + SNAPSHOT_OVERHEAD + 2 * rig.hand.get_board(address).kind.taxel_count
    counts = KnownCounts(rig)
    read_frames(rig, skin, 0.3)  # until frames contain the known counts
    frames = []
    n_events_before, n_injected = len(rig.faults.read_events()), 0
    for position in range(0, positions, 1 if kind != "brown-out" else 9):  # a brown-out: only at every ninth byte
        rig.faults.inject(fault, address, position, second_value if kind != "flipped bit" else position % 8)
        n_injected += 1
        settling_s = ABANDONED_S if permitted_counters else RETRY_S
        frames += read_frames_until_events(rig, skin, n_events_before + 2 * n_injected, settling_s)
        if position % 16 == 0:
            counts.advance()
    assert len(rig.faults.read_events()) - n_events_before == 2 * n_injected  # two events each: armed, and in effect
    for frame in frames:
        counts.check_frame(frame)
    check_order(frames)
    check_polls(skin)
    counters = read_counters(skin, address)
    assert {name for name in ERROR_COUNTERS if counters[name]} <= set(permitted_counters)
    assert skin.losses.lost_on_wire == 0
    if not permitted_counters:
        assert skin.losses.boards[address].missing == 0


@pytest.mark.needs("faults")
@pytest.mark.parametrize("byte", range(14))
def test_settings_write_damaged_at_any_byte_is_not_applied(rig: Rig, skin: Skin, byte: int) -> None:
    """The write has an address, a pointer, 8 bytes of settings and 4 bytes of CRC. The hub reads back and repeats."""
    assert rig.faults is not None
    address = get_address(rig.hand, BOARD_INDEX)
    settings = asdict(ScanSettings(sub_conversions=120))
    rig.faults.inject("flip_at", address, byte, 3)  # bit 3 of the byte is flipped
    with contextlib.suppress(HubError):  # a rejection by the board is permitted
        skin.hub.set_scan_settings(settings, address)
    read_frames(rig, skin, 0.2)
    applied = skin.hub.transfer(address, bytes([0x60]), 8)
    assert int.from_bytes(applied[:2], "little") in {120, 160}  # the new settings or the old settings, never a mixture
    # unchanged: clock dividers 40 (0x0028) and 1, IDAC code 16, settle cycles 96 (0x0060)
    assert applied[2:] == bytes.fromhex("2800") + bytes([1, 16]) + bytes.fromhex("6000")
