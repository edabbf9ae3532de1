"""Settings of an emulated campaign: effect texts and the description of a dataset's generator."""

import pickle

import pytest

from taxel.campaign.settings import DEFAULT_EFFECTS, EmulatedSettings, UnknownPresetError, parse_effects
from taxel.campaign.variation import Variation
from taxel.grasp.timeline import Timeline


def test_effects_are_parsed_from_a_preset_name_or_from_lines():
    assert parse_effects("thesis") == DEFAULT_EFFECTS
    assert parse_effects("spread film length_m=0.002; noise white counts=3;") == [
        "spread film length_m=0.002",
        "noise white counts=3",
    ]


@pytest.mark.parametrize("text", ["", ";", "best", "none", "noise white counts=1;spread"])
def test_a_string_that_is_neither_a_preset_nor_effect_lines_is_rejected_with_a_one_line_message(text):
    with pytest.raises(UnknownPresetError, match=r"^effects: expected thesis or lines such as .*$") as caught:
        parse_effects(text)
    assert "\n" not in str(caught.value)
    assert str(pickle.loads(pickle.dumps(caught.value))) == str(caught.value)


def test_the_description_differs_between_settings_and_contains_no_effect_name():
    variants = [
        EmulatedSettings(),
        EmulatedSettings(seed=2),
        EmulatedSettings(effects=()),
        EmulatedSettings(variation=Variation(grip=0.0)),
        EmulatedSettings(timeline=Timeline(hold_s=2.0)),
    ]
    lines = [settings.describe() for settings in variants]
    assert len(set(lines)) == len(lines)
    assert not any(word in line for line in lines for word in ("noise", "coupling", "spread"))


def test_a_list_and_a_tuple_of_the_same_effects_have_the_same_description():
    assert EmulatedSettings(effects=list(DEFAULT_EFFECTS)).describe() == EmulatedSettings().describe()
