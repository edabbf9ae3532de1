"""Opening a skin gives frames at once; whatever is wrong with port, hub or boards is one line."""

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

FAST = "emulator:?speed=max&duration_s=2"


def one_line(error):
    assert isinstance(error, TaxelError)
    assert str(error)
    assert "\n" not in str(error)
    return str(error)


@pytest.mark.parametrize("name", ["allegro", "flat8"])
def test_every_packaged_hand_streams(name):
    with taxel.open(FAST, name) as skin:
        assert skin.missing_boards == []
        assert sorted(skin.hub.boards) == [board.address for board in skin.hand.boards]
        frames = list(skin)
        assert {frame.address for frame in frames} == set(skin.hub.boards)
        assert skin.losses.lost_on_wire == 0
        assert skin.bytes_discarded < 600  # the frame that the end of the emulation cut
        for frame in frames:
            assert frame.raw_counts.dtype == np.uint16
            assert len(frame.raw_counts) == skin.hand.get_board(frame.address).kind.taxel_count


def test_frames_of_a_board_come_in_order_and_once():
    with taxel.open(FAST, "flat8") as skin:
        frames = list(skin)
    sequences = [frame.sequence for frame in frames]
    assert sequences == list(range(sequences[0], sequences[0] + len(frames)))
    times = [frame.time_s for frame in frames if frame.hub_time_us > 1_000_000]  # from its own clock by then
    assert times == sorted(times)
    assert all(a.cycle < b.cycle for a, b in itertools.pairwise(frames))


def test_a_hand_may_be_given_as_name_file_or_object(tmp_path, flat8):
    from importlib import resources

    path = tmp_path / "mine.toml"
    path.write_bytes(resources.files("taxel.hand").joinpath("descriptions", "flat8.toml").read_bytes())
    for hand in ("flat8", path, str(path), flat8):
        with taxel.open(FAST, hand) as skin:
            assert skin.hand == flat8
            assert next(iter(skin)).address == 0x40


def test_a_rate_is_an_upper_limit():
    with taxel.open(FAST, "flat8", rate_hz=20.0) as skin:
        frames = list(skin)
    steps = np.diff([frame.hub_time_us for frame in frames]) % 2**32
    assert len(steps) > 20
    assert steps[1:].min() > 49_000  # the first cycle may have to identify its boards before it polls them
    assert np.median(steps) < 51_000


@pytest.mark.parametrize("rate_hz", [0.0, -1.0, float("nan"), 1e-9])
def test_a_senseless_rate_is_refused_in_one_line(rate_hz):
    with pytest.raises((TaxelError, ValueError)) as caught:
        taxel.open(FAST, "flat8", rate_hz=rate_hz).close()
    assert "rate" in str(caught.value)
    assert not isinstance(caught.value, ArithmeticError)


def without(hand, *addresses):
    """The world of a hand whose boards at these addresses are not plugged in."""
    boards = tuple(board for board in hand.boards if board.address not in addresses)
    return format_world(Hand(hand.name, hand.description, hand.pitch_m, hand.size_m, boards))


def test_a_board_that_is_not_there_is_named_and_the_others_stream(allegro):
    gone = allegro.boards[3]
    skin = Skin(EmulatorLink(without(allegro, gone.address), fast=True, duration_s=3.0), allegro)
    assert skin.missing_boards == [gone.name]
    assert {frame.address for frame in skin} == {board.address for board in allegro.boards} - {gone.address}
    skin.close()


def test_a_skin_without_any_board_can_be_opened_and_says_so(flat8, allegro):
    world = format_world(flat8, WorldSettings(faults=("0.0 unplug 0x40",)))
    skin = Skin(EmulatorLink(world, fast=True, duration_s=3.0), flat8)
    assert skin.missing_boards == ["flat8"]
    assert list(skin) == []
    with pytest.raises(TaxelError, match="0 scans"):
        skin.take_baseline()
    skin.close()


def test_a_board_that_starts_slowly_is_waited_for(flat8):
    skin = Skin(EmulatorLink(format_world(flat8, WorldSettings(boot_ms=400.0)), fast=True, duration_s=3.0), flat8)
    assert skin.missing_boards == []
    skin.close()


def test_a_board_that_the_hand_does_not_have_is_named(allegro, flat8):
    with pytest.raises(UnknownBoardError, match=r"hand 'flat8' has no board 0x\w\w") as caught:
        Skin(EmulatorLink(format_world(allegro)), flat8)
    one_line(caught.value)


