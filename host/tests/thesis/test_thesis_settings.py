"""The settings for the reproduction of chapter 5 are accepted by the emulator."""

import numpy as np
import pytest

from taxel.campaign.session import check_world
from taxel.campaign.settings import EmulatedSettings
from taxel.campaign.setup import Setup
from taxel.emulated.contact import ContactLibraryError
from taxel.grasp.plan import PALM_PLACEMENTS, make_thesis_plan
from taxel.thesis.settings import (
    BRACKET_OFFSET_M,
    EFFECTS,
    OBJECT_VARIATION,
    PRISM,
    PRISM_INDENTATION_M,
    THESIS_PLACEMENTS,
    build_effects,
)


def test_emulator_accepts_the_effects():
    setup = Setup()
    effects = build_effects(board.name for board in setup.hand.boards)
    check_world(setup, EmulatedSettings(effects=effects, variation=OBJECT_VARIATION))


def test_every_bracket_is_moved_into_the_hand():
    hand = Setup().hand
    offsets = EmulatedSettings(effects=build_effects(board.name for board in hand.boards)).offsets("bracket_offset")
    assert set(offsets) == {board.name for board in hand.boards}
    for board in hand.boards:
        surface, moved = board.kind.surface, offsets[board.name][:3, 3]
        assert surface is not None
        assert np.linalg.norm(moved) == pytest.approx(BRACKET_OFFSET_M)
        assert surface.normal.mean(axis=0) @ moved < 0


def test_effect_without_its_size_is_refused():
    with pytest.raises(ContactLibraryError):
        check_world(Setup(), EmulatedSettings(effects=(*EFFECTS, "saturation clip")))


def test_only_the_sides_of_the_prism_are_pressed_less():
    plan = {(planned.object, planned.approach): planned for planned in make_thesis_plan(1)}
    default, changed = Setup(), Setup(placements=THESIS_PLACEMENTS)
    for (item, name), planned in plan.items():
        shift = changed.approach(planned).palm_pose[:3, 3] - default.approach(planned).palm_pose[:3, 3]
        is_changed = item == PRISM and name != "top"
        expected = PALM_PLACEMENTS[item, name].indentation_m - PRISM_INDENTATION_M if is_changed else 0.0
        assert np.linalg.norm(shift) == pytest.approx(expected, abs=1e-12)
