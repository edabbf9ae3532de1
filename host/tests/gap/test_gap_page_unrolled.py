"""The unrolled hand of a gap report: positions of the boards, colours of the taxels, marks."""

from __future__ import annotations

import copy
import re
import xml.etree.ElementTree as ET
from itertools import pairwise
from pathlib import Path
from typing import Any

import matplotlib.image
import pytest

from taxel.gap.errors import GapInputError
from taxel.gap.page import unrolled_png, unrolled_svg
from taxel.gap.page.board_map import View, arrange_views, list_boards
from taxel.gap.page.colours import DARK, LIGHT, STEPS, compute_top, select_step
from taxel.gap.report.checked_report import CheckedReport
from taxel.hand import load_hand

Report = dict[str, Any]

SVG = "{http://www.w3.org/2000/svg}"
FLOOR = 2.0
LARGEST = 400.0  # counts squared


def make_report(hand_name: str, boards: list[str] | None = None) -> Report:
    """Return the smallest report with a picture: one taxel of the first board has an excess."""
    taxels: Report = {"sensor": [], "tx": [], "rx": []}
    sensors = []
    for board in load_hand(hand_name).boards:
        if boards is None or board.name in boards:
            sensors.append({"address": board.address, "name": board.name, "kind": board.kind.name})
            taxels["sensor"] += [board.address] * board.kind.taxel_count
            taxels["tx"] += board.kind.tx.tolist()
            taxels["rx"] += board.kind.rx.tolist()
    count = len(taxels["sensor"])
    return {
        "format": "taxel-gap-report",
        "version": 1,
        "gap": {"value": 5.0, "floor": FLOOR},
        "after": {"before": 5.0, "value": 4.0, "floor": FLOOR},
        "where": {"sensors": [], "lines": []},
        "verdict": {"status": "unknown", "one_line": "Something costs $5 and $6."},
        "unexplained": {"p_value": 0.6, "where": []},
        "taxels": taxels,
        "sensors": sensors,
        "taxel_excess": {"before": [LARGEST] + [0.0] * (count - 1), "after": [-1.0] * count},
    }


def make_views(report: Report) -> tuple[View, ...]:
    return arrange_views(list_boards(CheckedReport(report)))


def list_classes(svg: str) -> list[str]:
    """Return the CSS class of each taxel, in the order of the picture."""
    return [r.get("class", "") for r in ET.fromstring(svg).iter(f"{SVG}rect") if r.find(f"{SVG}title") is not None]


def list_texts(svg: str, kind: str) -> list[str]:
    """Return the texts of a picture whose CSS class begins with `kind`, with ordinary spaces."""
    found = [t.text or "" for t in ET.fromstring(svg).iter(f"{SVG}text") if (t.get("class") or "").startswith(kind)]
    return [text.replace("\N{NO-BREAK SPACE}", " ") for text in found]


def has_overlap(view: View) -> bool:
    """Return whether two boards of a picture overlap, including the space of their labels."""
    boxes = [(p.x, p.y - 1.0, p.x + p.board.columns, p.y + p.board.rows) for p in view.boards]
    return any(a is not b and a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3] for a in boxes for b in boxes)


@pytest.mark.parametrize("hand_name", ["original", "original_complete", "allegro", "rig4", "flat8"])
def test_every_taxel_is_drawn_once_and_boards_do_not_overlap(hand_name: str) -> None:
    report = make_report(hand_name)
    assert len(list_classes(unrolled_svg(report))) == len(report["taxels"]["sensor"])
    for view in make_views(report):
        assert not has_overlap(view)
        for placed in view.boards:
            assert 0 <= placed.x <= view.width - placed.board.columns
            assert 0 < placed.y <= view.height - placed.board.rows


def test_boards_with_a_layout_are_drawn_by_it() -> None:
    hand, report = load_hand("original"), make_report("original")
    for board in list_boards(CheckedReport(report)):
        kind = hand.get_board(board.address).kind
        assert (board.row, board.column) == (tuple(kind.row.tolist()), tuple(kind.column.tolist()))
        assert (board.rows, board.columns) == kind.layout_shape
        assert len(set(zip(board.row, board.column, strict=True))) == kind.taxel_count


def test_a_kind_with_other_lines_than_the_packaged_one_is_drawn_by_its_lines() -> None:
    """The palm of the Allegro hand has other lines than the palm of the original hand, whose places are packaged."""
    report = make_report("allegro")
    report["sensors"][0]["kind"] = "palm"
    board = next(board for board in list_boards(CheckedReport(report)) if board.name == "palm")
    assert (board.row, board.column) == (board.tx, board.rx)


