"""A short soak, and checks that the soak detects unexplained losses and wrong counts."""

from hil_tests.harness.soak import Soak
from hil_tests.soak import find_problems
from taxel.hand import load_hand

SECONDS = 300.0
SECONDS_WITHOUT_HUB = 120.0
"""Half an hour of virtual time has the same result (`python -m hil_tests.soak --without-hub --hours 0.5`)."""
SMALL_HAND = load_hand("rig4")
FIRST, SECOND = (board.address for board in SMALL_HAND.boards[:2])
SEED = 5


def test_every_missing_frame_is_explained_by_an_injected_fault() -> None:
    """The soak injects random faults. The lower limits show that 17 boards sent 15 frames/s each and some were lost."""
    report = Soak(load_hand("original"), SEED).run(SECONDS)
    print(f"seed {SEED}")
    assert find_problems(report) == []
    assert report.lost > 100
    assert sum(report.injected.values()) > 30
    assert report.frames > 17 * 15 * SECONDS


def test_every_missing_frame_of_a_skin_without_a_hub_is_explained() -> None:
    """As with a hub: frames were lost, faults were injected, and 17 boards sent more than 15 frames/s each."""
    report = Soak(load_hand("original"), SEED, has_hub=False).run(SECONDS_WITHOUT_HUB)
    print(f"seed {SEED}")
    assert find_problems(report) == []
    assert report.lost > 10
    assert sum(report.injected.values()) > 10
    assert report.frames > 17 * 15 * SECONDS_WITHOUT_HUB


def test_loss_without_a_recorded_fault_is_reported() -> None:
    """The test unplugs a board directly in the emulated world, so the soak has no record of this fault.

    The soak itself injects only its first fault, 2 s after the start: the mean time to the next fault is 1e9 s.
    """
    soak = Soak(SMALL_HAND, SEED, mean_gap_s=1e9)
    soak.run(5.0)
    soak.world.inject("unplug", FIRST)
    soak.run(0.5)
    soak.world.inject("plug", FIRST)
    report = soak.run(3.0)
    assert len(report.unexplained) == 1
    assert f"board 0x{FIRST:02X}" in report.unexplained[0]


def test_wrong_counts_are_reported() -> None:
    """The test sets the counts of all taxels to 1234 in the emulated world. The soak expects other counts."""
    soak = Soak(SMALL_HAND, SEED, mean_gap_s=1e9)
    soak.run(3.0)
    soak.world.set_stimulus([1234.0] * soak.world.taxels)
    assert soak.run(0.5).wrong > 10


def test_fault_of_one_board_does_not_explain_a_loss_of_another_board() -> None:
    """The recorded fault names the first board, but the second board is unplugged: its loss is unexplained."""
    soak = Soak(SMALL_HAND, SEED, mean_gap_s=1e9)
    soak.run(3.0)
    soak.record_fault("unplugged", "board", FIRST, 0.6)
    soak.world.inject("unplug", SECOND)
    soak.run(0.5)
    soak.world.inject("plug", SECOND)
    assert len(soak.run(3.0).unexplained) == 1
