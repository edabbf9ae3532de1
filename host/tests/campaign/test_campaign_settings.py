"""What an emulated campaign is like, in one line."""

from __future__ import annotations

import pickle

import pytest

from taxel.campaign.scatter import Scatter
from taxel.campaign.settings import DEFAULT_EFFECTS, EmulatedSettings, UnknownPresetError, effects_of
from taxel.grasp.timeline import Timeline


def test_presets_by_name_and_lines_as_they_are():
    assert effects_of("thesis") == DEFAULT_EFFECTS
    assert effects_of("none") == ()
    assert effects_of("spread film length_m=0.002; noise white counts=3;") == [
        "spread film length_m=0.002",
        "noise white counts=3",
    ]


@pytest.mark.parametrize("text", ["", ";", "best", "noise white counts=1;spread"])
def test_what_is_neither_is_refused_in_one_line(text):
    with pytest.raises(UnknownPresetError, match=r"^effects: expected thesis, none, or lines such as .*$") as caught:
        effects_of(text)
    assert "\n" not in str(caught.value)
    assert str(pickle.loads(pickle.dumps(caught.value))) == str(caught.value)


def test_the_description_tells_settings_apart_and_names_no_effect():
    all_of_them = [
        EmulatedSettings(),
        EmulatedSettings(seed=2),
        EmulatedSettings(effects=()),
        EmulatedSettings(scatter=Scatter(grip=0.0)),
        EmulatedSettings(timeline=Timeline(hold_s=2.0)),
    ]
    lines = [settings.describe() for settings in all_of_them]
    assert len(set(lines)) == len(lines)
    assert not any(word in line for line in lines for word in ("noise", "coupling", "spread"))


def test_a_list_of_the_same_effects_is_the_same_campaign():
    assert EmulatedSettings(effects=list(DEFAULT_EFFECTS)).describe() == EmulatedSettings().describe()