@pytest.mark.parametrize(("axis", "index"), [("tx", 0), ("tx", 9), ("rx", 0), ("rx", 11)])
def test_the_arrows_of_a_line_point_at_all_its_rows_or_columns(axis: str, index: int) -> None:
    report = make_report("original", ["palm"])
    address = report["sensors"][0]["address"]
    report["where"]["lines"] = [{"address": address, "axis": axis, "index": index, "share": 1.0, "p_value": 0.001}]
    kind = load_hand("original").get_board(address).kind
    is_on_line = (kind.tx if axis == "tx" else kind.rx) == index
    # Arrows point at the rows or at the columns of the line, whichever are fewer.
    expected = min(len(set(places[is_on_line].tolist())) for places in (kind.row, kind.column))
    assert unrolled_svg(report).count('class="arrow"') == expected


def test_the_default_hand_is_arranged_like_a_right_hand() -> None:
    palm_side, back = make_views(make_report("original"))
    at = {placed.board.name: placed for view in (palm_side, back) for placed in view.boards}
    assert len(palm_side.boards) + len(back.boards) == 17
    assert at["fingertip_pinkie"].x < at["fingertip_middle"].x < at["fingertip_index"].x
    assert at["proximal_back_index"].x < at["proximal_back_middle"].x < at["proximal_back_pinkie"].x
    for finger in ("index", "middle", "pinkie"):
        heights = [at[f"{part}_{finger}"].y for part in ("fingertip", "medial_front", "proximal_front")]
        assert heights == sorted(heights)
        assert heights[-1] < at["palm"].y
    assert [heading.label for heading in palm_side.headings] == ["pinkie", "middle", "index"]


def test_the_allegro_hand_is_arranged_like_a_right_hand() -> None:
    palm_side, back = make_views(make_report("allegro"))
    at = {placed.board.name: placed for view in (palm_side, back) for placed in view.boards}
    assert len(palm_side.boards) + len(back.boards) == 17
    # Seen from the palm, the thumb is on the right; seen from behind, the index finger is on the left.
    assert at["fingertip_pinkie"].x < at["fingertip_middle"].x < at["fingertip_index"].x
    assert at["palm"].x < at["fingertip_thumb"].x
    assert at["proximal_back_index"].x < at["proximal_back_middle"].x < at["proximal_back_pinkie"].x
    for finger in ("index", "middle"):
        heights = [at[f"{part}_{finger}"].y for part in ("fingertip", "medial_front", "proximal_front")]
        assert heights == sorted(heights)
        assert heights[-1] < at["palm"].y
    assert at["proximal_back_middle"].y < at["back_of_hand"].y
    assert [heading.label for heading in palm_side.headings] == ["pinkie", "middle", "index"]


def test_boards_of_the_palm_side_alone_are_drawn_as_palm_side_without_overlap() -> None:
    (view,) = make_views(make_report("original", ["palm", "fingertip_index"]))
    assert view.title == "palm side"
    assert not has_overlap(view)


def test_an_unknown_board_name_arranges_all_boards_in_rows() -> None:
    report = make_report("original")
    report["sensors"][0]["name"] = "forearm"
    (view,) = make_views(report)
    assert len(view.boards) == 17
    assert len({placed.y for placed in view.boards}) > 1


def test_boards_without_a_name_are_labelled_by_their_address() -> None:
    report = make_report("rig4") | {"sensors": []}
    assert list_texts(unrolled_svg(report), "name") == ["board 0x50", "board 0x51", "board 0x52", "board 0x53"]


def test_a_long_name_is_shortened_and_escaped() -> None:
    report = make_report("rig4")
    report["sensors"][0]["name"] = "<b>" + "x" * 100
    name = list_texts(unrolled_svg(report), "name")[0]
    assert name.startswith("<b>xx")
    assert len(name) <= 18


def test_the_colour_is_linear_in_the_root_of_the_excess_on_a_common_scale() -> None:
    """A quarter of the largest excess has half of the largest root, so it gets the middle colour. The pictures before
    and after have one scale.
    """
    report = make_report("rig4")
    report["taxel_excess"]["before"][1] = LARGEST / 4
    before, after = list_classes(unrolled_svg(report, "before")), list_classes(unrolled_svg(report, "after"))
    assert before[:3] == [f"q{STEPS - 1}", f"q{STEPS // 2}", "q0"]
    assert set(after) == {"q0"}
    report["taxel_excess"]["after"][2] = 4 * LARGEST
    assert list_classes(unrolled_svg(report, "before"))[0] == f"q{STEPS // 2}"


def test_the_colour_scale_ends_at_three_floors_if_all_taxels_are_below() -> None:
    before, after = [1.0, 0.0], [0.5, 0.0]  # excess of two taxels without and with the effects, counts^2
    top = compute_top((before, after), FLOOR)
    assert top == 3 * FLOOR
    assert select_step(1.0, top) <= 2  # small deviations get one of the first three colours


def test_the_end_of_the_colour_scale_is_positive_without_any_excess() -> None:
    assert compute_top(([-1.0], [-2.0]), 0.0) > 0.0


def test_a_taxel_without_data_is_empty() -> None:
    report = make_report("rig4")
    report["taxel_excess"]["before"][3] = None
    assert list_classes(unrolled_svg(report))[3] == "none"


