"""Branches of the wiring: description, rise times, and diagnosis of boards that stop responding together."""

import math
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from taxel.hand import Hand, load_hand
from taxel.hand.branches import find_silent_branches, format_silent_boards
from taxel.hand.errors import HandDescriptionError, UnknownBranchError
from taxel.hand.loading import parse_hand_description
from taxel.hand.wiring import MIN_PULLUP_OHM, Branch, Wiring, compute_rise_times
from taxel.hand.world import WorldSettings, format_world
from taxel.link.virtual import VirtualWorld

SMALL_HAND = """
format = "taxel-hand"
version = 1
name = "small"
description = "two boards"
[taxel]
pitch_m = 0.005
size_m = 0.003
[kinds.one]
code = 1
tx = 1
rx = 2
taxels = 2
crossings = "##"
[[boards]]
name = "a"
kind = "one"
address = 0x20
{branch}
[[boards]]
name = "b"
kind = "one"
address = 0x21
{wiring}
"""


def load_small_hand(branch: str = 'branch = "index"', wiring: str = "") -> Hand:
    """Load a hand of two boards; branch: TOML line of the first board; wiring: TOML table [wiring]."""
    return parse_hand_description(SMALL_HAND.format(branch=branch, wiring=wiring).encode(), "small.toml")


@pytest.fixture(scope="module")
def original() -> Hand:
    return load_hand("original")


def test_original_hand_has_a_branch_for_palm_back_and_each_finger(original: Hand) -> None:
    sizes = {name: len(original.find_branch(name)) for name in original.branches}
    assert sizes == {"back_of_hand": 1, "index": 5, "middle": 5, "palm": 1, "pinkie": 5}


def test_unknown_branch_raises_a_one_line_error_with_the_known_names(original: Hand) -> None:
    with pytest.raises(
        UnknownBranchError, match=r"hand 'original' has no branch 'thumb'; expected one of back_of_hand"
    ):
        original.find_branch("thumb")


def test_hand_without_branches_has_no_wiring() -> None:
    hand = load_small_hand(branch="")
    assert hand.wiring is None
    assert hand.branches == []
    assert "branch" not in format_world(hand)


def test_described_values_replace_the_assumed_ones() -> None:
    text = '[wiring]\nkind = "buffered"\nhub_pullup_ohm = 2200\n[wiring.branches.index]\npullup_ohm = 4700.0'
    hand = load_small_hand(wiring=text)
    # Assumed are only 22 pF of the branch, its series resistance 0, and 10 pF of the hub.
    assert hand.wiring == Wiring((Branch("index", 4700.0, 22.0, 0.0),), True, 2200.0, 10.0)
    assert "wiring buffered 2200.0 10.0\nbranch index 4700.0 22.0 0.0 0x20\n" in format_world(hand)


@pytest.mark.parametrize(
    ("branch", "wiring", "expected"),
    [
        ('branch = ""', "", r"boards\[0\].branch"),
        ("branch = 3", "", r"boards\[0\].branch"),
        ('branch = "index"', '[wiring]\nkind = "ring"', r"wiring.kind.*passive"),
        ('branch = "index"', "[wiring]\nhub_pullup_ohm = 5", r"wiring.hub_pullup_ohm"),
        ('branch = "index"', "[wiring]\nhub_pullup_ohm = nan", r"wiring.hub_pullup_ohm"),
        ('branch = "index"', "[wiring]\nspeed = 5", r"wiring.speed"),
        ('branch = "index"', "[wiring.branches.index]\ncapacitance_pf = 0", r"wiring.branches.index.capacitance_pf"),
        ('branch = "index"', "[wiring.branches.indx]\nseries_ohm = 1.0", r"wiring.branches.indx.*did you mean index"),
    ],
)
def test_invalid_wiring_names_the_field_in_one_line(branch: str, wiring: str, expected: str) -> None:
    with pytest.raises(HandDescriptionError, match=expected) as error:
        load_small_hand(branch, wiring)
    assert "\n" not in str(error.value)


def test_rise_time_without_series_resistance_is_that_of_the_specification() -> None:
    branches = tuple(Branch(name, pullup_ohm=2200.0, capacitance_pf=100.0, series_ohm=0.0) for name in ("a", "b"))
    wiring = Wiring(branches, is_buffered=False, hub_pullup_ohm=0.0, hub_capacitance_pf=10.0)
    resistance_ohm, capacitance_f = 2200.0 / 2, (2 * 100.0 + 10.0) * 1e-12
    for rise in compute_rise_times(wiring):
        # The rise time from 30 % to 70 % of the supply is ln(0.7 / 0.3) R C.
        assert rise.rise_s == pytest.approx(0.8473 * resistance_ohm * capacitance_f, rel=1e-4)
        assert rise.highest_scl_hz == 400e3


