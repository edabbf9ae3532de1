"""Untrusted reports: texts are escaped on the page, and malformed fields raise an error with a one-line message."""

from __future__ import annotations

import copy
import math
import pickle
import re
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from taxel.gap.errors import GapInputError
from taxel.gap.page import page_text, write_page

Report = dict[str, Any]
KeyPath = tuple[str | int, ...]

HOSTILE_TEXT = '<script>alert("x")</script>&amp;\x00\ud800\u202e\'--> </style>'
MISSING = object()
WRONG_VALUES = (MISSING, None, "x", -1, 1e308, 10**400, True, math.nan, [], {}, [None], [[]], {"": None})


def make_share_entry(**location: Any) -> Report:
    return {**location, "share": 1.0, "p_value": 0.01}


@pytest.fixture
def report() -> Report:
    """A report with two boards of two taxels and one entry in every list."""
    effect = {
        "name": "noise",
        "parameters": {"white_counts": {"value": 4.4, "ci95": [4.2, 4.7], "unit": "counts"}},
        "where": {"sensors": [80], "lines": [[80, "tx", 0]], "taxels": [1]},
        "identifiability": "weak",
        "gap_after_alone": 4.0,
        "shrink_alone": 0.2,
        "shrink_alone_ci95": [0.1, 0.3],
        "in_verdict": True,
        "shapley_share": 1.0,
        "predicted_shrink": 0.2,
        "measured_shrink": 0.2,
        "measured_shrink_ci95": None,
    }
    return {
        "format": "taxel-gap-report",
        "version": 2,
        "inputs": {
            "real": {"path": "real.h5", "sha256": "0a"},
            "sim": {"path": "sim.h5", "sha256": "0b"},
            "problems": [{"file": "sim", "grasp": "g", "frames": [1, 2], "problem": "a jump", "handled": "left out"}],
        },
        "seed": 0,
        "runtime_s": 1.0,
        "gap": {
            "value": 5.0,
            "ci95": [4.0, 6.0],
            "floor": 2.0,
            "excess": 21.0,
            "p_value": 0.01,
            "significant": True,
            "bound": 5.5,
            "mm": {"value": 2.0, "ci95": None, "floor": 1.0, "placebo": 1.5},
        },
        "where": {
            "sensors": [make_share_entry(address=80, name="slab")],
            "lines": [
                make_share_entry(address=80, axis="tx", index=0),
                make_share_entry(address=80, axis="rx", index=1),
            ],
            "taxels": [make_share_entry(index=0)],
            "phases": [make_share_entry(phase="hold")],
            "objects": [make_share_entry(name="box")],
            "approaches": [make_share_entry(object="box", approach="top")],
        },
        "verdict": {
            "status": "explained",
            "effects": ["noise"],
            "confounded_with": {"noise": ["latency"]},
            "one_line": "Noise.",
            "headline": "The real skin is noisier.",
            "probabilities": {"noise": 0.9, "latency": 0.01, "unknown": 0.1, "no_gap": 0.05},
            "reasons": ["a bound"],
        },
        "effects": [effect],
        "after": {
            "before": 5.0,
            "value": 4.0,
            "floor": 2.0,
            "ci95": None,
            "predicted_shrink": 0.2,
            "shrink": 0.2,
            "reducible_shrink": None,
        },
        "unexplained": {"p_value": 0.01, "signature": "a row", "where": ["a place", {"address": 81}]},
        "taxels": {"sensor": [80, 80, 81, 81], "tx": [0, 0, 0, 1], "rx": [0, 1, 0, 0]},
        "sensors": [{"address": 80, "name": "slab", "kind": "flat"}, {"address": 81, "name": "wall", "kind": "flat"}],
        "taxel_excess": {"before": [9.0, 4.0, 1.0, -1.0], "after": [1.0, None, 0.0, 0.0]},
        "counts": {"real": {"grasps": 8, "sessions": 2}, "sim": {"grasps": 4}, "cells": 2},
        "waterfall": [
            {"effect": "noise", "gap": 4.5, "ci95": None},
            {"effect": "latency", "gap": 4.0, "ci95": [3.0, 5.0]},
        ],
        "ablation": [{"without": "noise", "gap": 5.0}],
        "by_object": [{"name": "box", "before": 5.0, "after": 4.0, "floor": 2.0}],
        "by_sensor": [{"address": 80, "name": "slab", "before": 5.0, "after": 4.0, "floor": 2.0}],
        "thesis_terms": [{"step": "as simulated", "gap": 5.0, "mm": 2.0}],
        "next_presses": [{"press": "harder", "separates": ["noise", "latency"], "gain": 0.5}],
        "losses": ["two sessions"],
        "notes": ["a note"],
        "influence": [{"effect": "noise", "object": "box", "approach": "top", "share": 0.7}],
    }


