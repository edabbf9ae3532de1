"""Several ports as one skin: merged scans, times, losses of each port, and boards that occur twice."""

import itertools
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import replace

import numpy as np
import pytest

import taxel
from taxel.errors import TaxelError
from taxel.hand import Hand, load_hand
from taxel.hand.world import WorldSettings, format_world
from taxel.link.virtual import VirtualMasterWorld, VirtualMemoryLink, VirtualWorld
from taxel.skin import DuplicateBoardError, MultiSkin, Skin

HAND = load_hand("rig4")
SERIAL, I2C = "serial:///dev/ttyUSB0", "i2c:///dev/i2c-1"


def select_boards(hand: Hand, first: int, end: int) -> Hand:
    """Return the hand with its boards `first` to `end` - 1 only."""
    return replace(hand, boards=hand.boards[first:end], wiring=None)


def open_ports(stack: ExitStack, first: slice, second: slice) -> dict[str, Skin]:
    """Open the skins of a virtual hub with the boards `first`, and of an I2C adapter with the boards `second`."""
    settings = WorldSettings(noise_counts=0.0)
    boards = [format_world(select_boards(HAND, part.start, part.stop), settings) for part in (first, second)]
    hub = stack.enter_context(VirtualWorld(boards[0]))
    adapter = stack.enter_context(VirtualMasterWorld(boards[1]))
    return {
        SERIAL: stack.enter_context(Skin(VirtualMemoryLink(hub), HAND)),
        I2C: stack.enter_context(Skin(VirtualMemoryLink(adapter), HAND)),
    }


@pytest.fixture
def skin() -> Iterator[MultiSkin]:
    """A skin of two ports: board 0 of HAND behind a hub, its boards 1 to 3 on an I2C adapter."""
    with ExitStack() as stack, MultiSkin(open_ports(stack, slice(0, 1), slice(1, 4))) as skin:
        yield skin


def test_merged_scans_contain_the_boards_of_both_ports(skin: MultiSkin) -> None:
    scans = list(itertools.islice(skin.scans(), 60))
    assert skin.missing_boards == []
    assert [skin.get_port(board.address) for board in HAND.boards] == [SERIAL, I2C, I2C, I2C]
    complete = [scan for scan in scans if scan.valid.all()]
    assert len(complete) >= 58
    assert all((scan.raw_counts > 0).all() for scan in complete)
    assert [scan.cycle for scan in scans] == list(range(60))
    periods_s = np.diff([scan.time_s for scan in scans])
    assert (periods_s[3:] > 0.0).all()  # until the boards' clocks have been read, times are arrival times


def test_losses_are_counted_for_each_port(skin: MultiSkin) -> None:
    frames = [frame for _ in range(100) for frame in skin.poll(0.02)]
    assert {frame.address for frame in frames} == {board.address for board in HAND.boards}
    assert skin.losses.keys() == {SERIAL, I2C}
    assert all(losses.lost_on_wire == 0 for losses in skin.losses.values())
    by_port = {name: set(losses.boards) for name, losses in skin.losses.items()}
    assert by_port == {SERIAL: {HAND.boards[0].address}, I2C: {board.address for board in HAND.boards[1:]}}
    assert skin.bytes_received > 0
    assert skin.bytes_discarded == 0


def test_a_silent_port_does_not_stop_the_scans_of_the_other_port(skin: MultiSkin) -> None:
    list(itertools.islice(skin.scans(), 10))
    world = skin.skins[I2C].link.world
    for board in HAND.boards[1:]:
        world.inject("unplug", board.address)
    scans = list(itertools.islice(skin.scans(), 150))
    connected_taxels = skin.hand.get_slice(HAND.boards[0].address)
    assert scans[-1].valid[connected_taxels].all()
    assert not np.delete(scans[-1].valid, np.r_[connected_taxels]).any()


def test_the_baseline_contains_the_taxels_of_both_ports(skin: MultiSkin) -> None:
    assert np.isfinite(skin.take_baseline(samples=10).mean).all()


def test_a_board_on_two_ports_is_refused_with_the_names_of_both_ports() -> None:
    with ExitStack() as stack:
        skins = open_ports(stack, slice(0, 2), slice(1, 4))
        with pytest.raises(DuplicateBoardError) as caught:
            MultiSkin(skins)
    board = HAND.boards[1]
    assert str(caught.value).startswith(f"board 0x{board.address:02X} ({board.name}) answers on {SERIAL} and on {I2C};")


def test_every_port_of_a_list_is_opened() -> None:
    # Both emulators have the boards of the same hand.
    urls = [f"emulator:?speed=max&seed={seed}&duration_s=5" for seed in (1, 2)]
    with pytest.raises(DuplicateBoardError, match=r"seed=1.* and on .*seed=2"):
        taxel.open(urls, "rig4")


def test_a_list_of_one_port_opens_a_skin_of_several_ports() -> None:
    with taxel.open(["emulator:?speed=max&duration_s=5"], "rig4") as skin:
        assert isinstance(skin, MultiSkin)
        assert next(skin.scans()).valid.any()


@pytest.mark.parametrize(
    ("urls", "expected"),
    [
        ([], "the list of ports is empty"),
        (["emulator:", "emulator:"], "emulator:: occurs twice"),
        (["i2c:///dev/i2c-99"], "/dev/i2c-99: cannot be opened"),
    ],
)
def test_a_wrong_list_of_ports_gives_one_error_line(urls: list[str], expected: str) -> None:
    with pytest.raises(TaxelError, match=expected) as caught:
        taxel.open(urls)
    assert "\n" not in str(caught.value)
