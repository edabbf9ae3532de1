"""Compact frames over I2C bus, hub and UART: decoded counts are exact, also after a restart of a board or the hub."""

from collections import Counter
from collections.abc import Iterator

import pytest

from hil_tests.harness.frame_checks import KnownCounts, get_address, read_frames
from hil_tests.harness.rig import Rig
from hil_tests.test_hil_power import cycle_power
from taxel.hand import Hand
from taxel.skin import Skin
from taxel.stream import TaxelFrame
from taxel_protocol import BoardFault

SETTLING_S = 0.5
COMPACT_RATE_HZ = 40
"""Usual rate of compact frames of one board, Hz."""
MEASURING_S = 1.0
RATE_GAIN = 2.0
"""Least ratio of the frame rates with compact and uncompressed frames on a skin without contact (measured: 3.4)."""


@pytest.fixture
def compact_skin(rig: Rig) -> Iterator[Skin]:
    """A skin whose hub streams compact frames."""
    with Skin(rig.uart.open_link(), rig.hand, frames="compact") as skin:
        yield skin


def set_known_counts(rig: Rig, skin: Skin) -> KnownCounts:
    """Set known raw counts, after all frames with earlier counts have arrived."""
    read_frames(rig, skin, SETTLING_S)
    counts = KnownCounts(rig)
    read_frames(rig, skin, 0.2)
    return counts


def count_frames_by_board(frames: list[TaxelFrame], hand: Hand) -> list[int]:
    """Count the frames of each board, in the order of the hand."""
    count = Counter(frame.address for frame in frames)
    return [count[board.address] for board in hand.boards]


@pytest.mark.needs("counts")
def test_compact_frames_contain_the_known_counts(rig: Rig, compact_skin: Skin) -> None:
    counts = set_known_counts(rig, compact_skin)
    for _ in range(3):
        for frame in read_frames(rig, compact_skin, 0.3):
            counts.check_frame(frame)
        counts.advance()
    assert compact_skin.losses.lost_on_wire == 0
    assert not compact_skin.losses.undecoded_frames


def test_compact_frames_more_than_double_the_frame_rate_of_the_slowest_board(rig: Rig) -> None:
    lowest_count = {}
    for frame_format in ("plain", "compact"):
        with Skin(rig.uart.open_link(), rig.hand, frames=frame_format) as skin:
            read_frames(rig, skin, SETTLING_S)
            lowest_count[frame_format] = min(count_frames_by_board(read_frames(rig, skin, MEASURING_S), rig.hand))
    assert lowest_count["compact"] > RATE_GAIN * lowest_count["plain"]


@pytest.mark.needs("counts", "power", "faults")
def test_compact_frames_are_exact_after_a_power_cycle_of_a_board(rig: Rig, compact_skin: Skin) -> None:
    address = get_address(rig.hand, 3)
    counts = set_known_counts(rig, compact_skin)
    cycle_power(rig, address)
    for frame in read_frames(rig, compact_skin, SETTLING_S):
        counts.check_frame(frame)
    frames_after = read_frames(rig, compact_skin, SETTLING_S)
    for frame in frames_after:
        counts.check_frame(frame)
    assert min(count_frames_by_board(frames_after, rig.hand)) > 10  # the restarted board, too, delivers frames
    # No other fault may occur than those of a board without power that returns.
    assert {fault["fault"] for fault in compact_skin.hub.faults} <= {
        BoardFault.NACK,
        BoardFault.CRC,
        BoardFault.RECOVERED,
        BoardFault.RESTARTED,
    }


@pytest.mark.needs("counts")
def test_rebooted_hub_continues_with_compact_frames(rig: Rig, compact_skin: Skin) -> None:
    counts = set_known_counts(rig, compact_skin)
    compact_skin.hub.reboot()
    read_frames(rig, compact_skin, SETTLING_S)
    frames_after = read_frames(rig, compact_skin, SETTLING_S)
    for frame in frames_after:
        counts.check_frame(frame)
    assert compact_skin.losses.restarts == 1
    # With uncompressed frames, the number would be less than half of the usual number (`RATE_GAIN`).
    assert min(count_frames_by_board(frames_after, rig.hand)) > 0.7 * COMPACT_RATE_HZ * SETTLING_S
