"""Opening a skin: the frames of its boards, missing and unknown boards, and one-line errors of port, hub and boards."""

import itertools
import threading

import numpy as np
import pytest

import taxel
from taxel.errors import TaxelError
from taxel.hand import Board, BoardKind, Hand, UnknownBoardError
from taxel.hand.world import WorldSettings, format_world
from taxel.link import EmulatorLink, LinkError, write_stimulus
from taxel.skin import BoardMismatchError, Skin
from taxel.stream import HubError, VersionError, hub_client
from taxel_protocol import Command

FAST_EMULATOR = "emulator:?speed=max&duration_s=2"
LARGEST_FRAME_BYTES = 600


def read_single_line(error):
    """Check that an exception is a TaxelError with a non-empty one-line text, and return this text."""
    assert isinstance(error, TaxelError)
    assert str(error)
    assert "\n" not in str(error)
    return str(error)


@pytest.mark.parametrize("name", ["allegro", "flat8"])
def test_every_packaged_hand_streams_frames_of_all_boards(name):
    with taxel.open(FAST_EMULATOR, name) as skin:
        assert skin.missing_boards == []
        assert sorted(skin.hub.boards) == [board.address for board in skin.hand.boards]
        frames = list(skin)
        assert {frame.address for frame in frames} == set(skin.hub.boards)
        assert skin.losses.lost_on_wire == 0
        assert skin.bytes_discarded < LARGEST_FRAME_BYTES  # the frame that the end of the emulation truncated
        for frame in frames:
            assert frame.raw_counts.dtype == np.uint16
            assert len(frame.raw_counts) == skin.hand.get_board(frame.address).kind.taxel_count


def test_frames_of_a_board_arrive_in_order_and_once():
    with taxel.open(FAST_EMULATOR, "flat8") as skin:
        frames = list(skin)
    sequences = [frame.sequence for frame in frames]
    assert sequences == list(range(sequences[0], sequences[0] + len(frames)))
    times_s = [
        frame.time_s for frame in frames if frame.hub_time_us > 1_000_000
    ]  # after 1 s, from the clock of the board
    assert times_s == sorted(times_s)
    assert all(a.cycle < b.cycle for a, b in itertools.pairwise(frames))


def test_a_hand_can_be_given_as_name_file_or_object(tmp_path, flat8):
    from importlib import resources

    path = tmp_path / "hand.toml"
    path.write_bytes(resources.files("taxel.hand").joinpath("descriptions", "flat8.toml").read_bytes())
    for hand in ("flat8", path, str(path), flat8):
        with taxel.open(FAST_EMULATOR, hand) as skin:
            assert skin.hand == flat8
            assert next(iter(skin)).address == 0x40


def test_the_requested_rate_is_an_upper_limit():
    with taxel.open(FAST_EMULATOR, "flat8", rate_hz=20.0) as skin:
        frames = list(skin)
    periods_us = np.diff([frame.hub_time_us for frame in frames]) % 2**32
    assert len(periods_us) > 20
    assert periods_us[1:].min() > 49_000  # the first cycle may have to identify its boards before it polls them
    assert np.median(periods_us) < 51_000


@pytest.mark.parametrize("rate_hz", [0.0, -1.0, float("nan"), 1e-9])
def test_an_invalid_rate_is_refused(rate_hz):
    with pytest.raises((TaxelError, ValueError)) as caught:
        taxel.open(FAST_EMULATOR, "flat8", rate_hz=rate_hz).close()
    assert "rate" in str(caught.value)
    assert not isinstance(caught.value, ArithmeticError)


def format_world_without(hand, *addresses):
    """Return the world file of a hand without the boards at the given addresses."""
    boards = tuple(board for board in hand.boards if board.address not in addresses)
    return format_world(Hand(hand.name, hand.description, hand.pitch_m, hand.size_m, boards))


def test_a_missing_board_is_named_and_the_other_boards_stream(allegro):
    missing_board = allegro.boards[3]
    skin = Skin(EmulatorLink(format_world_without(allegro, missing_board.address), fast=True, duration_s=3.0), allegro)
    assert skin.missing_boards == [missing_board.name]
    assert {frame.address for frame in skin} == {board.address for board in allegro.boards} - {missing_board.address}
    skin.close()


def test_a_skin_without_boards_can_be_opened_and_lists_them_as_missing(flat8, allegro):
    world = format_world(flat8, WorldSettings(faults=("0.0 unplug 0x40",)))
    skin = Skin(EmulatorLink(world, fast=True, duration_s=3.0), flat8)
    assert skin.missing_boards == ["flat8"]
    assert list(skin) == []
    with pytest.raises(TaxelError, match="0 scans"):
        skin.take_baseline()
    skin.close()


def test_a_board_that_starts_within_400_ms_is_not_missing(flat8):
    skin = Skin(EmulatorLink(format_world(flat8, WorldSettings(boot_ms=400.0)), fast=True, duration_s=3.0), flat8)
    assert skin.missing_boards == []
    skin.close()


def test_a_board_that_is_not_in_the_hand_description_gives_one_error_line(allegro, flat8):
    with pytest.raises(UnknownBoardError, match=r"hand 'flat8' has no board 0x\w\w") as caught:
        Skin(EmulatorLink(format_world(allegro)), flat8)
    read_single_line(caught.value)