def test_boards_and_lines_with_a_small_p_are_marked_before() -> None:
    """The marks are in the picture before the effects are added, not in the picture with the effects."""
    report = make_report("rig4")
    address = report["sensors"][1]["address"]
    report["where"]["sensors"] = [
        {"address": address, "name": "wall", "share": 0.62, "p_value": 0.01},
        {"address": report["sensors"][0]["address"], "name": "slab", "share": 0.38, "p_value": 0.2},
    ]
    report["where"]["lines"] = [
        {"address": address, "axis": "tx", "index": 2, "share": 0.6, "p_value": 0.001},
        {"address": address, "axis": "rx", "index": 2, "share": 0.1, "p_value": 0.5},
    ]
    svg = unrolled_svg(report, "before")
    assert list_texts(svg, "name marked") == ["wall 62 %"]
    assert svg.count('class="arrow"') == 1
    assert "marked" not in re.sub("<style>.*</style>", "", unrolled_svg(report, "after"), flags=re.DOTALL)


def test_unexplained_locations_are_marked_after() -> None:
    """The marks are in the picture with the effects, and only if the unexplained remainder is significant."""
    report = make_report("rig4")
    address = report["sensors"][2]["address"]
    locations = [{"address": address, "axis": "rx", "index": 1}, {"address": address}, "somewhere"]
    report["unexplained"] = {"p_value": 0.001, "where": locations}
    svg = unrolled_svg(report, "after")
    assert list_texts(svg, "name marked") == ["dome"]
    assert svg.count('class="arrow"') == 1
    assert 'class="arrow"' not in unrolled_svg(report, "before")
    report["unexplained"]["p_value"] = 0.3
    assert 'class="arrow"' not in unrolled_svg(report, "after")


def test_a_line_that_the_board_lacks_is_not_marked() -> None:
    report = make_report("rig4")
    line = {"address": report["sensors"][0]["address"], "axis": "tx", "index": 200, "share": 1.0, "p_value": 0.001}
    report["where"]["lines"] = [line]
    assert 'class="arrow"' not in unrolled_svg(report)


def compute_luminance(colour: str) -> float:
    """Return the relative luminance of a colour #rrggbb (WCAG 2.2)."""
    channels = [int(colour[k : k + 2], 16) / 255 for k in (1, 3, 5)]
    red, green, blue = (c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in channels)
    return 0.2126 * red + 0.7152 * green + 0.0722 * blue


def test_the_lightness_of_the_ramps_is_monotonic() -> None:
    assert all(compute_luminance(a) > compute_luminance(b) for a, b in pairwise(LIGHT))
    assert all(compute_luminance(a) < compute_luminance(b) for a, b in pairwise(DARK))
    assert len(LIGHT) == len(DARK) == STEPS


def test_the_svg_has_no_external_references() -> None:
    svg = unrolled_svg(make_report("original"))
    assert not re.search(r"url\(|@import|href|<script", svg)
    assert re.findall(r"https?://[^\"]*", svg) == ["http://www.w3.org/2000/svg"]
    assert ET.fromstring(svg).find(f"{SVG}title") is not None


def test_an_unknown_stage_is_rejected() -> None:
    with pytest.raises(ValueError, match="expected one of before, after, found 'later'"):
        unrolled_svg(make_report("rig4"), "later")


@pytest.mark.parametrize("key", ["taxels", "taxel_excess"])
def test_a_report_without_taxels_has_no_picture(key: str, tmp_path: Path) -> None:
    report = make_report("rig4")
    del report[key]
    with pytest.raises(GapInputError, match="taxel_excess: expected taxels and the excess of each, found none"):
        unrolled_svg(report)
    with pytest.raises(GapInputError):
        unrolled_png(report, tmp_path / "hand.png")
    assert not list(tmp_path.iterdir())


def test_the_png_is_reproducible_and_contains_the_colours_of_the_hand(tmp_path: Path) -> None:
    report = make_report("rig4")
    report["sensors"][0]["name"] = "$x_{"  # must not be parsed as a formula
    unrolled_png(report, tmp_path / "a.png")
    unrolled_png(copy.deepcopy(report), tmp_path / "b.png")
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()
    picture = matplotlib.image.imread(tmp_path / "a.png")
    assert picture.shape[1] > 600
    colours = {tuple(round(255 * float(c)) for c in pixel[:3]) for pixel in picture.reshape(-1, picture.shape[2])[::7]}
    for colour in (LIGHT[0], LIGHT[-1]):
        assert tuple(int(colour[k : k + 2], 16) for k in (1, 3, 5)) in colours


def test_the_png_of_a_report_without_named_effects_shows_the_hand_once(tmp_path: Path) -> None:
    """Nothing is added to the simulator, so a second picture would equal the first one."""
    report = make_report("original")
    unrolled_png(report, tmp_path / "one.png")
    report["verdict"] |= {"status": "explained", "effects": ["noise"]}
    unrolled_png(report, tmp_path / "both.png")
    both, one = (matplotlib.image.imread(tmp_path / name).shape[1] for name in ("both.png", "one.png"))
    assert one < 0.6 * both
