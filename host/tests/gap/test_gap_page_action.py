"""Recommended action, line of confidence and neutral parameters of the page and of the summary on a terminal."""

from __future__ import annotations

import copy
import re
from typing import Any

import numpy as np
import pytest
from rich.console import Console

from taxel.cli.gap_summary import MOST_LINES, WIDTH, print_summary
from taxel.gap.effects.catalogue import OWN_EFFECTS
from taxel.gap.effects.effect import Effect
from taxel.gap.fitting.composite import FittedEffect
from taxel.gap.page import page_text
from taxel.gap.page.action import EXPORT_COMMAND, PASTE_LINES, Action, recommend_action
from taxel.gap.page.confidence import MOST_CAUSES, list_shown_causes
from taxel.gap.page.effect_cards import format_parameters
from taxel.gap.report.checked_report import CheckedReport
from taxel.gap.report.neutral import SHAPE_PARAMETERS, find_neutral

Report = dict[str, Any]


def make_report(status: str, *names: str, sessions: int = 4, **verdict: Any) -> Report:
    """Return a report of version 2 with these effects in the verdict and all fields that a summary reads."""
    effects = [
        {
            "name": name,
            "parameters": {"size@32": {"value": 3.0, "ci95": [2.0, 4.0], "unit": "mm"}},
            "where": {"sensors": [32]} if name == "dropout" else {},
            "identifiability": "identifiable",
            "in_verdict": True,
            "shapley_share": 1.0,
        }
        for name in names
        if name != "unknown"
    ]
    has_effects = bool(effects)
    probabilities = {**dict.fromkeys(names, 0.9), "latency": 0.06, "unknown": 0.04, "no_gap": 0.0}
    contact = {"press": "box top, with 3 times the force", "separates": ["noise", "latency"], "gain": 0.5, "why": ""}
    return {
        "format": "taxel-gap-report",
        "version": 2,
        "inputs": {"real": {"path": "r.h5", "sha256": "0"}, "sim": {"path": "s.h5", "sha256": "1"}, "problems": []},
        "seed": 0,
        "runtime_s": 1.0,
        "gap": {"value": 19.0, "ci95": None, "floor": 4.0, "excess": 345.0, "p_value": 0.001, "significant": True},
        "where": {"sensors": [{"address": 32, "name": "palm", "share": 1.0, "p_value": 0.01}]},
        "verdict": {
            "status": status,
            "effects": list(names),
            "probabilities": probabilities,
            "confounded_with": {},
            "headline": "The real skin differs.",
            "one_line": "Explained: the gap shrinks.",
            "reasons": [],
            **verdict,
        },
        "effects": effects,
        "after": {
            "before": 20.0,
            "value": 8.0 if has_effects else 20.0,
            "floor": 5.0,
            "ci95": [7.0, 9.0],
            "predicted_shrink": 0.63,
            "shrink": 0.6 if has_effects else 0.0,
            "shrink_ci95": None,
            "reducible_shrink": 0.88,
        },
        "unexplained": {"p_value": 0.5, "signature": "", "where": []},
        "sensors": [{"address": 32, "name": "palm", "kind": "x"}],
        "counts": {"real": {"grasps": 8, "sessions": sessions}, "sim": {"grasps": 4}, "cells": 2},
        "next_presses": [contact],
        "losses": [],
        "notes": [],
    }


def recommend(report: Report) -> Action:
    return recommend_action(CheckedReport(report))


def test_for_an_effect_on_counts_a_command_three_lines_and_a_contact_are_recommended() -> None:
    action = recommend(make_report("explained", "contact_propagation"))
    assert "Add contact propagation to the simulator" in action.steps[0]
    assert (action.command, action.lines) == (EXPORT_COMMAND.format(report="report.json"), PASTE_LINES)
    assert len(PASTE_LINES) == 3
    assert action.next_contact.startswith("box top, with 3 times the force (separates noise and latency")


