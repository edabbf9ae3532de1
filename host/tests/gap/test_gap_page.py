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


def normalise(weights: np.ndarray[Any, Any]) -> list[float]:
    return [float(weight) for weight in weights / weights.sum()]


def rank_entries(entries: list[Report], weights: np.ndarray[Any, Any], strong: int) -> list[Report]:
    """Return entries with shares, largest first; the first `strong` entries have a small p-value."""
    order = np.argsort(-weights)
    share = normalise(weights)
    return [
        {**entries[k], "share": share[k], "p_value": 0.0004 if rank < strong else min(1.0, 0.1 + 0.07 * rank)}
        for rank, k in enumerate(order.tolist())
    ]


def make_taxel_table(hand_name: str) -> tuple[Report, list[Report], list[str]]:
    """Return the fields `taxels` and `sensors` of a report on a packaged hand, and the names of its boards."""
    hand = load_hand(hand_name)
    taxels: Report = {"sensor": [], "tx": [], "rx": []}
    for board in hand.boards:
        taxels["sensor"] += [board.address] * board.kind.taxel_count
        taxels["tx"] += board.kind.tx.tolist()
        taxels["rx"] += board.kind.rx.tolist()
    sensors = [{"address": b.address, "name": b.name, "kind": b.kind.name} for b in hand.boards]
    return taxels, sensors, [b.name for b in hand.boards]


def make_locations(taxels: Report, sensors: list[Report], excess: np.ndarray[Any, Any], strong: bool) -> Report:
    """Return the lists of "where" for these taxels. strong: whether the first entries are significant."""
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
        lines += rank_entries(entries, np.array(sums), 3 if strong else 0)
    approaches = [{"object": name, "approach": f"side_{k}"} for name in OBJECTS for k in range(1, 6)]
    return {
        "sensors": rank_entries(
            [{"address": s["address"], "name": s["name"]} for s in sensors], boards, 4 if strong else 0
        ),
        "lines": sorted(lines, key=lambda line: -line["share"]),
        "taxels": rank_entries([{"index": k} for k in range(len(excess))], weights, 20 if strong else 0),
        "phases": rank_entries(
            [{"phase": p} for p in PHASES], np.array([0.02, 0.2, 0.55, 0.2, 0.03]), 3 if strong else 0
        ),
        "objects": rank_entries([{"name": n} for n in OBJECTS], np.array([0.5, 0.3, 0.2]), 1 if strong else 0),
        "approaches": rank_entries(approaches, np.linspace(2.0, 0.3, len(approaches)), 2 if strong else 0),
    }


def make_effect(name: str, **fields: Any) -> Report:
    """Return an entry in `effects`, by default of an effect that hardly reduces the gap. fields: other values."""
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


