"""The page of a gap report: sections, texts and pictures of two realistic reports."""

from __future__ import annotations

import copy
import json
import re
import subprocess
import sys
import xml.etree.ElementTree as ET
from collections.abc import Callable
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from taxel.gap.page import page_text, write_page
from taxel.gap.page.term_links import link_terms
from taxel.gap.page.terms import read_definitions
from taxel.hand import load_hand
from taxel.output import OutputError

Report = dict[str, Any]

SEED = 20240607
OBJECTS = ("cylinder", "sphere", "box")
PHASES = ("baseline", "closing", "hold", "release", "recovery")
CATALOGUE = (
    "contact_propagation",
    "electrode_crosstalk",
    "noise",
    "gain_mismatch",
    "stiffness",
    "baseline_drift",
    "hysteresis",
    "saturation",
    "proximity",
    "dropout",
    "pose_error",
    "latency",
)
MAX_BYTES = 1_500_000
VOID = {"meta", "br"}


def shares(weights: np.ndarray[Any, Any]) -> list[float]:
    return [float(weight) for weight in weights / weights.sum()]


def ranked(entries: list[Report], weights: np.ndarray[Any, Any], strong: int) -> list[Report]:
    """Entries with shares, largest first; the first `strong` have a small p-value."""
    order = np.argsort(-weights)
    share = shares(weights)
    return [
        {**entries[k], "share": share[k], "p_value": 0.0004 if rank < strong else min(1.0, 0.1 + 0.07 * rank)}
        for rank, k in enumerate(order.tolist())
    ]


def taxel_table(hand_name: str) -> tuple[Report, list[Report], list[str]]:
    hand = load_hand(hand_name)
    taxels: Report = {"sensor": [], "tx": [], "rx": []}
    for board in hand.boards:
        taxels["sensor"] += [board.address] * board.kind.taxel_count
        taxels["tx"] += board.kind.tx.tolist()
        taxels["rx"] += board.kind.rx.tolist()
    sensors = [{"address": b.address, "name": b.name, "kind": b.kind.name} for b in hand.boards]
    return taxels, sensors, [b.name for b in hand.boards]


def locations(taxels: Report, sensors: list[Report], excess: np.ndarray[Any, Any], strong: bool) -> Report:
    """The lists of "where" for these taxels."""
    address = np.array(taxels["sensor"])
    weights = np.maximum(excess, 0.0) + 1e-3
    boards = np.array([weights[address == s["address"]].sum() for s in sensors])
    lines: list[Report] = []
    for axis in ("tx", "rx"):
        entries, sums = [], []
        for sensor in sensors:
            for index in sorted({v for a, v in zip(address, taxels[axis], strict=True) if a == sensor["address"]}):
                member = (address == sensor["address"]) & (np.array(taxels[axis]) == index)
                entries.append({"address": sensor["address"], "axis": axis, "index": index})
                sums.append(weights[member].sum())
        lines += ranked(entries, np.array(sums), 3 if strong else 0)
    approaches = [{"object": name, "approach": f"side_{k}"} for name in OBJECTS for k in range(1, 6)]
    return {
        "sensors": ranked([{"address": s["address"], "name": s["name"]} for s in sensors], boards, 4 if strong else 0),
        "lines": sorted(lines, key=lambda line: -line["share"]),
        "taxels": ranked([{"index": k} for k in range(len(excess))], weights, 20 if strong else 0),
        "phases": ranked([{"phase": p} for p in PHASES], np.array([0.02, 0.2, 0.55, 0.2, 0.03]), 3 if strong else 0),
        "objects": ranked([{"name": n} for n in OBJECTS], np.array([0.5, 0.3, 0.2]), 1 if strong else 0),
        "approaches": ranked(approaches, np.linspace(2.0, 0.3, len(approaches)), 2 if strong else 0),
    }