def test_for_a_displaced_object_a_corrected_pose_is_recommended() -> None:
    action = recommend(make_report("explained", "pose_error"))
    assert action.steps == ("Correct the pose in the simulator: size, palm\N{NO-BREAK SPACE}(0x20)\N{NO-BREAK SPACE}"
                            "3.00\N{NO-BREAK SPACE}mm (2.00 to 4.00).",)  # fmt: skip
    assert action.lines == ()


def test_a_repair_of_dead_hardware_is_recommended_before_its_simulation() -> None:
    action = recommend(make_report("explained", "dropout", "noise"))
    assert action.steps[0] == "Repair the hardware if possible: palm."
    assert "Add dropout and noise" in action.steps[1]


def test_an_effect_that_does_not_reduce_the_gap_is_not_added() -> None:
    report = make_report("explained", "gain_mismatch")
    report["after"] |= {"shrink": 0.003, "value": 19.9}
    action = recommend(report)
    assert action.steps[0].startswith("Change nothing yet: gain mismatch")
    assert (action.lines, action.next_contact != "") == ((), True)


def test_an_effect_of_a_plug_in_has_no_lines() -> None:
    action = recommend(make_report("explained", "my_own"))
    assert "taxel gap apply" in action.steps[0]
    assert action.lines == ()


@pytest.mark.parametrize(("sessions", "words"), [(1, "2 more sessions"), (2, "1 more session ")])
def test_for_too_few_sessions_further_sessions_are_recommended(sessions: int, words: str) -> None:
    for report in (make_report("unknown", "unknown", sessions=sessions), make_report("partly_explained", "noise")):
        report["counts"]["real"]["sessions"] = sessions
        action = recommend(report)
        assert words in action.steps[0].replace("\N{NO-BREAK SPACE}", " ")
        assert action.lines == ()


def test_without_a_gap_no_change_is_recommended() -> None:
    assert recommend(make_report("no_gap")).steps == (
        "Keep the simulator as it is for contacts like the recorded ones.",
    )


def test_for_an_unknown_cause_an_inspection_at_its_location_is_recommended() -> None:
    report = make_report("unknown", "unknown")
    report["unexplained"] = {"p_value": 1e-4, "signature": "row", "where": [{"address": 32, "axis": "tx", "index": 2}]}
    action = recommend(report)
    assert "Inspect the hardware at palm, TX" in action.steps[0]
    assert action.lines == ()


def test_for_rivals_a_contact_that_separates_them_is_recommended() -> None:
    report = make_report("unknown", "unknown", confounded_with={"stiffness": ["gain_mismatch"]})
    assert "decides between the possible causes" in recommend(report).steps[0]


def test_two_real_datasets_get_no_lines_for_a_simulator() -> None:
    report = make_report("explained", "gain_mismatch")
    report["inputs"]["real_real"] = True
    assert recommend(report).lines == ()
    assert "simulator" not in " ".join(recommend(report).steps)


def test_the_line_of_confidence_lists_the_four_most_probable_causes_in_order() -> None:
    probabilities = {"noise": 0.97, "latency": 0.2, "a": 0.3, "b": 0.1, "c": 0.09, "unknown": 0.06, "no_gap": 0.0}
    report = make_report("explained", "noise", probabilities=probabilities)
    shown = [name for name, _ in list_shown_causes(CheckedReport(report))]
    assert shown == ["noise", "a", "latency", "b"]
    assert len(shown) == MOST_CAUSES


def test_the_line_of_confidence_emphasises_a_named_cause() -> None:
    text = page_text(make_report("explained", "noise", probabilities={"noise": 0.97, "unknown": 0.06, "no_gap": 0.0}))
    assert re.search(r'<li class="named"><span>noise</span>.*?<b>97.%</b>', text)


def make_neutral_parameters(effect: Effect) -> Report:
    """Return the reported parameters of an effect at their neutral values."""
    parameters = effect.parameters()
    fitted = FittedEffect(effect, np.array([[one.neutral] for one in parameters]))
    return {
        one.name: {"value": one.neutral, "ci95": None, "unit": one.unit, "neutral": find_neutral(fitted, one.name)}
        for one in parameters
    }


