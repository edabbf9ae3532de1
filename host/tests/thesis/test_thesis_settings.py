"""The settings of chapter 5: what the emulator takes, and an object's heading apart from its tilt."""

from __future__ import annotations

import numpy as np
import pytest

from taxel.campaign.scatter import FACTORS, Scatter
from taxel.campaign.session import check_world
from taxel.campaign.settings import EmulatedSettings
from taxel.campaign.setup import Setup
from taxel.emulated.contact import ContactLibraryError
from taxel.hand.transforms import to_rotation_vector
from taxel.thesis.settings import EFFECTS, SCATTER


def test_a_heading_of_its_own_turns_about_the_vertical_alone():
    draw = np.zeros(FACTORS)
    draw[3:6] = 1.0, -2.0, 3.0
    plain, headed = Scatter(object_rad=0.01), Scatter(object_rad=0.01, heading_rad=0.05)
    np.testing.assert_allclose(to_rotation_vector(plain.moved(draw)[0]), [0.01, -0.02, 0.03], atol=1e-12)
    np.testing.assert_allclose(to_rotation_vector(headed.moved(draw)[0]), [0.01, -0.02, 0.15], atol=1e-12)


def test_settings_without_a_heading_keep_the_name_that_campaigns_know():
    assert "heading" not in repr(Scatter())
    assert "heading_rad=0.05" in repr(Scatter(heading_rad=0.05))
    described = {EmulatedSettings(scatter=one).describe() for one in (Scatter(), Scatter(heading_rad=0.01))}
    assert len(described) == 2


def test_the_emulator_takes_the_effects():
    check_world(Setup(), EmulatedSettings(effects=EFFECTS, scatter=SCATTER))


def test_an_effect_that_is_none_is_refused():
    with pytest.raises(ContactLibraryError):
        check_world(Setup(), EmulatedSettings(effects=(*EFFECTS, "saturation clip")))