def effect(name: str, **fields: Any) -> Report:
    row: Report = {
        "name": name,
        "parameters": {},
        "where": {"sensors": [], "lines": [], "taxels": []},
        "identifiability": "identifiable",
        "gap_after_alone": 15.1,
        "shrink_alone": 0.01,
        "shrink_alone_ci95": [-0.02, 0.04],
        "in_verdict": False,
        "shapley_share": 0.0,
        "predicted_shrink": 0.0,
        "measured_shrink": 0.0,
        "measured_shrink_ci95": None,
    }
    return row | fields


def candidates(sensors: list[Report]) -> list[Report]:
    spread = {"spread_mm": {"value": 3.42, "ci95": [3.1, 3.8], "unit": "mm"}, "strength": {"value": 0.61, "ci95": None}}
    lag = {
        f"seconds@{s['address']}": {"value": 0.01 + 0.002 * k, "ci95": None, "unit": "s"} for k, s in enumerate(sensors)
    }
    rows = {
        "contact_propagation": effect(
            "contact_propagation",
            parameters=spread,
            in_verdict=True,
            shapley_share=0.81,
            predicted_shrink=0.52,
            measured_shrink=0.49,
            measured_shrink_ci95=[0.43, 0.55],
            shrink_alone=0.49,
            shrink_alone_ci95=[0.43, 0.55],
            gap_after_alone=7.8,
        ),
        "noise": effect(
            "noise",
            parameters={"white_counts": {"value": 4.4, "ci95": [4.2, 4.7], "unit": "counts"}},
            in_verdict=True,
            shapley_share=0.19,
            predicted_shrink=0.13,
            measured_shrink=0.12,
            measured_shrink_ci95=[0.08, 0.16],
            shrink_alone=0.1,
            shrink_alone_ci95=[0.06, 0.14],
            gap_after_alone=13.8,
        ),
        "latency": effect("latency", parameters=lag, identifiability="weak"),
        "electrode_crosstalk": effect(
            "electrode_crosstalk", shrink_alone=0.18, shrink_alone_ci95=[0.1, 0.26], gap_after_alone=12.5
        ),
        "gain_mismatch": effect("gain_mismatch", identifiability="confounded"),
        "proximity": effect("proximity", identifiability="not_excited"),
        "pose_error": effect("pose_error", identifiability="unavailable", shrink_alone=None, gap_after_alone=None),
        "dropout": effect("dropout", where={"sensors": [sensors[0]["address"]], "lines": [], "taxels": [3]}),
    }
    return [rows.get(name, effect(name)) for name in CATALOGUE]


