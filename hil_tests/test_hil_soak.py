"""The short form of the soak, and that it would notice."""

from hil_tests.harness.soak import Soak
from hil_tests.soak import verdict
from taxel.hand import load_hand

SECONDS = 300.0
SMALL = load_hand("rig4")
FIRST, SECOND = (board.address for board in SMALL.boards[:2])
SEED = 5


def test_every_missing_frame_is_explained_by_a_fault_that_struck_then() -> None:
    report = Soak(load_hand("allegro"), SEED).run(SECONDS)
    print(f"seed {SEED}")
    assert verdict(report) == []
    assert report.lost > 100
    assert sum(report.injected.values()) > 30
    assert report.frames > 17 * 15 * SECONDS


def test_a_loss_that_nobody_injected_is_noticed() -> None:
    soak = Soak(SMALL, SEED, mean_gap_s=1e9)
    soak.run(5.0)
    soak.world.inject("unplug", FIRST)
    soak.run(0.5)
    soak.world.inject("plug", FIRST)
    report = soak.run(3.0)
    assert len(report.unexplained) == 1
    assert f"board 0x{FIRST:02X}" in report.unexplained[0]


def test_a_wrong_count_is_noticed() -> None:
    soak = Soak(SMALL, SEED, mean_gap_s=1e9)
    soak.run(3.0)
    soak.world.press([1234.0] * soak.world.taxels)
    assert soak.run(0.5).wrong > 10


def test_a_fault_of_one_board_does_not_excuse_another() -> None:
    soak = Soak(SMALL, SEED, mean_gap_s=1e9)
    soak.run(3.0)
    soak.blame("unplugged", "board", FIRST, 0.6)
    soak.world.inject("unplug", SECOND)
    soak.run(0.5)
    soak.world.inject("plug", SECOND)
    assert len(soak.run(3.0).unexplained) == 1
