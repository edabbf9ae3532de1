"""Commands of the host and replies of the hub."""

import itertools
from dataclasses import asdict

import pytest

from hil_tests.harness.frame_checks import check_polls, get_address, read_frames
from hil_tests.harness.rig import Rig
from taxel.hand.world import ScanSettings
from taxel.skin import Skin
from taxel.stream import HubError
from taxel_protocol import Command, FrameType, encode_frame
from taxel_protocol.frames import CommandPayload
from taxel_protocol.layout import pack


def test_handshake_reports_the_protocol_versions_of_the_hub(skin: Skin) -> None:
    assert skin.hub.last_handshake is not None
    assert skin.hub.last_handshake["version_min"] <= skin.hub.last_handshake["version_max"]
    assert skin.hub.handshake() == skin.hub.last_handshake["version_chosen"]


def test_status_counts_the_commands(skin: Skin) -> None:
    """Three commands follow the first status: GET_STATUS, GET_TIME, and the GET_STATUS that returns the counter."""
    skin.hub.read_status()
    assert skin.hub.status is not None
    before = skin.hub.status["commands"]
    skin.hub.read_status()
    skin.hub.command(Command.GET_TIME)
    skin.hub.read_status()
    assert skin.hub.status["commands"] == before + 3


def test_hub_clock_agrees_with_the_clock_of_the_rig(rig: Rig, skin: Skin) -> None:
    """The limits of 3 % and 0.04 s are larger than the tolerance of the oscillator, 2 %, and than the delay of the two
    replies in a USB adapter, up to 16 ms each.
    """
    times = []
    for _ in range(2):
        reply = skin.hub.command(Command.GET_TIME)
        times.append((rig.clock.now_s(), int.from_bytes(reply[:8], "little")))
        read_frames(rig, skin, 0.5)
    (first_s, first_us), (second_s, second_us) = times
    assert (second_us - first_us) / 1e6 == pytest.approx(second_s - first_s, rel=0.03, abs=0.04)


def test_unknown_command_is_rejected_and_counted(skin: Skin) -> None:
    with pytest.raises(HubError, match="unknown command"):
        skin.hub.command(99)
    skin.hub.read_status()
    assert skin.hub.status is not None
    assert skin.hub.status["commands_rejected"] >= 1


@pytest.mark.parametrize(
    ("command", "arguments"),
    [
        (Command.SET_RATE, b"\x00"),
        (Command.I2C_TRANSFER, b"\x20"),
        (Command.I2C_TRANSFER, bytes([0x20, 255])),
        (Command.SET_SCAN_SETTINGS, b"\x20\x01"),
        (Command.GET_BOARD_INFO, b""),
    ],
    ids=lambda value: value.name if isinstance(value, Command) else value.hex() or "nothing",
)
def test_invalid_arguments_are_rejected(skin: Skin, command: Command, arguments: bytes) -> None:
    with pytest.raises(HubError, match="bad arguments"):
        skin.hub.command(command, arguments)


def test_stop_ends_the_stream_and_start_resumes_it(rig: Rig, skin: Skin) -> None:
    skin.hub.stop()
    read_frames(rig, skin, 0.1)
    assert read_frames(rig, skin, 0.5) == []
    skin.hub.start()
    assert len(read_frames(rig, skin, 0.5)) > len(rig.hand.boards)
    check_polls(skin)


@pytest.mark.parametrize("delay_ms", [0, 11, 23, 37])
def test_frames_before_a_stop_and_after_a_start_are_in_different_cycles(rig: Rig, skin: Skin, delay_ms: int) -> None:
    """Frames of one cycle were measured at one time, so a cycle must not continue after a stop."""
    read_frames(rig, skin, 0.3 + 1e-3 * delay_ms)
    skin.hub.stop()
    cycles_before = {frame.cycle for frame in read_frames(rig, skin, 0.3)}
    skin.hub.start()
    frames = read_frames(rig, skin, 0.5)
    assert not cycles_before & {frame.cycle for frame in frames}
    for board in rig.hand.boards:
        cycles = [frame.cycle for frame in frames if frame.address == board.address]
        assert len(cycles) == len(set(cycles))
    assert all(count.missing == 0 for count in skin.losses.boards.values())


