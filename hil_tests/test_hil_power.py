"""Boards and hub that lose their power and get it back."""

import contextlib
from collections.abc import Callable

import pytest

from hil_tests.harness.fault_cases import BOOT_S
from hil_tests.harness.rig import Rig
from hil_tests.harness.watching import KnownCounts, board_at, check_polls, counters_of, cycles_until, watch
from taxel.skin import Skin
from taxel_protocol import BoardFault

ACKNOWLEDGE_LIMIT_S = 0.15
AT_MOST_CYCLES = 2


def boot_s(rig: Rig, address: int) -> float:
    """From a board's power to its being itself for the hub. An executed one's bootloader acknowledges first, as on
    silicon: a board that the hub does not know, at which it looks again after a second.
    """
    return 1.15 if address in rig.description.executed else BOOT_S


def power_cycle(rig: Rig, address: int, off_s: float = 0.1) -> float:
    """A board loses its power and gets it back; when, on the rig's clock."""
    rig.power.switch(False, address)
    rig.clock.wait(off_s)
    rig.power.switch(True, address)
    return rig.clock.now_s()


def wait_until(rig: Rig, answers: Callable[[], bool], begun_s: float) -> None:
    """Until a board answers as it should; OSError is no answer. Fails after 150 ms."""
    while True:
        with contextlib.suppress(OSError):
            if answers():
                return
        rig.clock.wait(0.001)
        assert rig.clock.now_s() - begun_s < ACKNOWLEDGE_LIMIT_S, "no answer in 150 ms"


@pytest.mark.needs("i2c", "power", "faults")
@pytest.mark.parametrize("place", range(0, 17, 4))
def test_a_board_acknowledges_within_150_ms_of_its_power(rig: Rig, place: int) -> None:
    address = board_at(rig.hand, place)
    rig.clock.wait(0.3)
    wait_until(rig, lambda: rig.i2c.write_quick(address) is None, power_cycle(rig, address))


@pytest.mark.needs("i2c", "power", "faults")
@pytest.mark.world(lines=["boot_listens 1"])
@pytest.mark.parametrize("place", [0, 9])
def test_a_board_whose_bootloader_listens_first_is_itself_within_150_ms(rig: Rig, place: int) -> None:
    """Between bootloader and application nobody answers."""
    address = board_at(rig.hand, place)
    rig.clock.wait(0.5)
    wait_until(rig, lambda: rig.i2c.read_i2c_block_data(address, 0, 1) == [ord("T")], power_cycle(rig, address))


@pytest.mark.needs("faults", "counts")
@pytest.mark.parametrize("place", range(17))
def test_any_board_plugged_again_streams_within_two_cycles(rig: Rig, skin: Skin, place: int) -> None:
    address = board_at(rig.hand, place)
    watch(rig, skin, 0.3)
    counts = KnownCounts(rig)
    watch(rig, skin, 0.2)
    rig.power.switch(False, address)
    frames = watch(rig, skin, 0.4)
    assert address not in {frame.address for frame in frames[-10:]}
    rig.power.switch(True, address)
    acknowledges_s = rig.clock.now_s() + boot_s(rig, address)
    frames += watch(rig, skin, 0.6 + boot_s(rig, address))
    for frame in frames:
        counts.check(frame)
    assert cycles_until(frames, address, 1e6 * acknowledges_s) <= AT_MOST_CYCLES
    told = [report["fault"] for report in skin.hub.faults if report["address"] == address]
    assert told[0] == BoardFault.NACK
    assert {BoardFault.RECOVERED, BoardFault.RESTARTED} <= set(told)
    check_polls(skin)


@pytest.mark.needs("faults", "counts")
def test_all_boards_unplugged_at_once_come_back(rig: Rig, skin: Skin) -> None:
    watch(rig, skin, 0.3)
    counts = KnownCounts(rig)
    watch(rig, skin, 0.2)
    for board in rig.hand.boards:
        rig.power.switch(False, board.address)
    watch(rig, skin, 0.2)
    assert watch(rig, skin, 0.3) == []
    for board in rig.hand.boards:
        rig.power.switch(True, board.address)
    frames = watch(rig, skin, 1.0 + max(boot_s(rig, board.address) for board in rig.hand.boards))
    for frame in frames:
        counts.check(frame)
    assert {frame.address for frame in frames[-40:]} == {board.address for board in rig.hand.boards}
    check_polls(skin)


@pytest.mark.needs("faults")
def test_a_loose_plug_loses_only_its_own_board(rig: Rig, skin: Skin) -> None:
    address = board_at(rig.hand, 6)
    watch(rig, skin, 0.3)
    before = {board.address: counters_of(skin, board.address) for board in rig.hand.boards}
    for turn in range(20):
        rig.power.switch(bool(turn % 2), address)
        watch(rig, skin, 0.031 + 0.007 * (turn % 5))
    rig.power.switch(True, address)
    watch(rig, skin, 0.4)
    for board in rig.hand.boards:
        after = counters_of(skin, board.address)
        if board.address != address:
            for name in ("nacks", "timeouts", "crc_errors", "bus_errors"):
                assert after[name] == before[board.address][name]
    check_polls(skin)


@pytest.mark.needs("power")
def test_after_power_returns_the_hub_handshake_and_streaming_are_restored(rig: Rig, skin: Skin) -> None:
    watch(rig, skin, 0.5)
    rig.power.switch(False)
    rig.clock.wait(0.3)
    rig.power.switch(True)
    watch(rig, skin, 1.5)
    frames = watch(rig, skin, 0.5)
    assert {frame.address for frame in frames} == {board.address for board in rig.hand.boards}
    assert skin.losses.restarts >= 1


@pytest.mark.needs("faults")
@pytest.mark.parametrize("delay_ms", [0, 7, 19, 33])
def test_a_hub_that_browns_out_anywhere_in_a_cycle_comes_back(rig: Rig, skin: Skin, delay_ms: int) -> None:
    watch(rig, skin, 0.5)
    skin.hub.set_rate(8.0)
    watch(rig, skin, 0.5 + 1e-3 * delay_ms)
    rig.faults.inject("hub_restart")
    watch(rig, skin, 1.0)
    frames = watch(rig, skin, 1.0)
    assert {frame.address for frame in frames} == {board.address for board in rig.hand.boards}
    assert skin.losses.restarts == 1
    assert skin.hub.last_handshake["reset_cause"] == 1


def test_a_hub_that_is_told_to_restart_does(rig: Rig, skin: Skin) -> None:
    watch(rig, skin, 0.3)
    skin.hub.reboot()
    watch(rig, skin, 1.0)
    assert {frame.address for frame in watch(rig, skin, 0.5)} == {board.address for board in rig.hand.boards}
    assert skin.losses.restarts == 1