def parse_xml(text: str) -> ET.Element:
    return ET.fromstring(text)


def change_report(report: Report, path: KeyPath, value: object) -> Report:
    """Return a copy with another value at a path, or without the field."""
    copied = copy.deepcopy(report)
    *outer, last = path
    inner: Any = copied
    for key in outer:
        inner = inner[key]
    if value is MISSING:
        del inner[last]
    else:
        inner[last] = value
    return copied


def list_key_paths(value: Any, prefix: KeyPath = ()) -> Iterator[KeyPath]:
    """Yield the path of keys to every value in nested tables and lists."""
    keys = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, inner in keys:
        yield (*prefix, key)
        yield from list_key_paths(inner, (*prefix, key))


@pytest.mark.parametrize(
    "path",
    [
        ("verdict", "one_line"),
        ("inputs", "real", "path"),
        ("where", "sensors", 0, "name"),
        ("where", "phases", 0, "phase"),
        ("where", "approaches", 0, "approach"),
        ("effects", 0, "name"),
        ("effects", 0, "parameters", "white_counts", "unit"),
        ("unexplained", "signature"),
        ("unexplained", "where", 0),
        ("sensors", 0, "name"),
        ("waterfall", 0, "effect"),
        ("ablation", 0, "without"),
        ("by_object", 0, "name"),
        ("thesis_terms", 0, "step"),
        ("next_presses", 0, "press"),
        ("losses", 0),
        ("verdict", "headline"),
        ("verdict", "reasons", 0),
        ("influence", 0, "approach"),
        ("inputs", "problems", 0, "problem"),
        ("notes", 0),
    ],
)
def test_text_of_the_report_cannot_become_markup(report: Report, path: KeyPath, tmp_path: Path) -> None:
    write_page(change_report(report, path, HOSTILE_TEXT), tmp_path / "page.html")
    text = (tmp_path / "page.html").read_text(encoding="utf-8")
    root = parse_xml(text)
    assert "script" not in {element.tag for element in root.iter()}
    assert len(list(root.iter("style"))) == 1
    assert not any(mark in text for mark in ("\x00", "\u202e"))


def test_keys_of_the_report_are_escaped(report: Report) -> None:
    report["verdict"]["confounded_with"] = {HOSTILE_TEXT: [HOSTILE_TEXT]}
    report["effects"][0]["parameters"] = {
        HOSTILE_TEXT: {"value": 1.0, "unit": "mm"},
        f"gain@{HOSTILE_TEXT}": {"value": 2},
    }
    assert "script" not in {element.tag for element in parse_xml(page_text(report)).iter()}