@pytest.mark.parametrize("name", [name for name in OWN_EFFECTS if name != "dropout"])
def test_no_parameter_of_the_catalogue_is_shown_at_its_neutral_value(name: str) -> None:
    """Parameters of `SHAPE_PARAMETERS` have no neutral value and are not checked; every form has another parameter."""
    for form in OWN_EFFECTS[name]:
        report = make_report("explained", name)
        report["effects"][0]["parameters"] = parameters = make_neutral_parameters(form)
        shapes = {key for key in parameters if f"{name}.{key}" in SHAPE_PARAMETERS}
        checked = CheckedReport(report)
        text = format_parameters(checked, checked.effects[0])
        assert not [key for key in parameters if key not in shapes and re.search(rf"\b{key.split('_')[0]}\b", text)]
        assert parameters.keys() - shapes, name


@pytest.mark.parametrize(("value", "is_shown"), [(1.0, False), (1.004, False), (1.01, True), (0.5, True)])
def test_a_parameter_is_shown_from_the_second_decimal_of_its_difference(value: float, is_shown: bool) -> None:
    """A difference below 0.005 rounds to 0.00. The scale replaces its logarithm `log_gain`, which is not shown."""
    report = make_report("explained", "gain_mismatch")
    entry = {"value": value, "ci95": None, "unit": "1", "neutral": 1.0}
    report["effects"][0]["parameters"] = {"scale@32": entry, "log_gain@32": {**entry, "neutral": 0.0}}
    checked = CheckedReport(report)
    text = format_parameters(checked, checked.effects[0])
    assert ("scale, palm\N{NO-BREAK SPACE}(0x20)" in text) == is_shown
    assert "log gain" not in text


def print_lines(report: Report) -> list[str]:
    """Return the lines of the printed summary of a report."""
    console = Console(width=WIDTH, record=True, file=open("/dev/null", "w"), color_system=None)  # noqa: SIM115
    print_summary(console, report, "out/gap/report.html")
    return console.export_text().rstrip("\n").split("\n")


REPORTS = {
    "explained": make_report("explained", "contact_propagation"),
    "pair": make_report("explained", "contact_propagation", "noise"),
    "five": make_report("explained", "contact_propagation", "noise", "dropout", "pose_error", "my_own"),
    "partly": make_report("partly_explained", "noise", "unknown", reasons=[f"reason {k} " * 20 for k in range(9)]),
    "unknown": make_report("unknown", "unknown"),
    "no gap": make_report("no_gap"),
    "few": make_report("unknown", "unknown", sessions=1),
    "rivals": make_report("unknown", "unknown", confounded_with={"stiffness": ["gain_mismatch"]}),
}


@pytest.mark.parametrize("name", REPORTS)
def test_the_summary_fits_into_a_terminal_of_24_lines(name: str) -> None:
    report = copy.deepcopy(REPORTS[name])
    report["losses"] = ["a long note on the datasets " * 6] * 12
    report["verdict"]["one_line"] = "a very long sentence " * 20
    report["next_presses"][0]["press"] = "a very long name " * 20
    lines = print_lines(report)
    assert len(lines) <= MOST_LINES
    assert all(len(line) <= WIDTH for line in lines)
    assert lines[-1] == "report: out/gap/report.html"


def test_the_summary_is_printed_in_the_order_of_the_page() -> None:
    text = "\n".join(print_lines(REPORTS["explained"]))
    order = [
        "The real skin differs.",
        "90 %",
        "taxel gap export",
        "SkinEffects",
        "Record next",
        "20.0 counts",
        "(shrink 60 %)",
    ]
    positions = [text.index(words) for words in order]
    assert positions == sorted(positions)


def test_the_summary_shows_no_gap_and_no_shrink_other_than_those_of_held_out_sessions() -> None:
    text = "\n".join(print_lines(REPORTS["explained"]))
    predicted_shrink, reducible_shrink, gap_of_all_sessions = "63 %", "88 %", "19.0"
    for other in (predicted_shrink, reducible_shrink, gap_of_all_sessions):
        assert other not in text