def make_effects(sensors: list[Report]) -> list[Report]:
    """Return the entries of all effects; the verdict names contact propagation and noise."""
    spread = {"spread_mm": {"value": 3.42, "ci95": [3.1, 3.8], "unit": "mm"}, "strength": {"value": 0.61, "ci95": None}}
    lag = {
        f"seconds@{s['address']}": {"value": 0.01 + 0.002 * k, "ci95": None, "unit": "s"} for k, s in enumerate(sensors)
    }
    rows = {
        "contact_propagation": make_effect(
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
        "noise": make_effect(
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
        "latency": make_effect("latency", parameters=lag, identifiability="weak"),
        "electrode_crosstalk": make_effect(
            "electrode_crosstalk", shrink_alone=0.18, shrink_alone_ci95=[0.1, 0.26], gap_after_alone=12.5
        ),
        "gain_mismatch": make_effect("gain_mismatch", identifiability="confounded"),
        "proximity": make_effect("proximity", identifiability="not_excited"),
        "pose_error": make_effect("pose_error", identifiability="unavailable", shrink_alone=None, gap_after_alone=None),
        "dropout": make_effect("dropout", where={"sensors": [sensors[0]["address"]], "lines": [], "taxels": [3]}),
    }
    return [rows.get(name, make_effect(name)) for name in CATALOGUE]


def make_report(hand_name: str) -> Report:
    """Return a report with two effects and an unexplained part, in the format of the diagnosis."""
    random = np.random.default_rng(SEED)
    taxels, sensors, names = make_taxel_table(hand_name)
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
    gaps = [{"before": 17.0 - 2 * k, "after": 6.0 - k, "floor": 2.5 + 0.2 * k} for k in range(3)]
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
        "where": make_locations(taxels, sensors, before, strong=True),
        "verdict": {
            "status": "partly_explained",
            "effects": ["contact_propagation", "noise", "unknown"],
            "confounded_with": {"gain_mismatch": ["stiffness", "saturation"]},
            "one_line": "Contact propagation and noise explain 61 % of the gap; a part on one TX line is unexplained.",
        },
        "effects": make_effects(sensors),
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
        "by_object": [{"name": name, **gap} for name, gap in zip(OBJECTS, gaps, strict=True)],
        "by_sensor": [{"address": s["address"], "name": s["name"], **gaps[k % 3]} for k, s in enumerate(sensors)],
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


def make_no_gap_report(hand_name: str) -> Report:
    """Return a report of two datasets without a gap."""
    report = make_report(hand_name)
    random = np.random.default_rng(SEED + 1)
    taxels, sensors, _ = make_taxel_table(hand_name)
    noise = random.normal(0.0, 3.0, len(taxels["sensor"]))
    report["gap"] |= {"value": 2.9, "ci95": None, "excess": 0.4, "p_value": 0.43, "significant": False}
    report["where"] = make_locations(taxels, sensors, noise, strong=False)
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
def allegro_report() -> Report:
    return make_report("allegro")


@pytest.fixture
def rig4_report() -> Report:
    return make_report("rig4")


def make_minimal_report() -> Report:
    """Return a report with only the fields that the format requires."""
    report = make_report("rig4")
    optional = ("taxels", "sensors", "taxel_excess", "counts", "waterfall", "ablation", "by_object", "by_sensor")
    for key in (*optional, "thesis_terms", "next_presses", "losses", "margin", "notes"):
        del report[key]
    return report


def parse_xml(text: str) -> ET.Element:
    return ET.fromstring(text)


def list_titles(text: str) -> list[str]:
    return ["".join(heading.itertext()) for heading in parse_xml(text).iter("h2")]


def extract_text(text: str) -> str:
    """Return the text of a page without its links to terms."""
    root = parse_xml(re.sub(r'<a class="term"[^>]*>([^<]*)</a>', r"\1", text))
    return " ".join(" ".join(root.itertext()).replace("\N{NO-BREAK SPACE}", " ").split())


class NestingChecker(HTMLParser):
    """Parser that fails if an HTML parser sees other elements than an XML parser."""

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


def test_page_of_the_full_hand_has_every_section_in_order(allegro_report: Report) -> None:
    assert list_titles(page_text(allegro_report)) == [
        "What to do",
        "Before and after",
        "Certainty",
        "Figures",
        "Terms",
        "Inputs",
    ]
    figures = next(
        section for section in parse_xml(page_text(allegro_report)).iter("section") if section.get("id") == "figures"
    )
    assert [part.get("id") for part in figures.iter("section")][1:] == [
        *("effects", "waterfall", "ablation", "where", "unexplained", "parts", "thesis")
    ]


def test_the_first_use_of_a_term_in_a_section_has_its_definition(allegro_report: Report) -> None:
    definitions = read_definitions()
    page = parse_xml(page_text(allegro_report))
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


def test_the_verdict_is_the_heading(allegro_report: Report) -> None:
    (heading,) = parse_xml(page_text(allegro_report)).iter("h1")
    assert heading.text == allegro_report["verdict"]["one_line"]


def test_the_page_contains_the_figures_of_the_report(allegro_report: Report) -> None:
    text = extract_text(page_text(allegro_report))
    for words in ("15.1 counts", "5.2", "5.90 counts", "2.90 counts", "61 %", "4.60 mm", "3.90 mm", "p < 0.001"):
        assert words in text


def test_the_page_shows_no_gap_and_no_shrink_other_than_those_of_held_out_sessions(allegro_report: Report) -> None:
    """The page has no predicted shrink (63 %), no shrink of the excess (88 %), and no shrink of a single effect.

    The gap of all sessions, its interval and its floor (1,370 to 1,373 counts) are not on the page either.
    """
    report = copy.deepcopy(allegro_report)
    report["gap"] |= {"value": 1371.0, "ci95": [1370.0, 1372.0], "floor": 1373.0}
    text = extract_text(page_text(report))
    for other in ("1,371", "1,370", "1,373", "63 %", "88 %", "52 %", "49 %"):
        assert other not in text
    assert "5.59 counts" in text  # the gap predicted after the effects: 63 % below 15.1 counts


def test_the_page_contains_parameters_locations_counts_and_inputs(allegro_report: Report) -> None:
    text = extract_text(page_text(allegro_report))
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


def test_xml_and_html_parsers_see_the_same_elements(allegro_report: Report) -> None:
    """The page is valid XML, and for an HTML parser every element is closed in the order of the nesting."""
    text = page_text(allegro_report)
    parse_xml(text)
    reader = NestingChecker()
    reader.feed(text)
    assert reader.open == []


def test_the_page_has_no_external_resources_and_no_scripts(allegro_report: Report) -> None:
    text = page_text(allegro_report)
    assert not re.search(r"https?:|//[a-z]|url\(|@import|<script|<link|<img|<iframe| on[a-z]+=", text)
    policy = next(meta for meta in parse_xml(text).iter("meta") if meta.get("http-equiv"))
    assert policy.get("content", "").startswith("default-src 'none'")


def test_every_picture_has_a_description_or_is_hidden_from_screen_readers(allegro_report: Report) -> None:
    root = parse_xml(page_text(allegro_report))
    ids = [element.get("id") for element in root.iter() if element.get("id")]
    assert len(ids) == len(set(ids))
    inner = {id(child) for picture in root.iter("svg") for child in picture.iter("svg") if child is not picture}
    for picture in root.iter("svg"):
        if id(picture) in inner or picture.get("aria-hidden") == "true":
            continue
        assert picture.get("role") == "img"
        for name in (picture.get("aria-labelledby") or "").split():
            assert name in ids


def test_every_link_leads_to_a_section(allegro_report: Report) -> None:
    root = parse_xml(page_text(allegro_report))
    anchors = {section.get("id") for section in root.iter("section")}
    links = {(link.get("href") or "").removeprefix("#") for link in root.iter("a") if link.get("class") != "term"}
    assert links <= anchors
    assert links == {"action", "hand", "certainty", "figures", "terms", "inputs"}


def test_the_page_of_the_full_hand_is_below_the_size_limit(allegro_report: Report) -> None:
    assert len(page_text(allegro_report).encode()) < MAX_BYTES


def test_equal_reports_give_equal_bytes(allegro_report: Report, tmp_path: Path) -> None:
    write_page(allegro_report, tmp_path / "a.html")
    write_page(json.loads(json.dumps(allegro_report)), tmp_path / "b.html")
    assert (tmp_path / "a.html").read_bytes() == (tmp_path / "b.html").read_bytes()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.html", "b.html"]


def test_sections_without_content_are_omitted() -> None:
    page = page_text(make_minimal_report())
    assert list_titles(page) == ["What to do", "Before and after", "Certainty", "Figures", "Terms", "Inputs"]
    anchors = {section.get("id") for section in parse_xml(page).iter("section")}
    assert anchors >= {"where", "effects", "unexplained"}
    assert not anchors & {"waterfall", "ablation", "parts", "thesis", "resimulated"}


def test_empty_optional_fields_are_omitted_like_absent_ones() -> None:
    report = make_minimal_report()
    report |= {"taxels": {}, "sensors": [], "taxel_excess": {}, "counts": {}, "waterfall": [], "ablation": []}
    report |= {"by_object": [], "by_sensor": [], "thesis_terms": [], "next_presses": [], "losses": [], "notes": []}
    assert page_text(report) == page_text(make_minimal_report())


def test_without_a_gap_the_pictures_are_described_as_noise() -> None:
    text = page_text(make_no_gap_report("rig4"))
    assert "The remaining noise" in list_titles(text)
    assert "Location of the noise" in extract_text(text)
    assert "Gap after each effect" not in extract_text(text)
    assert text.count('class="stage"') == 1
    assert "agree within the variance between repeats of the same grasp" in extract_text(text)
    assert "No effect is needed." in extract_text(text)
    steps = [int(match) for match in re.findall(r'class="q(\d+)" x="[\d.]+" y', text)]
    assert np.mean(steps) < 5  # of 12 colour steps: most taxels are pale


def test_a_small_significant_gap_is_not_described_as_noise() -> None:
    report = make_no_gap_report("rig4")
    report["verdict"]["one_line"] = "No gap: 2.9 counts; repeats and sessions alone cause 2.8."
    report["gap"]["significant"] = True
    text = extract_text(page_text(report))
    assert "hardly due to chance" in text
    assert "within the variance" not in text


def test_locations_with_a_negligible_share_are_not_listed(rig4_report: Report) -> None:
    board = rig4_report["sensors"][0]["address"]
    rig4_report["unexplained"] |= {"p_value": 1e-4, "signature": "one board"}
    rig4_report["unexplained"]["where"] = [{"address": board, "share": share} for share in (0.81234, 0.0004)]
    text = extract_text(page_text(rig4_report))
    assert "81 %" in text
    assert ": 0 %" not in text


def test_dead_taxels_are_listed_as_integers(rig4_report: Report) -> None:
    rig4_report["verdict"] |= {"status": "explained", "effects": ["dropout"]}
    for row in rig4_report["effects"]:
        row["in_verdict"] = row["name"] == "dropout"
        if row["in_verdict"]:
            row["parameters"] = {"taxels": {"value": [70, 71, 1072], "ci95": None, "unit": "index"}}
    text = extract_text(page_text(rig4_report))
    assert "70, 71 and 1072" in text
    assert "70.0" not in text


def test_an_unknown_cause_has_a_signature_and_no_effect(rig4_report: Report) -> None:
    rig4_report["verdict"] |= {"status": "unknown", "effects": ["unknown"]}
    for row in rig4_report["effects"]:
        row["in_verdict"] = False
    text = extract_text(page_text(rig4_report))
    assert "No effect of the catalogue is the cause." in text
    assert "in the verdict" not in text
    assert "Signature: row" in text


def test_an_insignificant_remaining_gap_is_not_called_unexplained(rig4_report: Report) -> None:
    rig4_report["unexplained"]["p_value"] = 0.3
    assert "not significantly above the floor (p = 0.30)" in extract_text(page_text(rig4_report))


def test_the_waterfall_starts_with_a_first_entry_named_gap(rig4_report: Report) -> None:
    """A first entry "gap" is the gap without effects, so the page does not show it as an added effect ("+ gap")."""
    rig4_report["waterfall"].insert(0, {"effect": "gap", "gap": 15.25, "ci95": [14.0, 16.0]})
    rows = extract_text(page_text(rig4_report))
    assert "14.0 to 16.0" in rows
    assert "+ gap" not in rows


def test_an_effect_that_increases_the_gap_is_marked(rig4_report: Report) -> None:
    rig4_report["waterfall"][1]["gap"] = 9.0
    text = page_text(rig4_report)
    assert 'class="worse"' in text
    assert "+1.3" in extract_text(text)  # 9.0 counts after the first effect's 7.7


def test_without_intervals_in_the_report_the_figures_have_none(rig4_report: Report) -> None:
    rig4_report["gap"]["ci95"] = rig4_report["after"]["ci95"] = None
    assert "5.20 to 6.70" not in extract_text(page_text(rig4_report))


def test_the_report_is_not_modified(rig4_report: Report) -> None:
    original = copy.deepcopy(rig4_report)
    page_text(rig4_report)
    assert rig4_report == original


def test_long_lists_are_shortened_with_a_count(allegro_report: Report) -> None:
    assert re.search(r"\d+ more: \d+ % in total", extract_text(page_text(allegro_report)))


def test_parameters_of_many_boards_are_folded_behind_their_range(allegro_report: Report) -> None:
    assert "seconds of 17 boards: 0.0100 to 0.0420 s" in extract_text(page_text(allegro_report))


def test_a_failed_write_leaves_no_file(rig4_report: Report, tmp_path: Path) -> None:
    (tmp_path / "folder").mkdir()
    with pytest.raises(OutputError):
        write_page(rig4_report, tmp_path / "folder")
    with pytest.raises(OSError):
        write_page(rig4_report, tmp_path / ("x" * 300))
    assert [path.name for path in tmp_path.iterdir()] == ["folder"]


@pytest.mark.parametrize("make", [make_report, make_no_gap_report])
@pytest.mark.parametrize("hand_name", ["allegro", "rig4", "flat8"])
def test_the_page_of_any_hand_is_well_formed(make: Callable[[str], Report], hand_name: str) -> None:
    parse_xml(page_text(make(hand_name)))
