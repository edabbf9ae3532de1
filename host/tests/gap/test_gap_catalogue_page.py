"""The documentation page of the diagnosis lists all effects of the catalogue."""

from __future__ import annotations

from pathlib import Path

import pytest

from taxel.gap.effects.catalogue import OWN_EFFECTS

PAGE = (Path(__file__).parents[3] / "docs" / "gap-diagnosis.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("name", OWN_EFFECTS)
def test_the_catalogue_table_of_the_page_lists_every_form_and_parameter(name):
    (row,) = (line for line in PAGE.splitlines() if line.startswith(f"| `{name}` |"))
    for form in OWN_EFFECTS[name]:
        assert not form.variant or f"`{form.variant}`" in row
        names = {parameter.name for parameter in form.own_parameters() if form.name != "pose_error"}
        assert all(f"`{one}`" in row for one in names)
