"""The UART loses, changes, doubles and delays bytes; hosts stop reading: what is touched is lost, no more."""

import pytest

from hil_tests.harness.rig import Rig
from hil_tests.harness.watching import KnownCounts, check_order, check_polls, watch
from taxel.skin import Skin
from taxel_protocol import Command

UP = ("up_flip", "up_drop", "up_double")
DOWN = ("down_flip", "down_drop", "down_double")
PLACES = 40


@pytest.mark.needs("faults", "counts")
@pytest.mark.parametrize("fault", UP)
def test_one_damaged_byte_costs_the_frames_that_overlap_it_and_no_more(rig: Rig, skin: Skin, fault: str) -> None:
    """A byte between two frames may belong to both of them: their common mark."""
    watch(rig, skin, 0.3)
    counts = KnownCounts(rig)
    watch(rig, skin, 0.2)
    most = 2 if fault != "up_flip" else 1
    for place in range(PLACES):
        lost = skin.losses.lost_on_wire
        rig.faults.inject(fault, 0, 11 * place, place % 8 if fault == "up_flip" else 1)
        for frame in watch(rig, skin, 0.08):
            counts.check(frame)
        assert skin.losses.lost_on_wire - lost <= most
    assert PLACES // 2 <= skin.losses.lost_on_wire <= most * PLACES
    check_polls(skin)


@pytest.mark.needs("faults", "counts")
@pytest.mark.parametrize("size", [2, 5, 60, 300, 1000])
@pytest.mark.parametrize("fault", ["up_drop", "up_double"])
def test_a_burst_costs_what_it_touches(rig: Rig, skin: Skin, fault: str, size: int) -> None:
    watch(rig, skin, 0.3)
    counts = KnownCounts(rig)
    watch(rig, skin, 0.2)
    rig.faults.inject(fault, 0, 33, size)
    frames = watch(rig, skin, 0.5)
    for frame in frames:
        counts.check(frame)
    shortest = 40  # bytes of the smallest board's frame
    assert 1 <= skin.losses.lost_on_wire <= 2 + size // shortest
    check_polls(skin)


@pytest.mark.needs("faults", "counts")
def test_a_random_storm_on_the_wire_makes_no_wrong_count(rig: Rig, skin: Skin) -> None:
    watch(rig, skin, 0.3)
    counts = KnownCounts(rig)
    watch(rig, skin, 0.2)
    frames = []
    for turn in range(120):
        rig.faults.inject(UP[turn % 3], 0, (turn * 7919) % 900, 1 + turn % 7)
        frames += watch(rig, skin, 0.02)
        if turn % 20 == 0:
            counts.go_on()
    frames += watch(rig, skin, 0.5)
    for frame in frames:
        counts.check(frame)
    check_order(frames)
    check_polls(skin)


@pytest.mark.needs("faults")
@pytest.mark.parametrize("fault", DOWN)
@pytest.mark.parametrize("place", range(0, 16, 3))
def test_a_command_that_is_damaged_is_asked_again(rig: Rig, skin: Skin, fault: str, place: int) -> None:
    watch(rig, skin, 0.2)
    rig.faults.inject(fault, 0, place, 1)
    skin.hub.command(Command.GET_TIME)
    assert watch(rig, skin, 0.2)


@pytest.mark.needs("faults")
@pytest.mark.parametrize("fault", ["up_delay", "down_delay"])
def test_a_delay_loses_nothing(rig: Rig, skin: Skin, fault: str) -> None:
    watch(rig, skin, 0.3)
    for delay_ms in (5, 20, 80):
        rig.faults.inject(fault, 0, delay_ms)
        skin.hub.command(Command.GET_TIME)
        watch(rig, skin, 0.2)
    assert skin.losses.lost_on_wire == 0
    assert all(count.missing == 0 for count in skin.losses.boards.values())


@pytest.mark.needs("faults", "counts")
@pytest.mark.parametrize("seconds", [0.05, 0.3, 2.0])
def test_a_host_that_stops_reading_gets_whole_frames_afterwards(rig: Rig, skin: Skin, seconds: float) -> None:
    watch(rig, skin, 0.3)
    counts = KnownCounts(rig)
    watch(rig, skin, 0.2)
    rig.faults.inject("mute_host", 0, 1)
    rig.clock.wait(seconds)
    counts.go_on()
    rig.faults.inject("mute_host", 0, 0)
    frames = watch(rig, skin, 1.0)
    for frame in frames:
        counts.check(frame)
    check_order(frames)
    check_polls(skin)
    assert skin.losses.lost_on_wire == 0
    dropped = sum(fields["dropped"] for fields in skin.hub.board_status.values())
    if seconds <= 0.05:
        assert dropped == 0
    assert {frame.address for frame in frames[-40:]} == {board.address for board in rig.hand.boards}


@pytest.mark.needs("faults")
@pytest.mark.world(lines=["flow_control 1"])
def test_a_receiver_that_holds_the_host_back_loses_nothing(rig: Rig, skin: Skin) -> None:
    """The hub's CPU is away while 3,000 bytes arrive: they wait in the adapter, and the next command is obeyed."""
    watch(rig, skin, 0.3)
    for _ in range(3):
        rig.faults.inject("hub_stall", 0, 40)
        skin.link.write(b"\x55" * 3000 + b"\x00")
        skin.hub.command(Command.GET_TIME)
        frames = watch(rig, skin, 0.3)
        assert {frame.address for frame in frames} == {board.address for board in rig.hand.boards}
    assert not any("lost" in line for line in skin.hub.logs), list(skin.hub.logs)
    assert skin.losses.lost_on_wire == 0
    check_polls(skin)


@pytest.mark.needs("faults")
def test_a_receiver_that_overruns_is_counted_and_told(rig: Rig, skin: Skin) -> None:
    """The hub's CPU is away while 600 bytes arrive: its ring of 256 is full, what is lost is counted, it goes on."""
    watch(rig, skin, 0.3)
    rig.faults.inject("hub_stall", 0, 40)
    skin.link.write(b"\x55" * 600 + b"\x00")
    watch(rig, skin, 0.3)
    skin.hub.read_status()
    assert any("overrun" in line or "lost" in line for line in skin.hub.logs), list(skin.hub.logs)
    assert watch(rig, skin, 0.3)
