"""Lost, changed, doubled and delayed bytes on the UART, and hosts that stop reading: only affected frames are lost."""

import pytest

from hil_tests.harness.frame_checks import KnownCounts, check_order, check_polls, read_frames
from hil_tests.harness.rig import Rig
from taxel.skin import Skin
from taxel_protocol import Command

FAULTS_TO_HOST = ("up_flip", "up_drop", "up_double")
FAULTS_TO_HUB = ("down_flip", "down_drop", "down_double")
N_FAULTS = 40


@pytest.mark.needs("uart_faults", "counts")
@pytest.mark.parametrize("fault", FAULTS_TO_HOST)
def test_one_damaged_byte_loses_only_the_frames_that_contain_it(rig: Rig, skin: Skin, fault: str) -> None:
    """The delimiter between two frames belongs to both, so a lost or doubled byte may cost two frames.

    The lower limit of the losses, a frame for every second fault, shows that the faults take effect.
    """
    read_frames(rig, skin, 0.3)
    counts = KnownCounts(rig)
    read_frames(rig, skin, 0.2)
    max_lost = 2 if fault != "up_flip" else 1
    for i in range(N_FAULTS):
        lost_before = skin.losses.lost_on_wire
        rig.faults.inject(fault, 0, 11 * i, i % 8 if fault == "up_flip" else 1)
        for frame in read_frames(rig, skin, 0.08):
            counts.check_frame(frame)
        assert skin.losses.lost_on_wire - lost_before <= max_lost
    assert N_FAULTS // 2 <= skin.losses.lost_on_wire <= max_lost * N_FAULTS
    check_polls(skin)


@pytest.mark.needs("uart_faults", "counts")
@pytest.mark.parametrize("size", [2, 5, 60, 300, 1000])
@pytest.mark.parametrize("fault", ["up_drop", "up_double"])
def test_burst_loses_only_the_frames_that_contain_it(rig: Rig, skin: Skin, fault: str, size: int) -> None:
    """A burst of `size` bytes lies in at most `size` // 40 + 2 frames of 40 bytes or more: its ends cut two frames."""
    read_frames(rig, skin, 0.3)
    counts = KnownCounts(rig)
    read_frames(rig, skin, 0.2)
    rig.faults.inject(fault, value=33, second_value=size)  # after the next 33 bytes, `size` bytes are lost or doubled
    frames = read_frames(rig, skin, 0.5)
    for frame in frames:
        counts.check_frame(frame)
    shortest_frame = 40  # bytes of a frame of the board with the fewest taxels
    assert 1 <= skin.losses.lost_on_wire <= 2 + size // shortest_frame
    check_polls(skin)


@pytest.mark.needs("uart_faults", "counts")
def test_many_random_uart_faults_cause_no_wrong_count(rig: Rig, skin: Skin) -> None:
    """120 faults at pseudo-random positions within the next 900 bytes; frames may be lost, but not be wrong."""
    read_frames(rig, skin, 0.3)
    counts = KnownCounts(rig)
    read_frames(rig, skin, 0.2)
    frames = []
    for i in range(120):
        rig.faults.inject(FAULTS_TO_HOST[i % 3], 0, (i * 7919) % 900, 1 + i % 7)
        frames += read_frames(rig, skin, 0.02)
        if i % 20 == 0:
            counts.advance()
    frames += read_frames(rig, skin, 0.5)
    for frame in frames:
        counts.check_frame(frame)
    check_order(frames)
    check_polls(skin)


@pytest.mark.needs("uart_faults")
@pytest.mark.parametrize("fault", FAULTS_TO_HUB)
@pytest.mark.parametrize("n_bytes", range(0, 16, 3))
def test_command_damaged_on_the_uart_is_repeated_until_the_hub_replies(
    rig: Rig, skin: Skin, fault: str, n_bytes: int
) -> None:
    """The command returns although its byte number `n_bytes` is damaged once; without a reply it would raise."""
    read_frames(rig, skin, 0.2)
    rig.faults.inject(fault, 0, n_bytes, 1)
    skin.hub.command(Command.GET_TIME)
    assert read_frames(rig, skin, 0.2)


@pytest.mark.needs("uart_faults")
@pytest.mark.parametrize("fault", ["up_delay", "down_delay"])
def test_delay_loses_no_frame(rig: Rig, skin: Skin, fault: str) -> None:
    """Bytes to the host ("up") or to the hub ("down") are delayed by 5, 20 and 80 ms while the skin streams."""
    read_frames(rig, skin, 0.3)
    for delay_ms in (5, 20, 80):
        rig.faults.inject(fault, 0, delay_ms)
        skin.hub.command(Command.GET_TIME)
        read_frames(rig, skin, 0.2)
    assert skin.losses.lost_on_wire == 0
    assert all(count.missing == 0 for count in skin.losses.boards.values())


@pytest.mark.needs("faults", "counts")
@pytest.mark.parametrize("seconds", [0.05, 0.3, 2.0])
def test_host_that_pauses_reading_receives_complete_frames_afterwards(rig: Rig, skin: Skin, seconds: float) -> None:
    """A full hub omits whole frames, never parts of a frame; it buffers all frames of a pause of 0.05 s."""
    read_frames(rig, skin, 0.3)
    counts = KnownCounts(rig)
    read_frames(rig, skin, 0.2)
    rig.faults.inject("mute_host", 0, 1)
    rig.clock.wait(seconds)
    counts.advance()
    rig.faults.inject("mute_host", 0, 0)
    frames = read_frames(rig, skin, 1.0)
    for frame in frames:
        counts.check_frame(frame)
    check_order(frames)
    check_polls(skin)
    assert skin.losses.lost_on_wire == 0
    dropped = sum(fields["dropped"] for fields in skin.hub.board_status.values())
    if seconds <= 0.05:
        assert dropped == 0
    assert {frame.address for frame in frames[-40:]} == {board.address for board in rig.hand.boards}


@pytest.mark.needs("faults")
@pytest.mark.world(lines=["flow_control 1"])
def test_flow_control_prevents_losses_of_the_receiver(rig: Rig, skin: Skin) -> None:
    """3,000 bytes arrive while the hub's CPU is stalled: the adapter buffers them, and the next command is executed."""
    read_frames(rig, skin, 0.3)
    for _ in range(3):
        rig.faults.inject("hub_stall", 0, 40)
        skin.link.write(b"\x55" * 3000 + b"\x00")
        skin.hub.command(Command.GET_TIME)
        frames = read_frames(rig, skin, 0.3)
        assert {frame.address for frame in frames} == {board.address for board in rig.hand.boards}
    assert not any("lost" in line for line in skin.hub.logs), list(skin.hub.logs)
    assert skin.losses.lost_on_wire == 0
    check_polls(skin)


@pytest.mark.needs("uart_faults")
def test_receiver_overrun_is_counted_and_logged(rig: Rig, skin: Skin) -> None:
    """600 bytes arrive while the hub's CPU is stalled and overrun its ring buffer of 256 bytes; streaming continues."""
    read_frames(rig, skin, 0.3)
    rig.faults.inject("hub_stall", 0, 40)
    skin.link.write(b"\x55" * 600 + b"\x00")
    read_frames(rig, skin, 0.3)
    skin.hub.read_status()
    assert any("overrun" in line or "lost" in line for line in skin.hub.logs), list(skin.hub.logs)
    assert read_frames(rig, skin, 0.3)
