"""Power cycles of boards and hub."""

import contextlib
from collections.abc import Callable

import pytest

from hil_tests.harness.fault_cases import BOOT_S
from hil_tests.harness.frame_checks import (
    KnownCounts,
    check_polls,
    count_cycles_until_frame,
    get_address,
    read_counters,
    read_frames,
)
from hil_tests.harness.parts import PARTS
from hil_tests.harness.rig import Rig
from taxel.skin import Skin
from taxel_protocol import BoardFault
from taxel_protocol.names import ResetCause

REPLY_LIMIT_S = 0.15
"""Longest permitted time from power to the first reply of a board, seconds."""
GIVE_UP_S = 1.0
"""Time after which a test stops waiting for a reply, seconds."""
RECOVERY_CYCLES = 2


def get_boot_time_s(rig: Rig, address: int) -> float:
    """Return the time from power until the hub can identify a board, seconds.

    On an executed board the bootloader acknowledges first, as on hardware. The hub cannot identify the bootloader and
    repeats the identification after one second.
    """
    return 1.15 if address in rig.description.executed else BOOT_S


def cycle_power(rig: Rig, address: int, off_s: float = 0.1) -> float:
    """Switch the power of a board off and on again. Returns the rig's clock at which it was switched on, in seconds."""
    rig.power.switch(False, address)
    rig.clock.wait(off_s)
    rig.power.switch(True, address)
    return rig.clock.now_s()


def measure_reply_time(rig: Rig, has_reply: Callable[[], bool], start_s: float) -> float:
    """Repeat `has_reply` until it is true; `OSError` is treated as no reply.

    start_s: the rig's clock at power-on. Returns the time from power-on to the reply in seconds. Fails without a reply
    in `GIVE_UP_S`.
    """
    while True:
        with contextlib.suppress(OSError):
            if has_reply():
                return rig.clock.now_s() - start_s
        rig.clock.wait(0.001)
        assert rig.clock.now_s() - start_s < GIVE_UP_S, "no reply"


@pytest.mark.needs("i2c", "power", "faults")
@pytest.mark.parametrize("index", range(0, 17, 4))
def test_board_acknowledges_within_150_ms_after_power_on(rig: Rig, index: int) -> None:
    address = get_address(rig.hand, index)
    rig.clock.wait(0.3)
    power_on_s = cycle_power(rig, address)
    assert measure_reply_time(rig, lambda: rig.i2c.write_quick(address) is None, power_on_s) < REPLY_LIMIT_S


@pytest.mark.needs("i2c", "power", "faults")
@pytest.mark.world(lines=["boot_listens 1"])
@pytest.mark.parametrize("index", [0, 9])
def test_bootloader_that_receives_no_command_starts_the_application_within_150_ms(rig: Rig, index: int) -> None:
    """The application answers a read of its identity with the character T; the bootloader does not."""
    address = get_address(rig.hand, index)
    rig.clock.wait(0.5)
    power_on_s = cycle_power(rig, address)

    def is_application() -> bool:
        return rig.i2c.read_i2c_block_data(address, 0, 1) == [ord("T")]

    assert measure_reply_time(rig, is_application, power_on_s) < REPLY_LIMIT_S


@pytest.mark.needs("faults", "counts")
@pytest.mark.parametrize("index", range(17))
def test_reconnected_board_streams_correct_counts_within_two_cycles_and_its_faults_are_reported(
    rig: Rig, skin: Skin, index: int
) -> None:
    address = get_address(rig.hand, index)
    read_frames(rig, skin, 0.3)
    counts = KnownCounts(rig)
    read_frames(rig, skin, 0.2)
    rig.power.switch(False, address)
    frames = read_frames(rig, skin, 0.4)
    assert address not in {frame.address for frame in frames[-10:]}
    rig.power.switch(True, address)
    acknowledge_s = rig.clock.now_s() + get_boot_time_s(rig, address)
    frames += read_frames(rig, skin, 0.6 + get_boot_time_s(rig, address))
    for frame in frames:
        counts.check_frame(frame)
    assert count_cycles_until_frame(frames, address, 1e6 * acknowledge_s) <= RECOVERY_CYCLES
    reported_faults = [report["fault"] for report in skin.hub.faults if report["address"] == address]
    assert reported_faults[0] == BoardFault.NACK
    assert {BoardFault.RECOVERED, BoardFault.RESTARTED} <= set(reported_faults)
    check_polls(skin)


