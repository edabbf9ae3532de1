"""What the pattern of gains and stiffnesses says of their cause."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from taxel.gap.boards import layouts_of
from taxel.gap.chain import FittedEffect
from taxel.gap.effects.effect import BOARD, TAXEL, Prior
from taxel.gap.effects.electrode_crosstalk import ElectrodeCrosstalk
from taxel.gap.effects.gain_mismatch import GainMismatch
from taxel.gap.effects.stiffness import Stiffness
from taxel.gap.uneven import _goes_round, odd_pattern
from taxel.recording import TaxelTable

ROWS, COLUMNS, BOARDS = 6, 5, 4
EACH = ROWS * COLUMNS
N = BOARDS * EACH
SEEDS = range(8)


@pytest.fixture
def judge():
    """Every taxel pressed by 200 counts."""
    board, number = np.divmod(np.arange(N), EACH)
    tx, rx = number // COLUMNS, number % COLUMNS
    place = np.column_stack([0.005 * tx + 0.1 * board, 0.005 * rx, np.zeros(N)])
    normal, size = np.tile([0.0, 0.0, 1.0], (N, 1)), np.full(N, 0.003)
    table = TaxelTable((0x20 + board).astype(np.uint8), tx.astype(np.uint8), rx.astype(np.uint8), place, normal, size)
    pair = SimpleNamespace(boards=layouts_of(board, table), groups=SimpleNamespace(sensor=board), tx=tx, rx=rx)
    state = SimpleNamespace(mean=np.full((3, 2, N), 200.0), pair=pair)
    return SimpleNamespace(layout=SimpleNamespace(bins=2), weight=np.full((3, 2, N), 0.01), state=state)


def gains(values):
    return FittedEffect(GainMismatch(TAXEL), np.asarray(values)[None])


def of_boards(values, effect=GainMismatch):
    return FittedEffect(effect(BOARD), np.array([values], float))


@pytest.mark.parametrize("seed", SEEDS)
def test_random_gains_on_all_boards_are_not_conspicuous(judge, seed):
    assert odd_pattern(judge, gains(np.random.default_rng(seed).normal(0.0, 0.2, N))) is None


@pytest.mark.parametrize("seed", SEEDS)
def test_random_gains_on_a_single_board_are_conspicuous(judge, seed):
    values = np.random.default_rng(seed).normal(0.0, 0.03, N)
    values[EACH : 2 * EACH] *= 10.0
    assert "on a single board only" in odd_pattern(judge, gains(values))


@pytest.mark.parametrize("seed", SEEDS)
def test_gains_in_patches_are_conspicuous(judge, seed):
    rng, pair = np.random.default_rng(seed), judge.state.pair
    waves = np.sin(0.9 * pair.tx + rng.uniform(0, 6)) * np.cos(0.8 * pair.rx + rng.uniform(0, 6))
    assert "patches" in odd_pattern(judge, gains(0.3 * waves + rng.normal(0.0, 0.05, N)))


def test_taxels_without_contact_are_ignored_in_gain_patterns(judge):
    judge.state.mean[:, :, EACH:] = 0.0
    values = np.random.default_rng(0).normal(0.0, 0.2, N)
    assert odd_pattern(judge, gains(values)) is None
    judge.state.mean[:] = 0.0
    assert odd_pattern(judge, gains(values)) is None


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ([-0.4, -0.41, -0.39, -0.4], "same value on every board"),
        ([-0.26, -0.16, -0.17, -0.21], "same value on every board"),
        ([-0.26, 0.16, -0.17, -0.21], None),
        ([-0.02, 0.01, -0.4, 0.0], None),
        ([0.02, 0.021, 0.02, 0.02], None),
        ([0.0, 1.0, 0.0, 0.0], "at the limit"),
    ],
)
def test_different_board_gains_are_accepted_and_one_common_gain_is_conspicuous(judge, values, words):
    found = odd_pattern(judge, of_boards(values))
    assert found is None if words is None else words in found


@pytest.mark.parametrize(
    ("values", "round_about"),
    [
        ([0.0, 0.002, 0.05, 0.055, -1.0], True),  # the taxels beside, along both lines
        ([0.0, 0.002, 0.09, 0.13, -1.0], True),  # the pitch along one is greater
        ([0.0, 0.002, 0.03, 0.065, -1.0], False),  # one layer more than the other
        ([-0.03, -0.05, 0.05, 0.055, -1.0], False),  # along the lines too
        ([0.02, 0.02, 0.0, 0.0, -1.0], False),
    ],
)
def test_crosstalk_to_diagonal_neighbours_is_not_electrode_crosstalk(values, round_about):
    assert _goes_round(FittedEffect(ElectrodeCrosstalk("network"), np.array(values)[:, None])) is round_about
    assert not _goes_round(FittedEffect(ElectrodeCrosstalk("lines"), np.array(values)[:2, None]))


def test_a_board_with_little_contact_is_ignored_in_gain_patterns(judge):
    judge.state.mean[:, :, :EACH] = 0.5
    assert odd_pattern(judge, of_boards([10.0, 1.0, 1.0, 0.98], Stiffness)) is None
    assert "same value on every board" in odd_pattern(judge, of_boards([0.0, -0.4, -0.41, -0.39]))


def test_parameters_at_their_priors_are_not_conspicuous(judge):
    known = GainMismatch(BOARD).with_priors({"log_gain": Prior(-0.4, 0.05)})
    assert odd_pattern(judge, FittedEffect(known, np.full((1, BOARDS), -0.4))) is None


def test_a_stiffness_at_its_bound_is_conspicuous(judge):
    assert "at the limit" in odd_pattern(judge, of_boards([1.0, 10.0, 1.0, 0.98], Stiffness))
    assert odd_pattern(judge, of_boards([1.0, 1.6, 1.0, 0.98], Stiffness)) is None
    assert odd_pattern(judge, FittedEffect(Stiffness(), np.array([[1.5]]))) is None
