"""The settings of chapter 5 are such that the emulator takes them."""

from __future__ import annotations

import pytest

from taxel.campaign.session import check_world
from taxel.campaign.settings import EmulatedSettings
from taxel.campaign.setup import Setup
from taxel.emulated.contact import ContactLibraryError
from taxel.thesis.settings import EFFECTS, SCATTER


def test_the_emulator_takes_the_effects():
    check_world(Setup(), EmulatedSettings(effects=EFFECTS, scatter=SCATTER))


def test_an_effect_without_its_size_is_refused():
    with pytest.raises(ContactLibraryError):
        check_world(Setup(), EmulatedSettings(effects=(*EFFECTS, "saturation clip")))
