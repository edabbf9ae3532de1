"""Priors on effect parameters: reading of the file, and start of a search at the priors."""

from __future__ import annotations

import numpy as np
import pytest

from taxel.gap.effects.catalogue import OWN_EFFECTS, choose_effects
from taxel.gap.effects.effect import Prior
from taxel.gap.errors import GapInputError
from taxel.gap.fitting.priors import read_priors


def write_priors(tmp_path, text):
    """Write a priors file and return its path."""
    path = tmp_path / "priors.toml"
    path.write_text(text)
    return path


def test_a_priors_file_names_effects_and_their_parameters(tmp_path):
    path = write_priors(tmp_path, "[contact_propagation]\nspread_mm = { value = 2.5, std = 0.5 }\n[noise]\n")
    assert read_priors(path) == {"contact_propagation": {"spread_mm": Prior(2.5, 0.5)}, "noise": {}}


@pytest.mark.parametrize(("text", "where"), [
    ("[gravity]\n", "[gravity]"),
    ("[dropout]\n", "[dropout]"),
    ("contact_propagation = 3\n", "contact_propagation"),
    ("[saturation]\nvolts = { value = 1.0, std = 1.0 }\n", "saturation.volts"),
    ("[saturation]\ncounts = 600\n", "saturation.counts"),
    ("[saturation]\ncounts = { value = 600 }\n", "saturation.counts"),
    ("[saturation]\ncounts = { value = true, std = 1.0 }\n", "saturation.counts"),
    ("[saturation]\ncounts = { value = nan, std = 1.0 }\n", "saturation.counts"),
    ("[saturation]\ncounts = { value = 600, std = 0 }\n", "saturation.counts"),
    ("[saturation]\ncounts = { value = -5, std = 10 }\n", "saturation.counts"),
    ("[saturation\n", "priors.toml"),
])  # fmt: skip
def test_an_error_in_a_priors_file_is_one_line_with_its_location(tmp_path, text, where):
    with pytest.raises(GapInputError) as raised:
        read_priors(write_priors(tmp_path, text))
    assert where in str(raised.value)
    assert len(str(raised.value).splitlines()) == 1


def test_a_search_starts_at_the_priors_and_does_not_change_the_catalogue():
    forms = choose_effects(priors={"contact_propagation": {"spread_mm": Prior(2.5, 0.5)}})
    for form in forms["contact_propagation"]:
        spread, *others = form.parameters()
        assert (spread.start, spread.prior, spread.prior_mean) == (2.5, 0.5, 2.5)
        assert tuple(others) == form.own_parameters()[1:]
    for form in OWN_EFFECTS["contact_propagation"]:
        assert np.isinf(form.parameters()[0].prior)
