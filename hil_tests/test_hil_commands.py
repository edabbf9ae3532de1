"""What a host asks of the hub, and what it answers."""

import itertools
from dataclasses import asdict

import pytest

from hil_tests.harness.rig import Rig
from hil_tests.harness.watching import board_at, check_polls, watch
from taxel.hand.world import ScanSettings
from taxel.skin import Skin
from taxel.stream import HubError
from taxel_protocol import Command, FrameType, encode_frame
from taxel_protocol.frames import CommandPayload
from taxel_protocol.layout import pack


def test_the_hub_says_what_it_is(skin: Skin) -> None:
    assert skin.hub.last_handshake is not None
    assert skin.hub.last_handshake["version_min"] <= skin.hub.last_handshake["version_max"]
    assert skin.hub.handshake() == skin.hub.last_handshake["version_chosen"]


def test_status_counts_what_was_asked(skin: Skin) -> None:
    skin.hub.read_status()
    assert skin.hub.status is not None
    before = skin.hub.status["commands"]
    skin.hub.read_status()
    skin.hub.command(Command.GET_TIME)
    skin.hub.read_status()
    assert skin.hub.status["commands"] == before + 3


def test_the_hubs_time_goes_with_the_rigs(rig: Rig, skin: Skin) -> None:
    times = []
    for _ in range(2):
        reply = skin.hub.command(Command.GET_TIME)
        times.append((rig.clock.now_s(), int.from_bytes(reply[:8], "little")))
        watch(rig, skin, 0.5)
    (first_s, first_us), (second_s, second_us) = times
    assert (second_us - first_us) / 1e6 == pytest.approx(second_s - first_s, rel=0.03, abs=0.04)


def test_an_unknown_command_is_refused_and_counted(skin: Skin) -> None:
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
def test_bad_arguments_are_refused(skin: Skin, command: Command, arguments: bytes) -> None:
    with pytest.raises(HubError, match="bad arguments"):
        skin.hub.command(command, arguments)


def test_a_stopped_stream_is_silent_and_starts_again(rig: Rig, skin: Skin) -> None:
    skin.hub.stop()
    watch(rig, skin, 0.1)
    assert watch(rig, skin, 0.5) == []
    skin.hub.start()
    assert len(watch(rig, skin, 0.5)) > len(rig.hand.boards)
    check_polls(skin)


@pytest.mark.parametrize("delay_ms", [0, 11, 23, 37])
def test_a_stop_in_the_middle_of_a_cycle_does_not_mix_two_times(rig: Rig, skin: Skin, delay_ms: int) -> None:
    """Frames of one cycle show the skin at one time: those before the stop and after the start are not of one cycle."""
    watch(rig, skin, 0.3 + 1e-3 * delay_ms)
    skin.hub.stop()
    before = {frame.cycle for frame in watch(rig, skin, 0.3)}
    skin.hub.start()
    frames = watch(rig, skin, 0.5)
    assert not before & {frame.cycle for frame in frames}
    for board in rig.hand.boards:
        cycles = [frame.cycle for frame in frames if frame.address == board.address]
        assert len(cycles) == len(set(cycles))
    assert all(count.missing == 0 for count in skin.losses.boards.values())


def test_start_twice_and_stop_twice_are_harmless(rig: Rig, skin: Skin) -> None:
    for command in (skin.hub.start, skin.hub.start, skin.hub.stop, skin.hub.stop, skin.hub.start):
        command()
    assert len(watch(rig, skin, 0.5)) > len(rig.hand.boards)


def test_settings_for_a_board_that_is_not_there_are_refused(skin: Skin) -> None:
    free = next(a for a in range(0x08, 0x78) if a not in {board.address for board in skin.hand.boards})
    with pytest.raises(HubError, match="unknown board"):
        skin.hub.set_scan_settings(asdict(ScanSettings()), free)


def test_garbage_before_a_command_does_not_hurt_it(rig: Rig, skin: Skin) -> None:
    for garbage in (b"\x00" * 3, b"\xff" * 40, bytes(range(256)), b"\x55" * 200):
        skin.link.write(garbage + b"\x00")
        skin.hub.command(Command.GET_TIME)
    assert watch(rig, skin, 0.2)


def test_a_command_cut_short_is_never_carried_out(rig: Rig, skin: Skin) -> None:
    whole = encode_frame(FrameType.COMMAND, 7, pack(CommandPayload, {"tag": 9, "command": int(Command.STOP)}))
    for size in range(1, len(whole) - 1):  # without its last byte, the end mark, it is whole
        skin.link.write(whole[:size] + b"\x00")
    assert len(watch(rig, skin, 0.5)) > len(rig.hand.boards)


@pytest.mark.parametrize("bit", range(8))
def test_a_command_with_a_flipped_bit_is_never_carried_out(rig: Rig, skin: Skin, bit: int) -> None:
    whole = encode_frame(FrameType.COMMAND, 7, pack(CommandPayload, {"tag": 9, "command": int(Command.STOP)}))
    for place in range(1, len(whole) - 1):  # between the marks
        damaged = bytearray(whole)
        damaged[place] ^= 1 << bit
        skin.link.write(bytes(damaged) + b"\x00")
        skin.hub.wait(0.002)
    assert len(watch(rig, skin, 0.5)) > len(rig.hand.boards)


def test_every_pass_through_size_comes_back_whole(skin: Skin) -> None:
    address = board_at(skin.hand, 0)
    whole = b"".join(skin.hub.transfer(address, bytes([start]), 29) for start in (0, 29))
    for size in (1, 2, 31, 32, 33, 58, 64):
        assert skin.hub.transfer(address, bytes([0]), size)[:58] == whole[: min(size, 58)]


def test_a_scan_of_the_bus_while_it_streams_loses_nothing(rig: Rig, skin: Skin) -> None:
    found = skin.hub.scan_bus()
    assert set(found) >= {board.address for board in rig.hand.boards}
    watch(rig, skin, 0.3)
    assert skin.losses.lost_on_wire == 0
    check_polls(skin)


@pytest.mark.parametrize("rate_hz", [1.0, 5.0, 10.0])
def test_a_rate_limit_is_kept_to_and_lifted(rig: Rig, skin: Skin, rate_hz: float) -> None:
    skin.hub.set_rate(rate_hz)
    watch(rig, skin, 1.2 / rate_hz)
    cycles = {frame.cycle for frame in watch(rig, skin, 4.0 / rate_hz)}
    assert 3 <= len(cycles) <= 6
    skin.hub.set_rate(None)
    watch(rig, skin, 1.2 / rate_hz)
    assert len({frame.cycle for frame in watch(rig, skin, 0.6)}) > 6


def test_frames_and_commands_share_the_wire(skin: Skin) -> None:
    """A hundred commands while it streams: every reply comes, no frame is lost."""
    for _ in range(100):
        skin.hub.command(Command.GET_TIME)
    for _ in itertools.islice(skin, 50):
        pass
    assert skin.losses.lost_on_wire == 0
