"""The settings of chapter 5 are such that the emulator takes them."""

from __future__ import annotations

import numpy as np
import pytest

from taxel.campaign.session import check_world
from taxel.campaign.settings import EmulatedSettings
from taxel.campaign.setup import Setup
from taxel.emulated.contact import ContactLibraryError
from taxel.grasp.plan import PLACINGS, thesis_plan
from taxel.thesis.settings import DEEPER_M, EFFECTS, PRISM, PRISM_PRESS_M, SCATTER, TOUCHED, effects_on


def test_the_emulator_takes_the_effects():
    setup = Setup()
    effects = effects_on(board.name for board in setup.hand.boards)
    check_world(setup, EmulatedSettings(effects=effects, variation=SCATTER))


def test_every_bracket_lies_deeper():
    hand = Setup().hand
    offsets = EmulatedSettings(effects=effects_on(board.name for board in hand.boards)).offsets("bracket_offset")
    assert set(offsets) == {board.name for board in hand.boards}
    for board in hand.boards:
        surface, moved = board.kind.surface, offsets[board.name][:3, 3]
        assert surface is not None
        assert np.linalg.norm(moved) == pytest.approx(DEEPER_M)
        assert surface.normal.mean(axis=0) @ moved < 0


def test_an_effect_without_its_size_is_refused():
    with pytest.raises(ContactLibraryError):
        check_world(Setup(), EmulatedSettings(effects=(*EFFECTS, "saturation clip")))


def test_both_sides_press_the_prism_less_and_the_others_as_every_campaign_does():
    plan = {(planned.object, planned.approach): planned for planned in thesis_plan(1)}
    usual, here = Setup(), Setup(placings=TOUCHED)
    for (item, name), planned in plan.items():
        further = here.approach(planned).palm_pose[:3, 3] - usual.approach(planned).palm_pose[:3, 3]
        is_less = item == PRISM and name != "top"
        less = PLACINGS[item, name].press_m - PRISM_PRESS_M if is_less else 0.0
        assert np.linalg.norm(further) == pytest.approx(less, abs=1e-12)
