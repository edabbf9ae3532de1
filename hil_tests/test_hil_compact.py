"""Compact snapshots over bus, hub and UART: the counts are those that were shown, whoever starts anew."""

from collections import Counter
from collections.abc import Iterator

import pytest

from hil_tests.harness.rig import Rig
from hil_tests.harness.watching import KnownCounts, board_at, watch
from hil_tests.test_hil_power import power_cycle
from taxel.hand import Hand
from taxel.skin import Skin
from taxel.stream import TaxelFrame
from taxel_protocol import BoardFault

SETTLED_S = 0.5
WATCHED_S = 1.0
RATE_GAIN = 2.0
"""Against plain snapshots, on a quiet skin; 3.4 when it was written."""


@pytest.fixture
def compact_skin(rig: Rig) -> Iterator[Skin]:
    with Skin(rig.uart.link(), rig.hand, frames="compact") as skin:
        yield skin


def known_counts(rig: Rig, skin: Skin) -> KnownCounts:
    """The counts that are shown, when nothing else is under way any more."""
    watch(rig, skin, SETTLED_S)
    counts = KnownCounts(rig)
    watch(rig, skin, 0.2)
    return counts


def frames_of_each(frames: list[TaxelFrame], hand: Hand) -> list[int]:
    count = Counter(frame.address for frame in frames)
    return [count[board.address] for board in hand.boards]


@pytest.mark.needs("counts")
def test_compact_frames_carry_the_counts_that_were_shown(rig: Rig, compact_skin: Skin) -> None:
    counts = known_counts(rig, compact_skin)
    for _ in range(3):
        for frame in watch(rig, compact_skin, 0.3):
            counts.check(frame)
        counts.go_on()
    assert compact_skin.losses.lost_on_wire == 0
    assert not compact_skin.losses.undecoded_frames


def test_every_board_is_read_more_often_than_by_plain_frames(rig: Rig) -> None:
    least = {}
    for form in ("plain", "compact"):
        with Skin(rig.uart.link(), rig.hand, frames=form) as skin:
            watch(rig, skin, SETTLED_S)
            least[form] = min(frames_of_each(watch(rig, skin, WATCHED_S), rig.hand))
    assert least["compact"] > RATE_GAIN * least["plain"]


@pytest.mark.needs("counts", "power", "faults")
def test_a_board_that_lost_its_power_begins_with_new_references(rig: Rig, compact_skin: Skin) -> None:
    address = board_at(rig.hand, 3)
    counts = known_counts(rig, compact_skin)
    power_cycle(rig, address)
    for frame in watch(rig, compact_skin, SETTLED_S):
        counts.check(frame)
    after = watch(rig, compact_skin, SETTLED_S)
    for frame in after:
        counts.check(frame)
    assert min(frames_of_each(after, rig.hand)) > 10
    assert {fault["fault"] for fault in compact_skin.hub.faults} <= {
        BoardFault.NACK,
        BoardFault.CRC,
        BoardFault.RECOVERED,
        BoardFault.RESTARTED,
    }


@pytest.mark.needs("counts")
def test_a_rebooted_hub_goes_on_with_compact_frames(rig: Rig, compact_skin: Skin) -> None:
    counts = known_counts(rig, compact_skin)
    compact_skin.hub.reboot()
    watch(rig, compact_skin, SETTLED_S)
    after = watch(rig, compact_skin, SETTLED_S)
    for frame in after:
        counts.check(frame)
    assert compact_skin.losses.restarts == 1
    assert min(frames_of_each(after, rig.hand)) > 0.7 * 40 * SETTLED_S