@pytest.mark.parametrize(
    ("path", "value", "line"),
    [
        (("format",), "other", "report: format: expected 'taxel-gap-report', found 'other'"),
        (("version",), True, "report: version: expected 1 or 2, found true"),
        (("after", "before"), "15", "report: after.before: expected a number, found '15'"),
        (("after", "before"), float("nan"), "report: after.before: expected a finite number, found nan"),
        (("after", "value"), 10**400, "report: after.value: expected a finite number, found an integer of 1329 bits"),
        (
            ("after", "ci95"),
            [2.0],
            "report: after.ci95: expected two numbers, the smaller first, or null, found a list",
        ),
        (("after", "ci95"), [2.0, 1.0], "report: after.ci95: expected two numbers, the smaller first"),
        (("gap", "significant"), 1, "report: gap.significant: expected true or false, found 1"),
        (("verdict", "status"), "fine", "report: verdict.status: expected one of no_gap, explained"),
        (("verdict", "status"), ["no_gap"], "report: verdict.status: expected one of"),
        (("verdict", "effects"), "noise", "report: verdict.effects: expected a list, found 'noise'"),
        (("where", "lines", 1, "axis"), "x", "report: where.lines[1].axis: expected one of tx, rx, found 'x'"),
        (
            ("where", "sensors", 0, "address"),
            3000,
            "report: where.sensors[0].address: expected an integer from 0 to 255",
        ),
        (("effects", 0, "identifiability"), "yes", "report: effects[0].identifiability: expected one of identifiable"),
        (("effects", 0, "parameters"), [], "report: effects[0].parameters: expected a table, found a list"),
        (("unexplained", "where", 0), {}, "report: unexplained.where[0]: expected a string, or a table"),
        (("taxels", "tx"), [1], "report: taxels.tx: expected 4 integers, as in taxels.sensor, found 1"),
        (("taxels", "rx", 3), -1, "report: taxels.rx[3]: expected an integer from 0 to 255, found -1"),
        (("taxel_excess", "after"), [0.0], "report: taxel_excess.after: expected 4 numbers, found 1"),
        (("waterfall", 0, "gap"), None, "report: waterfall[0].gap: expected a number, found None"),
        (("notes",), "text", "report: notes: expected a list, found 'text'"),
        (("seed",), 1.5, "report: seed: expected an integer"),
        (("inputs", "sim"), None, "report: inputs.sim: expected a table, found None"),
    ],
)
def test_a_malformed_field_raises_one_line_and_nothing_is_written(
    report: Report, path: KeyPath, value: object, line: str, tmp_path: Path
) -> None:
    with pytest.raises(GapInputError) as caught:
        write_page(change_report(report, path, value), tmp_path / "page.html")
    assert str(caught.value).startswith(line)
    assert "\n" not in str(caught.value)
    assert str(pickle.loads(pickle.dumps(caught.value))) == str(caught.value)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    "key", ["format", "inputs", "seed", "gap", "where", "verdict", "effects", "after", "unexplained"]
)
def test_the_error_names_a_missing_required_field(report: Report, key: str) -> None:
    with pytest.raises(GapInputError, match=rf"^report: {key}: expected a field of that name, found none"):
        page_text(change_report(report, (key,), MISSING))


@pytest.mark.parametrize("content", [[], "text", None, 3])
def test_content_that_is_not_a_table_is_rejected(content: Any) -> None:
    with pytest.raises(GapInputError, match="expected a table"):
        page_text(content)


def test_a_repeated_taxel_is_rejected(report: Report) -> None:
    for column in report["taxels"].values():
        column[1] = column[0]
    with pytest.raises(GapInputError, match="each crossing once"):
        page_text(report)


def get_rejection(report: Report) -> str:
    """Return the error message for a report; empty if the report is accepted."""
    try:
        parse_xml(page_text(report))
    except GapInputError as error:
        return str(error)
    return ""


def test_any_wrong_value_is_shown_or_rejected_in_one_line(report: Report) -> None:
    for path in list_key_paths(report):
        for value in WRONG_VALUES:
            line = get_rejection(change_report(report, path, value))
            assert not line or re.fullmatch(r"report: .*: expected .*, found .*; .*", line), (path, value)
