"""`--nested`: leave-one-session-out searches, their evaluation, and the refusal of too few sessions."""

from __future__ import annotations

import json

import numpy as np
import pytest

from taxel.gap.diagnosis import diagnose
from taxel.gap.effects.catalogue import OWN_EFFECTS
from taxel.gap.errors import GapInputError
from taxel.gap.page import write_page
from taxel.gap.page.certainty_section import describe_repeated_searches
from taxel.gap.report.checked_report import CheckedReport


def clip_signal(force, signal_counts):
    return np.minimum(signal_counts, 500.0)


def test_a_clear_effect_is_found_in_every_leave_one_session_out_search(write_world, tmp_path):
    """`chosen_inside` lists the effects that each of the four searches selects; each search leaves out one session."""
    files = write_world(tmp_path, effect=clip_signal, sessions=4, largest_force_n=3.0)
    without = set(OWN_EFFECTS) - {"saturation", "stiffness", "noise"}  # the complete catalogue would take long
    nested, plain = (diagnose(*files, without, nested=is_nested).report for is_nested in (True, False))
    assert nested["verdict"]["effects"] == plain["verdict"]["effects"]
    assert all("saturation" in names for names in nested["after"]["chosen_inside"])
    assert len(nested["after"]["chosen_inside"]) == 4
    assert nested["after"]["shrink"] == pytest.approx(plain["after"]["shrink"], abs=0.05)
    assert nested["waterfall"][-1]["gap"] == pytest.approx(nested["after"]["value"])
    assert "chosen_inside" not in plain["after"]
    page = tmp_path / "report.html"
    write_page(json.loads(json.dumps(nested)), page)
    assert "4 of 4 searches without one" in page.read_text()


def test_nested_search_with_three_sessions_is_refused(write_world, tmp_path):
    with pytest.raises(GapInputError, match="--nested: expected at least 4 sessions, found 3"):
        diagnose(*write_world(tmp_path, effect=clip_signal, sessions=3, largest_force_n=3.0), nested=True)


def test_nested_agreement_counts_searches_with_the_same_effects():
    after = {"chosen_inside": [["noise"], ["noise", "stiffness"]]}
    verdict = {"effects": ["noise", "unknown"]}
    report = CheckedReport({"format": "taxel-gap-report", "version": 2, "after": after, "verdict": verdict})
    assert describe_repeated_searches(report) == ["1 of 2 searches without one session find the same effects."]