@pytest.mark.parametrize("change", ["one taxel less", "lines swapped", "other crossings"])
def test_a_board_with_another_crossing_map_gives_one_error_line(flat8, change):
    connected_crossings = np.ones((8, 8), dtype=bool)
    if change == "one taxel less":
        connected_crossings[7, 7] = False
    elif change == "lines swapped":
        connected_crossings = np.ones((4, 16), dtype=bool)
    described_crossings = connected_crossings.copy()
    if change == "other crossings":
        connected_crossings = np.ones((8, 9), dtype=bool)
        connected_crossings[:, 8] = False
        described_crossings = np.ones((8, 9), dtype=bool)
        described_crossings[:, 0] = False
        connected_hand = Hand(
            "connected", "", 0.005, 0.003, (Board("b", BoardKind("k", 8, connected_crossings), 0x40),)
        )
    else:
        connected_hand = flat8
    hand = Hand("mine", "", 0.005, 0.003, (Board("patch", BoardKind("k", 8, described_crossings), 0x40),))
    with pytest.raises(BoardMismatchError, match=r"board 0x40 .* hand 'mine' has patch there, kind k") as caught:
        Skin(EmulatorLink(format_world(connected_hand)), hand)
    read_single_line(caught.value)


def test_a_failed_opening_leaves_no_thread_running(allegro, flat8):
    before = set(threading.enumerate())
    with pytest.raises(UnknownBoardError):
        Skin(EmulatorLink(format_world(allegro)), flat8)
    assert set(threading.enumerate()) <= before


def test_a_port_without_a_hub_gives_one_error_line(silent_port, monkeypatch):
    monkeypatch.setattr(hub_client, "REPLY_TIMEOUT_S", 0.1)
    with pytest.raises(HubError, match=r"no reply from a hub after \d attempts.*1000000") as caught:
        taxel.open(silent_port, "flat8")
    assert silent_port.removeprefix("serial://") in read_single_line(caught.value)


def test_a_port_that_only_echoes_is_refused(monkeypatch):
    monkeypatch.setattr(hub_client, "REPLY_TIMEOUT_S", 0.1)
    with pytest.raises(HubError, match="no reply from a hub"):
        taxel.open("loop://", "flat8")


def test_a_hub_of_an_unsupported_protocol_version_gives_one_error_line(fake_hub):
    hub = fake_hub(version_chosen=0, version_min=4, version_max=5)
    with pytest.raises(VersionError, match="protocol 4 to 5, this program 1 to 3; update the older") as caught:
        taxel.open(hub.url, "flat8")
    assert hub.url.removeprefix("serial://") in read_single_line(caught.value)
    assert hub.commands == []


def test_opening_a_skin_requests_board_information_then_sets_the_rate_then_starts(fake_hub, monkeypatch):
    monkeypatch.setattr("taxel.skin.skin.DISCOVERY_TIMEOUT_S", 0.1)
    hub = fake_hub()
    skin = taxel.open(hub.url, "flat8")
    assert skin.missing_boards == ["flat8"]
    command_order = list(dict.fromkeys(hub.commands))  # without repetitions
    assert command_order == [Command.GET_BOARD_INFO, Command.SET_RATE, Command.START]
    skin.close()


@pytest.mark.parametrize("options", ["duration_s=0.01", "duration_s=0.001&speed=max"])
def test_an_emulation_that_ends_before_the_handshake_gives_one_error_line(options):
    with pytest.raises(TaxelError) as caught:
        taxel.open(f"emulator:?{options}", "flat8")
    read_single_line(caught.value)


def test_an_unsuitable_stimulus_gives_the_one_line_error_of_the_emulator(tmp_path):
    path = tmp_path / "a.stm"
    write_stimulus(path, [0.0], np.zeros((1, 3)))
    for _ in range(5):  # two threads can report the error; either may be the first
        with pytest.raises(LinkError, match="expected values for 64 taxels, found 3") as caught:
            taxel.open(f"emulator:?speed=max&stimulus={path}", "flat8")
        read_single_line(caught.value)


def test_a_skin_can_be_closed_twice():
    skin = taxel.open(FAST_EMULATOR, "flat8")
    skin.close()
    skin.close()
    with taxel.open(FAST_EMULATOR, "flat8") as skin:
        skin.close()


def test_commands_are_answered_while_frames_are_streamed(flat8):
    with taxel.open("emulator:", "flat8") as skin:
        frames = iter(skin)
        for _ in range(3):
            next(frames)
        assert skin.hub.scan_bus() == [0x40]
        assert skin.hub.transfer(0x40, bytes([0]), 1) == b"T"  # register 0: the first letter of the identity
        with pytest.raises(HubError, match="nack"):
            skin.hub.transfer(0x41, b"", 1)  # no board has this address
        with pytest.raises(HubError, match="bad arguments"):
            skin.hub.transfer(0x40, b"", 255)
        skin.hub.read_status()
        assert skin.hub.status is not None
        assert skin.hub.status["boards_streaming"] == 1
        assert next(frames).address == 0x40