def report_of(hand_name: str) -> Report:
    """A report with two effects and an unexplained part, as the diagnosis writes it."""
    random = np.random.default_rng(SEED)
    taxels, sensors, names = taxel_table(hand_name)
    count = len(taxels["sensor"])
    address = np.array(taxels["sensor"])
    board = np.array([float(random.uniform(0.1, 1.0)) ** 2 for _ in names])[
        np.searchsorted(np.unique(address), address)
    ]
    middle = np.exp(-((np.array(taxels["tx"]) - 5.0) ** 2 + (np.array(taxels["rx"]) - 5.0) ** 2) / 14.0)
    before = 900.0 * board * middle * random.uniform(0.6, 1.4, count) + random.normal(0.0, 4.0, count)
    after = 0.12 * before + random.normal(0.0, 4.0, count)
    is_unexplained = (address == sensors[0]["address"]) & (np.array(taxels["tx"]) == 2)
    after[is_unexplained] += 160.0
    parts = [{"before": 17.0 - 2 * k, "after": 6.0 - k, "floor": 2.5 + 0.2 * k} for k in range(3)]
    return {
        "format": "taxel-gap-report",
        "version": 1,
        "inputs": {
            "real": {"path": "campaign/monday/real.h5", "sha256": "8f" * 32},
            "sim": {"path": "campaign/monday/sim.h5", "sha256": "1c" * 32},
        },
        "seed": 7,
        "runtime_s": 83.4,
        "gap": {
            "value": 15.3,
            "ci95": [14.1, 16.5],
            "floor": 2.81,
            "excess": 226.2,
            "p_value": 0.0002,
            "significant": True,
            "mm": {"value": 4.6, "ci95": [4.1, 5.2], "floor": 1.2, "placebo": 3.9},
        },
        "where": locations(taxels, sensors, before, strong=True),
        "verdict": {
            "status": "partly_explained",
            "effects": ["contact_propagation", "noise", "unknown"],
            "confounded_with": {"gain_mismatch": ["stiffness", "saturation"]},
            "one_line": "Contact propagation and noise explain 61 % of the gap; a part on one TX line is unexplained.",
        },
        "effects": candidates(sensors),
        "after": {
            "before": 15.1,
            "value": 5.9,
            "floor": 2.9,
            "ci95": [5.2, 6.7],
            "predicted_shrink": 0.63,
            "shrink": 0.61,
            "reducible_shrink": 0.88,
        },
        "unexplained": {
            "p_value": 0.0008,
            "signature": "row: the signal of one TX line is too large",
            "where": [{"address": sensors[0]["address"], "axis": "tx", "index": 2}],
        },
        "taxels": taxels,
        "sensors": sensors,
        "taxel_excess": {"before": before.tolist(), "after": after.tolist()},
        "counts": {"real": {"grasps": 144, "sessions": 6}, "sim": {"grasps": 144}, "cells": 15},
        "waterfall": [
            {"effect": "contact_propagation", "gap": 7.7, "ci95": [6.9, 8.6]},
            {"effect": "noise", "gap": 5.9, "ci95": None},
        ],
        "ablation": [{"without": "contact_propagation", "gap": 13.4}, {"without": "noise", "gap": 7.7}],
        "by_object": [{"name": name, **part} for name, part in zip(OBJECTS, parts, strict=True)],
        "by_sensor": [{"address": s["address"], "name": s["name"], **parts[k % 3]} for k, s in enumerate(sensors)],
        "thesis_terms": [
            {"step": "as simulated", "gap": 15.3, "mm": 4.6},
            {"step": "force filter", "gap": 14.2, "mm": 4.4},
            {"step": "contact propagation", "gap": 7.9, "mm": 2.1},
        ],
        "next_presses": [
            {
                "press": "one taxel of the palm at 1, 2, 5 and 10 N",
                "separates": ["gain_mismatch", "stiffness"],
                "gain": 0.7,
            },
            {"press": "close twice, at half the speed", "separates": ["latency", "hysteresis"], "gain": 0.21},
        ],
        "losses": ["baselines of 60 frames instead of 100"],
        "margin": {"excess_counts2": 2.0, "words": "a quarter of the floor squared"},
        "notes": ["the p-values are from 999 draws"],
    }


def no_gap_report(hand_name: str) -> Report:
    """A report of two datasets that agree."""
    report = report_of(hand_name)
    random = np.random.default_rng(SEED + 1)
    taxels, sensors, _ = taxel_table(hand_name)
    noise = random.normal(0.0, 3.0, len(taxels["sensor"]))
    report["gap"] |= {"value": 2.9, "ci95": None, "excess": 0.4, "p_value": 0.43, "significant": False}
    report["where"] = locations(taxels, sensors, noise, strong=False)
    line = "No gap: hand and simulator agree within the variance between repeats."
    report["verdict"] = {"status": "no_gap", "effects": [], "confounded_with": {}, "one_line": line}
    report["effects"] = [row | {"in_verdict": False, "shrink_alone": 0.01} for row in report["effects"]]
    numbers = {"before": 2.9, "value": 2.9, "predicted_shrink": 0.0, "shrink": 0.0, "reducible_shrink": None}
    report["after"] |= numbers | {"ci95": None}
    report["unexplained"] = {"p_value": 0.5, "signature": "", "where": []}
    report["taxel_excess"] = {"before": noise.tolist(), "after": noise.tolist()}
    report |= {"waterfall": [], "ablation": [], "next_presses": [], "losses": [], "notes": []}
    return report