@pytest.mark.needs("faults", "counts")
def test_all_boards_stream_again_after_all_were_disconnected(rig: Rig, skin: Skin) -> None:
    read_frames(rig, skin, 0.3)
    counts = KnownCounts(rig)
    read_frames(rig, skin, 0.2)
    for board in rig.hand.boards:
        rig.power.switch(False, board.address)
    read_frames(rig, skin, 0.2)
    assert read_frames(rig, skin, 0.3) == []
    for board in rig.hand.boards:
        rig.power.switch(True, board.address)
    frames = read_frames(rig, skin, 1.0 + max(get_boot_time_s(rig, board.address) for board in rig.hand.boards))
    for frame in frames:
        counts.check_frame(frame)
    assert {frame.address for frame in frames[-40:]} == {board.address for board in rig.hand.boards}
    check_polls(skin)


@pytest.mark.needs("faults")
def test_loose_connector_of_a_board_increases_no_error_counter_of_another_board(rig: Rig, skin: Skin) -> None:
    address = get_address(rig.hand, 6)
    read_frames(rig, skin, 0.3)
    before = {board.address: read_counters(skin, board.address) for board in rig.hand.boards}
    for i in range(20):
        rig.power.switch(bool(i % 2), address)
        read_frames(rig, skin, 0.031 + 0.007 * (i % 5))
    rig.power.switch(True, address)
    read_frames(rig, skin, 0.4)
    for board in rig.hand.boards:
        after = read_counters(skin, board.address)
        if board.address != address:
            for name in ("nacks", "timeouts", "crc_errors", "bus_errors"):
                assert after[name] == before[board.address][name]
    check_polls(skin)


@pytest.mark.needs("power")
def test_all_boards_stream_after_a_power_cycle_of_the_hub(rig: Rig, skin: Skin) -> None:
    read_frames(rig, skin, 0.5)
    rig.power.switch(False)
    rig.clock.wait(0.3)
    rig.power.switch(True)
    read_frames(rig, skin, 1.5)
    frames = read_frames(rig, skin, 0.5)
    assert {frame.address for frame in frames} == {board.address for board in rig.hand.boards}
    assert skin.losses.restarts >= 1


@pytest.mark.needs("faults")
@pytest.mark.parametrize("delay_ms", [0, 7, 19, 33])
def test_all_boards_stream_after_a_brown_out_of_the_hub_which_reports_its_cause(
    rig: Rig, skin: Skin, delay_ms: int
) -> None:
    read_frames(rig, skin, 0.5)
    skin.hub.set_rate(8.0)  # a poll cycle takes 125 ms; the delays interrupt the cycle at different phases
    read_frames(rig, skin, 0.5 + 1e-3 * delay_ms)
    rig.faults.inject("hub_restart")
    read_frames(rig, skin, 1.0)
    frames = read_frames(rig, skin, 1.0)
    assert {frame.address for frame in frames} == {board.address for board in rig.hand.boards}
    assert skin.losses.restarts == 1
    records_brown_out = PARTS[rig.description.part].records_brown_out
    expected = ResetCause.BROWN_OUT if records_brown_out else ResetCause.POWER_ON
    assert skin.hub.last_handshake["reset_cause"] == expected


def test_reply_to_a_restart_is_complete_at_any_phase_of_the_stream(rig: Rig, skin: Skin) -> None:
    """If the reply is incomplete, `reboot` raises an error.

    The host repeats a command that has no reply. The restarted hub rejects the repeated command, because no protocol
    version has been agreed since the restart.
    A hub that restarts before its last bytes are sent fails at about one phase in twenty.
    """
    for number in range(60):
        read_frames(rig, skin, 0.03 + 2.9e-4 * number)
        skin.hub.reboot()
        read_frames(rig, skin, 0.1)


def test_reboot_command_restarts_the_hub_and_all_boards_stream_again(rig: Rig, skin: Skin) -> None:
    read_frames(rig, skin, 0.3)
    skin.hub.reboot()
    read_frames(rig, skin, 1.0)
    assert {frame.address for frame in read_frames(rig, skin, 0.5)} == {board.address for board in rig.hand.boards}
    assert skin.losses.restarts == 1