def test_repeated_start_and_stop_have_no_effect(rig: Rig, skin: Skin) -> None:
    for command in (skin.hub.start, skin.hub.start, skin.hub.stop, skin.hub.stop, skin.hub.start):
        command()
    assert len(read_frames(rig, skin, 0.5)) > len(rig.hand.boards)


def test_settings_for_a_missing_board_are_rejected(skin: Skin) -> None:
    unused_address = next(a for a in range(0x08, 0x78) if a not in {board.address for board in skin.hand.boards})
    with pytest.raises(HubError, match="unknown board"):
        skin.hub.set_scan_settings(asdict(ScanSettings()), unused_address)


def test_command_after_garbage_is_executed(rig: Rig, skin: Skin) -> None:
    for garbage in (b"\x00" * 3, b"\xff" * 40, bytes(range(256)), b"\x55" * 200):
        skin.link.write(garbage + b"\x00")
        skin.hub.command(Command.GET_TIME)
    assert read_frames(rig, skin, 0.2)


def test_truncated_command_is_not_executed(rig: Rig, skin: Skin) -> None:
    stop_frame = encode_frame(FrameType.COMMAND, 7, pack(CommandPayload, {"tag": 9, "command": int(Command.STOP)}))
    for size in range(1, len(stop_frame) - 1):  # the added zero replaces the delimiter at the end of the frame
        skin.link.write(stop_frame[:size] + b"\x00")
    assert len(read_frames(rig, skin, 0.5)) > len(rig.hand.boards)


@pytest.mark.parametrize("bit", range(8))
def test_command_with_a_flipped_bit_is_not_executed(rig: Rig, skin: Skin, bit: int) -> None:
    stop_frame = encode_frame(FrameType.COMMAND, 7, pack(CommandPayload, {"tag": 9, "command": int(Command.STOP)}))
    for index in range(1, len(stop_frame) - 1):  # all bytes between the delimiters
        damaged = bytearray(stop_frame)
        damaged[index] ^= 1 << bit
        skin.link.write(bytes(damaged) + b"\x00")
        skin.hub.wait(0.002)
    assert len(read_frames(rig, skin, 0.5)) > len(rig.hand.boards)


def test_transfer_through_the_hub_returns_all_bytes_of_every_size(skin: Skin) -> None:
    """Reads of 1 to 64 bytes from register 0 agree in the 58 bytes of the identity; later bytes are not specified."""
    address = get_address(skin.hand, 0)
    identity = b"".join(skin.hub.transfer(address, bytes([start]), 29) for start in (0, 29))
    for size in (1, 2, 31, 32, 33, 58, 64):
        assert skin.hub.transfer(address, bytes([0]), size)[:58] == identity[: min(size, 58)]


def test_bus_scan_during_streaming_loses_no_frame(rig: Rig, skin: Skin) -> None:
    assert set(skin.hub.scan_bus()) >= {board.address for board in rig.hand.boards}
    read_frames(rig, skin, 0.3)
    assert skin.losses.lost_on_wire == 0
    check_polls(skin)


@pytest.mark.parametrize("rate_hz", [1.0, 5.0, 10.0])
def test_rate_limit_is_applied_and_removed(rig: Rig, skin: Skin, rate_hz: float) -> None:
    """About 4 poll cycles run in 4 periods. Without the limit, more than 6 cycles run in 0.6 s (above 10 Hz)."""
    skin.hub.set_rate(rate_hz)
    read_frames(rig, skin, 1.2 / rate_hz)
    cycles = {frame.cycle for frame in read_frames(rig, skin, 4.0 / rate_hz)}
    assert 3 <= len(cycles) <= 6
    skin.hub.set_rate(None)
    read_frames(rig, skin, 1.2 / rate_hz)
    assert len({frame.cycle for frame in read_frames(rig, skin, 0.6)}) > 6


def test_commands_during_streaming_lose_no_frame(skin: Skin) -> None:
    """Each of 100 commands during streaming receives its reply."""
    for _ in range(100):
        skin.hub.command(Command.GET_TIME)
    for _ in itertools.islice(skin, 50):
        pass
    assert skin.losses.lost_on_wire == 0