@pytest.fixture(scope="module")
def full() -> Report:
    return report_of("allegro")


@pytest.fixture
def small() -> Report:
    return report_of("rig4")


def minimal_report() -> Report:
    """Only the fields that the format requires."""
    report = report_of("rig4")
    optional = ("taxels", "sensors", "taxel_excess", "counts", "waterfall", "ablation", "by_object", "by_sensor")
    for key in (*optional, "thesis_terms", "next_presses", "losses", "margin", "notes"):
        del report[key]
    return report


def parsed(text: str) -> ET.Element:
    return ET.fromstring(text)


def titles(text: str) -> list[str]:
    return ["".join(heading.itertext()) for heading in parsed(text).iter("h2")]


def visible(text: str) -> str:
    """The text of a page; links to terms do not divide it."""
    root = parsed(re.sub(r'<a class="term"[^>]*>([^<]*)</a>', r"\1", text))
    return " ".join(" ".join(root.itertext()).replace("\N{NO-BREAK SPACE}", " ").split())


class NestingChecker(HTMLParser):
    """Fails where an HTML parser would see other elements than an XML parser."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []

    def handle_starttag(self, tag: str, attrs: object) -> None:
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: object) -> None:
        assert tag in VOID or "svg" in self.open, f"<{tag}/> is not closed for an HTML parser"

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


def test_page_of_the_full_hand_has_every_section_in_order(full: Report) -> None:
    assert titles(page_text(full)) == ["What to do", "Before and after", "Certainty", "Figures", "Terms", "Inputs"]
    figures = next(section for section in parsed(page_text(full)).iter("section") if section.get("id") == "figures")
    assert [part.get("id") for part in figures.iter("section")][1:] == [
        *("effects", "waterfall", "ablation", "where", "unexplained", "parts", "thesis")
    ]


def test_the_first_use_of_a_term_in_a_section_has_its_definition(full: Report) -> None:
    definitions = read_definitions()
    page = parsed(page_text(full))
    anchors = {element.get("id") for element in page.iter() if element.get("id")}
    links = [element for element in page.iter("a") if element.get("class") == "term"]
    assert {f"#term-{name}" for name in ("gap", "floor", "shrink", "session", "taxel")} <= {
        x.get("href") for x in links
    }
    for link in links:
        assert (link.get("href") or "").removeprefix("#") in anchors
        assert link.get("title") in definitions.values()


def test_terms_are_linked_only_in_text() -> None:
    text = link_terms('<p title="gap">a gap &amp; gaps</p><code>gap</code><svg><text>gap</text></svg><p>board.h5</p>')
    assert text.count("<a ") == 1
    assert text.startswith('<p title="gap">a <a class="term" href="#term-gap" title="The gap')
    assert text.endswith(" &amp; gaps</p><code>gap</code><svg><text>gap</text></svg><p>board.h5</p>")


def test_definitions_of_the_terms_are_those_of_the_glossary() -> None:
    program = Path(__file__).parents[3] / "tools" / "codegen" / "page_terms.py"
    subprocess.run([sys.executable, program, "--check"], check=True)


def test_the_verdict_is_the_heading(full: Report) -> None:
    (heading,) = parsed(page_text(full)).iter("h1")
    assert heading.text == full["verdict"]["one_line"]


def test_the_page_contains_the_figures_of_the_report(full: Report) -> None:
    text = visible(page_text(full))
    for words in ("15.1 counts", "5.2", "5.90 counts", "2.90 counts", "61 %", "4.60 mm", "3.90 mm", "p < 0.001"):
        assert words in text


def test_the_page_has_one_gap_and_one_shrink(full: Report) -> None:
    """The predicted shrink (63 %), that of the excess (88 %), those of single effects and other gaps are not shown."""
    report = copy.deepcopy(full)
    report["gap"] |= {"value": 1371.0, "ci95": [1370.0, 1372.0], "floor": 1373.0}
    text = visible(page_text(report))
    for other in ("1,371", "1,370", "1,373", "63 %", "88 %", "52 %", "49 %"):
        assert other not in text
    assert "5.59 counts" in text  # predicted gap after


def test_further_results_are_on_the_page(full: Report) -> None:
    text = visible(page_text(full))
    for words in (
        "spread 3.42 mm",
        "144 grasps on the hand in 6 sessions",
        "palm, TX 2",
        "stiffness or saturation",
        "palm (0x20)",
    ):
        assert words in text
    for words in ("baselines of 60 frames", "999 draws", "8f8f8f", "Seed 7", "1 minute 23 s"):
        assert words in text


def test_xml_and_html_parsers_see_the_same_elements(full: Report) -> None:
    text = page_text(full)
    parsed(text)
    reader = NestingChecker()
    reader.feed(text)
    assert reader.open == []


def test_the_page_has_no_external_resources_and_no_scripts(full: Report) -> None:
    text = page_text(full)
    assert not re.search(r"https?:|//[a-z]|url\(|@import|<script|<link|<img|<iframe| on[a-z]+=", text)
    policy = next(meta for meta in parsed(text).iter("meta") if meta.get("http-equiv"))
    assert policy.get("content", "").startswith("default-src 'none'")


def test_every_picture_has_a_description_or_is_hidden_from_screen_readers(full: Report) -> None:
    root = parsed(page_text(full))
    ids = [element.get("id") for element in root.iter() if element.get("id")]
    assert len(ids) == len(set(ids))
    inner = {id(child) for picture in root.iter("svg") for child in picture.iter("svg") if child is not picture}
    for picture in root.iter("svg"):
        if id(picture) in inner or picture.get("aria-hidden") == "true":
            continue
        assert picture.get("role") == "img"
        for name in (picture.get("aria-labelledby") or "").split():
            assert name in ids


def test_every_link_leads_to_a_section(full: Report) -> None:
    root = parsed(page_text(full))
    anchors = {section.get("id") for section in root.iter("section")}
    links = {(link.get("href") or "").removeprefix("#") for link in root.iter("a") if link.get("class") != "term"}
    assert links <= anchors
    assert links == {"action", "hand", "certainty", "figures", "terms", "inputs"}


def test_the_page_of_the_full_hand_is_below_the_size_limit(full: Report) -> None:
    assert len(page_text(full).encode()) < MAX_BYTES


def test_equal_reports_give_equal_bytes(full: Report, tmp_path: Path) -> None:
    write_page(full, tmp_path / "a.html")
    write_page(json.loads(json.dumps(full)), tmp_path / "b.html")
    assert (tmp_path / "a.html").read_bytes() == (tmp_path / "b.html").read_bytes()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.html", "b.html"]


def test_sections_without_content_are_omitted() -> None:
    page = page_text(minimal_report())
    assert titles(page) == ["What to do", "Before and after", "Certainty", "Figures", "Terms", "Inputs"]
    anchors = {section.get("id") for section in parsed(page).iter("section")}
    assert anchors >= {"where", "effects", "unexplained"}
    assert not anchors & {"waterfall", "ablation", "parts", "thesis", "resimulated"}


def test_empty_optional_fields_are_omitted_like_absent_ones() -> None:
    report = minimal_report()
    report |= {"taxels": {}, "sensors": [], "taxel_excess": {}, "counts": {}, "waterfall": [], "ablation": []}
    report |= {"by_object": [], "by_sensor": [], "thesis_terms": [], "next_presses": [], "losses": [], "notes": []}
    assert page_text(report) == page_text(minimal_report())


def test_without_a_gap_the_pictures_are_described_as_noise() -> None:
    text = page_text(no_gap_report("rig4"))
    assert "The remaining noise" in titles(text)
    assert "Location of the noise" in visible(text)
    assert "Gap after each effect" not in visible(text)
    assert text.count('class="stage"') == 1
    assert "agree within the variance between repeats of the same grasp" in visible(text)
    assert "No effect is needed." in visible(text)
    steps = [int(match) for match in re.findall(r'class="q(\d+)" x="[\d.]+" y', text)]
    assert np.mean(steps) < 5


def test_a_small_significant_gap_is_not_described_as_noise() -> None:
    report = no_gap_report("rig4")
    report["verdict"]["one_line"] = "No gap: 2.9 counts; repeats and sessions alone cause 2.8."
    report["gap"]["significant"] = True
    text = visible(page_text(report))
    assert "hardly due to chance" in text
    assert "within the variance" not in text


def test_locations_with_a_negligible_share_are_not_listed(small: Report) -> None:
    board = small["sensors"][0]["address"]
    small["unexplained"] |= {"p_value": 1e-4, "signature": "one board"}
    small["unexplained"]["where"] = [{"address": board, "share": share} for share in (0.81234, 0.0004)]
    text = visible(page_text(small))
    assert "81 %" in text
    assert ": 0 %" not in text


def test_dead_taxels_are_listed_as_integers(small: Report) -> None:
    small["verdict"] |= {"status": "explained", "effects": ["dropout"]}
    for row in small["effects"]:
        row["in_verdict"] = row["name"] == "dropout"
        if row["in_verdict"]:
            row["parameters"] = {"taxels": {"value": [70, 71, 1072], "ci95": None, "unit": "index"}}
    text = visible(page_text(small))
    assert "70, 71 and 1072" in text
    assert "70.0" not in text


def test_an_unknown_cause_has_a_signature_and_no_effect(small: Report) -> None:
    small["verdict"] |= {"status": "unknown", "effects": ["unknown"]}
    for row in small["effects"]:
        row["in_verdict"] = False
    text = visible(page_text(small))
    assert "No effect of the catalogue is the cause." in text
    assert "in the verdict" not in text
    assert "Signature: row" in text


def test_an_insignificant_remaining_gap_is_not_called_unexplained(small: Report) -> None:
    small["unexplained"]["p_value"] = 0.3
    assert "not significantly above the floor (p = 0.30)" in visible(page_text(small))


def test_the_waterfall_starts_with_a_first_entry_named_gap(small: Report) -> None:
    small["waterfall"].insert(0, {"effect": "gap", "gap": 15.25, "ci95": [14.0, 16.0]})
    rows = visible(page_text(small))
    assert "14.0 to 16.0" in rows
    assert "+ gap" not in rows


def test_an_effect_that_increases_the_gap_is_marked(small: Report) -> None:
    small["waterfall"][1]["gap"] = 9.0
    text = page_text(small)
    assert 'class="worse"' in text
    assert "+1.3" in visible(text)


def test_without_intervals_in_the_report_the_figures_have_none(small: Report) -> None:
    small["gap"]["ci95"] = small["after"]["ci95"] = None
    assert "5.20 to 6.70" not in visible(page_text(small))


def test_the_report_is_not_modified(small: Report) -> None:
    original = copy.deepcopy(small)
    page_text(small)
    assert small == original


def test_long_lists_are_shortened_with_a_count(full: Report) -> None:
    assert re.search(r"\d+ more: \d+ % in total", visible(page_text(full)))


def test_parameters_of_many_boards_are_folded_behind_their_range(full: Report) -> None:
    assert "seconds of 17 boards: 0.0100 to 0.0420 s" in visible(page_text(full))


def test_a_failed_write_leaves_no_file(small: Report, tmp_path: Path) -> None:
    (tmp_path / "folder").mkdir()
    with pytest.raises(OutputError):
        write_page(small, tmp_path / "folder")
    with pytest.raises(OSError):
        write_page(small, tmp_path / ("x" * 300))
    assert [path.name for path in tmp_path.iterdir()] == ["folder"]


@pytest.mark.parametrize("make", [report_of, no_gap_report])
@pytest.mark.parametrize("hand_name", ["allegro", "rig4", "flat8"])
def test_any_hand_gives_a_page(make: Callable[[str], Report], hand_name: str) -> None:
    parsed(page_text(make(hand_name)))
