"""Which of the effects that would be accepted is taken: the plainest of those that do as much."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from taxel.gap.chain import Chain, FittedEffect
from taxel.gap.deciding import _plainest, is_seen_beside
from taxel.gap.effects.dropout import Dropout, Dropped
from taxel.gap.effects.electrode_crosstalk import ElectrodeCrosstalk
from taxel.gap.effects.gain_mismatch import GainMismatch
from taxel.gap.effects.hysteresis import Hysteresis
from taxel.gap.effects.saturation import Saturation
from taxel.gap.effects.stiffness import Stiffness
from taxel.gap.score import Score
from taxel.gap.trial import Round, Trial


def score(value: float) -> Score:
    """Of five sessions that scatter by 1, each score for itself."""
    scatter = np.random.default_rng(int(10 * value)).normal(0.0, 1.0, 5)
    return Score(value, (value + scatter)[:, None], np.full(5, value))


BASE = score(100.0)


def round_of(effect, value: float) -> Round:
    link = FittedEffect(effect, np.zeros((1, 1)))
    trial = Trial(effect.name, Chain((link,)), np.zeros(1), score(value), score(value))
    return Round(BASE, (), trial, 100.0 - value, 1e-4, True)


TAXELS, HAND, BOARDS = GainMismatch("taxel", 0.3), Saturation("clip"), Stiffness("board")
MEMORY, WIRES = Hysteresis("sticks"), ElectrodeCrosstalk("network", "board")
ONE = np.arange(4) == 1
DEAD = Dropout(Dropped(ONE, (), np.zeros(1), ONE, np.zeros(4, bool)))


@pytest.mark.parametrize(
    ("effects", "values", "taken"),
    [
        ([TAXELS, HAND], [20.0, 20.5], 1),  # as good: fewer words
        ([TAXELS, HAND], [20.0, 50.0], 0),  # it does much more
        ([TAXELS, BOARDS], [20.0, 20.5], 0),  # a value for each board is no fewer words
        ([HAND, TAXELS], [20.0, 20.5], 0),
        ([MEMORY, HAND], [20.0, 20.5], 1),  # what presses now does as much as what pressed before
        ([MEMORY, HAND], [20.0, 50.0], 0),
        ([MEMORY, BOARDS], [20.0, 20.5], 0),
        ([HAND, MEMORY], [20.0, 20.5], 0),
        ([WIRES, HAND], [20.0, 20.5], 1),  # many values for each board
        ([WIRES, HAND], [20.0, 50.0], 0),
        ([BOARDS, HAND], [20.0, 20.5], 0),  # one for each is not many
        ([TAXELS, DEAD], [20.0, 20.5], 1),  # some that are dead, not a value for each
        ([TAXELS, DEAD], [20.0, 50.0], 0),
        ([DEAD, TAXELS], [20.0, 20.5], 0),
        ([BOARDS, DEAD], [20.0, 20.5], 0),
    ],
)
def test_the_simplest_of_equally_good_candidates_is_selected(effects, values, taken):
    accepted = [round_of(effect, value) for effect, value in zip(effects, values, strict=True)]
    assert _plainest(accepted) is accepted[taken]


def test_without_candidates_none_is_selected():
    assert _plainest([]) is None


@pytest.mark.parametrize(("evident", "found", "told"), [(True, True, True), (True, False, False), (False, True, False)])
def test_an_evident_open_line_is_reported_besides_other_effects(monkeypatch, evident, found, told):
    monkeypatch.setattr("taxel.gap.deciding.is_evident", lambda trial: evident)
    standing = SimpleNamespace(chain=Chain((FittedEffect(HAND, np.zeros((1, 1))),) if found else ()))
    assert is_seen_beside(standing, SimpleNamespace(name="dropout")) is told
    assert not is_seen_beside(standing, SimpleNamespace(name="saturation"))