def test_highest_clock_rate_of_a_branch_follows_its_capacitance() -> None:
    rates = []
    for picofarad in (50.0, 150.0, 500.0, 600.0):
        branch = Branch("a", pullup_ohm=2200.0, capacitance_pf=picofarad, series_ohm=0.0)
        _, rise = compute_rise_times(Wiring((branch,), is_buffered=True))
        rates.append(rise.highest_scl_hz)
    # Rise times of 93, 280, 932 and 1118 ns; the specification permits 120, 300 and 1000 ns at 1 MHz, 400 and 100 kHz.
    assert rates == [1e6, 400e3, 100e3, 0.0]


def test_rise_time_table_of_the_wiring_page_is_up_to_date() -> None:
    tool = Path(__file__).parents[3] / "tools/hand/wiring_table.py"
    result = subprocess.run([sys.executable, tool, "--check"], check=False)
    assert result.returncode == 0, "run python tools/hand/wiring_table.py"


def test_line_without_a_pull_up_never_rises() -> None:
    branch = Branch("a", pullup_ohm=0.0, capacitance_pf=50.0, series_ohm=0.0)
    rises = compute_rise_times(Wiring((branch,), is_buffered=False, hub_pullup_ohm=0.0))
    assert all(math.isinf(rise.rise_s) for rise in rises)


def test_assumed_wiring_of_the_original_hand_permits_400_khz(original: Hand) -> None:
    assert original.wiring is not None
    assert min(rise.highest_scl_hz for rise in compute_rise_times(original.wiring)) == 400e3
    assert original.wiring.hub_pullup_ohm > MIN_PULLUP_OHM


@pytest.mark.parametrize("is_buffered", [False, True])
def test_emulator_computes_the_same_rise_times(original: Hand, is_buffered: bool) -> None:
    branches = [Branch(name, 3300.0, 40.0 * i + 30.0, 37.0 * i) for i, name in enumerate(original.branches)]
    wiring = Wiring(tuple(branches), is_buffered, 4700.0, 12.0)
    with VirtualWorld(format_world(original, WorldSettings(wiring=wiring))) as world:
        statistics = world.statistics()
    found = [statistics["wiring"]["scl_rise_ns"], *(each["scl_rise_ns"] for each in statistics["branches"])]
    expected = [1e9 * rise.rise_s for rise in compute_rise_times(wiring)]
    assert found == pytest.approx(expected, rel=3e-3)


def test_boards_of_a_branch_that_stop_together_are_reported_as_one_branch_fault(original: Hand) -> None:
    members = [board.address for board in original.find_branch("index")]
    silent = find_silent_branches(original, members, dict.fromkeys(members, 5.0))
    assert silent.branches == ("index",)
    assert silent.boards == ()
    text = format_silent_boards(original, silent)
    assert text.startswith("branch fault: no response from branch index (all 5 boards: 0x08, 0x0A, ")
    assert "\n" not in text


def test_boards_of_a_branch_that_stop_one_after_the_other_are_reported_as_single_boards(original: Hand) -> None:
    members = [board.address for board in original.find_branch("index")]
    silent = find_silent_branches(original, members, {address: 2.0 * i for i, address in enumerate(members)})
    assert silent.branches == ()
    assert len(silent.boards) == 5


def test_silence_of_all_but_one_board_of_a_branch_is_not_reported_as_a_branch_fault(original: Hand) -> None:
    members = [board.address for board in original.find_branch("index")][1:]
    silent = find_silent_branches(original, members)
    assert silent.branches == ()
    assert "and 1 more: check power and cable" in format_silent_boards(original, silent)


def test_line_about_a_hand_whose_branches_are_all_silent_names_a_short_as_a_possible_cause(original: Hand) -> None:
    silent = find_silent_branches(original, [board.address for board in original.boards])
    assert "disconnect the branches one at a time" in format_silent_boards(original, silent)


def test_silent_board_that_is_alone_in_its_branch_is_reported_as_a_single_board(original: Hand) -> None:
    text = format_silent_boards(original, find_silent_branches(original, [0x15]))
    assert text == "no response from palm (0x15): check power and cable"


def test_boards_that_differ_only_in_their_branch_are_not_equal(original: Hand) -> None:
    board = original.boards[0]
    assert board != replace(board, branch="middle")