@pytest.mark.parametrize("change", ["one taxel less", "lines swapped", "other crossings"])
def test_a_board_of_another_design_is_named(flat8, change):
    crossings = np.ones((8, 8), dtype=bool)
    if change == "one taxel less":
        crossings[7, 7] = False
    elif change == "lines swapped":
        crossings = np.ones((4, 16), dtype=bool)
    wanted = crossings.copy()
    if change == "other crossings":
        crossings = np.ones((8, 9), dtype=bool)
        crossings[:, 8] = False
        wanted = np.ones((8, 9), dtype=bool)
        wanted[:, 0] = False
        there = Hand("there", "", 0.005, 0.003, (Board("b", BoardKind("k", 8, crossings), 0x40),))
    else:
        there = flat8
    hand = Hand("mine", "", 0.005, 0.003, (Board("patch", BoardKind("k", 8, wanted), 0x40),))
    with pytest.raises(BoardMismatchError, match=r"board 0x40 .* hand 'mine' has patch there, kind k") as caught:
        Skin(EmulatorLink(format_world(there)), hand)
    one_line(caught.value)


def test_a_failed_opening_leaves_no_thread_behind(allegro, flat8):
    before = set(threading.enumerate())
    with pytest.raises(UnknownBoardError):
        Skin(EmulatorLink(format_world(allegro)), flat8)
    assert set(threading.enumerate()) <= before


def test_a_port_on_which_nobody_answers_is_one_line(silence, monkeypatch):
    monkeypatch.setattr(hub_client, "REPLY_TIMEOUT_S", 0.1)
    with pytest.raises(HubError, match=r"no reply from a hub after \d attempts.*1000000") as caught:
        taxel.open(silence, "flat8")
    assert silence.removeprefix("serial://") in one_line(caught.value)


def test_a_port_that_only_echoes_is_no_hub(monkeypatch):
    monkeypatch.setattr(hub_client, "REPLY_TIMEOUT_S", 0.1)
    with pytest.raises(HubError, match="no reply from a hub"):
        taxel.open("loop://", "flat8")


def test_a_hub_of_another_protocol_version_is_one_line(fake_hub):
    hub = fake_hub(version_chosen=0, version_min=2, version_max=5)
    with pytest.raises(VersionError, match="protocol 2 to 5, this program 1 to 2; update the older") as caught:
        taxel.open(hub.url, "flat8")
    assert hub.url.removeprefix("serial://") in one_line(caught.value)
    assert hub.commands == []


def test_a_hub_without_boards_is_asked_in_order(fake_hub, monkeypatch):
    monkeypatch.setattr("taxel.skin.skin.DISCOVERY_TIMEOUT_S", 0.1)
    hub = fake_hub()
    skin = taxel.open(hub.url, "flat8")
    assert skin.missing_boards == ["flat8"]
    asked = list(dict.fromkeys(hub.commands))
    assert asked == [9, 3, 1]  # board info, rate, start
    skin.close()


@pytest.mark.parametrize("options", ["duration_s=0.01", "duration_s=0.001&speed=max"])
def test_an_emulation_that_ends_before_it_answers_is_one_line(options):
    with pytest.raises(TaxelError) as caught:
        taxel.open(f"emulator:?{options}", "flat8")
    one_line(caught.value)


def test_a_broken_stimulus_is_told_in_the_emulators_words(tmp_path):
    path = tmp_path / "a.stm"
    write_stimulus(path, [0.0], np.zeros((1, 3)))
    for _ in range(5):  # whoever of the two threads comes first
        with pytest.raises(LinkError, match="expected values for 64 taxels, found 3") as caught:
            taxel.open(f"emulator:?speed=max&stimulus={path}", "flat8")
        one_line(caught.value)


def test_a_skin_may_be_closed_twice():
    skin = taxel.open(FAST, "flat8")
    skin.close()
    skin.close()
    with taxel.open(FAST, "flat8") as skin:
        skin.close()


def test_commands_go_through_while_frames_come(flat8):
    with taxel.open("emulator:", "flat8") as skin:
        frames = iter(skin)
        for _ in range(3):
            next(frames)
        assert skin.hub.scan_bus() == [0x40]
        assert skin.hub.transfer(0x40, bytes([0]), 1) == b"T"
        with pytest.raises(HubError, match="nack"):
            skin.hub.transfer(0x41, b"", 1)
        with pytest.raises(HubError, match="bad arguments"):
            skin.hub.transfer(0x40, b"", 255)
        skin.hub.read_status()
        assert skin.hub.status is not None
        assert skin.hub.status["boards_streaming"] == 1
        assert next(frames).address == 0x40
