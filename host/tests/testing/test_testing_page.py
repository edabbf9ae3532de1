"""HTML page of a test record: content, folding, and safety against hostile text."""

import dataclasses
import math
import re
import xml.etree.ElementTree as ET

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from taxel_tools.testing.errors import ResultFileError
from taxel_tools.testing.history import History
from taxel_tools.testing.page import render_page, write_page
from taxel_tools.testing.page.bars import build_axis, render_value_bar
from taxel_tools.testing.page.figures import format_duration, format_figure, format_time
from taxel_tools.testing.record import Attachment, Finding, Limit, Measurement, Outcome, PhaseRecord, TestRecord


def parse_page(page):
    """Parse the page as XML, because the page is also well-formed XML."""
    return ET.fromstring(page.removeprefix("<!DOCTYPE html>\n"))


def read_text(element):
    return " ".join("".join(element.itertext()).replace("\u00a0", " ").split())


def find_section(page, title):
    return next(node for node in parse_page(page).iter("section") if read_text(node.find("h2")).startswith(title))


def test_the_header_shows_the_verdict_the_problems_and_the_skipped_phases(full_record):
    header = parse_page(render_page(full_record)).find("body/header")
    assert read_text(header.find("h1")) == "AB-0001 could not be tested completely: 2 faults found"
    items = [read_text(node) for node in header.find("ol")]
    assert items[0] == "open TX line TX 5 check the trace"
    assert items[1] == "noisy TX line TX 3 lift the solder joint J1.4"
    assert items[2] == "Bus ended with an error: /dev/bus: Input/output error"
    assert "Touch: cannot run: no operator at the bench" in read_text(header)


def test_a_passed_board_has_no_problem_list(make_record):
    page = render_page(make_record(lambda log: log.measure("white", 4.0, "counts")))
    assert "AB-0001 passed" in read_text(parse_page(page).find("body/header/h1"))
    assert "What to do" not in page


def test_a_single_fault_is_in_the_title(make_record):
    record = make_record(lambda log: log.add_finding("open TX line", "TX 3", "fix it", 2.0))
    assert read_text(parse_page(render_page(record)).find("head/title")) == "AB-0001 failed: open TX line at TX 3"


def test_a_violated_limit_without_a_finding_is_listed_with_its_worst_place(make_record):
    def measure(log):
        for line, value in enumerate([9.0, 24.0, 12.0]):
            log.measure("white", value, "counts", f"TX {line}")

    header = read_text(parse_page(render_page(make_record(measure))).find("body/header"))
    assert "Noise, white: 3 places beyond the limit, the worst 24 counts at TX 1 (allowed ≤ 8)" in header


def test_a_long_problem_list_is_folded(make_record):
    def measure(log):
        for line in range(30):
            log.add_finding("open TX line", f"TX {line}", "fix it", float(line))

    header = parse_page(render_page(make_record(measure))).find("body/header")
    assert len(header.find("ol")) == 10
    assert read_text(header.find("details/summary")) == "20 more"
    assert len(header.find("details/ol")) == 20


def test_the_header_contains_the_identity(full_record):
    entries = {
        read_text(node.find("dt")): read_text(node.find("dd"))
        for node in parse_page(render_page(full_record)).find("body/header/dl")
    }
    assert entries["serial number"] == "AB-0001"
    assert entries["operator"] == "Zoë"
    assert entries["address"] == "0x21"
    assert entries["tested"].endswith("UTC")


def test_each_value_is_shown_with_its_limit(full_record):
    rows = [
        [read_text(entry) for entry in row] for row in find_section(render_page(full_record), "Noise").find(".//tbody")
    ]
    assert rows[0] == ["white", "TX 3", "9.50 counts", "≤ 8", "", "fail"]
    assert rows[2] == ["white", "TX 5", "NaN", "≤ 8", "", "fail"]
    assert rows[3] == ["white", "TX 6", "no value", "≤ 8", "", "fail"]


def test_empty_columns_are_omitted(full_record):
    headings = [read_text(node) for node in find_section(render_page(full_record), "Identity").find(".//thead/tr")]
    assert headings == ["measurement", "value"]


def test_many_measurements_are_folded_except_the_failing_ones(make_record):
    def measure(log):
        for taxel in range(300):
            log.measure("white", 9.0 if taxel in (7, 80) else 4.0 + taxel / 1000, "counts", f"taxel {taxel}")

    page = render_page(make_record(measure))
    noise = find_section(page, "Noise")
    summary, failing = (table for table in noise.findall("div/table"))
    # Name, number of values, failed values, minimum, median, maximum and limit.
    assert [read_text(entry) for entry in summary.find("tbody/tr")][:7] == [
        "white, counts", "300", "2", "4", "4.15", "9", "≤ 8",
    ]  # fmt: skip
    assert [read_text(row[1]) for row in failing.find("tbody")] == ["taxel 7", "taxel 80"]
    assert read_text(noise.find("details/summary")) == "All 300 measurements"
    assert len(noise.find("details//tbody")) == 300
    assert len(page) < 300_000


def test_pictures_and_files_are_embedded_in_the_page(full_record):
    noise = find_section(render_page(full_record), "Noise")
    assert noise.find(".//img").get("src").startswith("data:image/png;base64,iVBOR")
    assert noise.find(".//img").get("alt") == "White noise"
    link = noise.find(".//a[@download]")
    assert link.get("download") == "raw.bin"
    assert link.get("href").startswith("data:application/octet-stream;base64,")


@pytest.mark.parametrize("media_type", ["text/html", "image/jpeg", 'image/png" onload="x', "IMAGE/SVG+XML"])
def test_only_known_picture_types_are_shown(make_record, media_type):
    record = make_record(lambda log: log.attach("x", media_type, b"<script>alert(1)</script>"))
    page = render_page(record)
    assert "<img" not in page
    assert "data:application/octet-stream;base64," in page
    assert media_type not in page


def test_a_script_in_a_picture_is_not_part_of_the_page(make_record):
    record = make_record(lambda log: log.attach("x.svg", "image/svg+xml", b"<svg><script>alert(1)</script></svg>"))
    assert "<script" not in render_page(record)
    assert find_section(render_page(record), "Noise").find(".//img") is not None


def test_a_traceback_is_shown_on_the_page(make_plan, phase, run):
    def measure(context, options, log):
        raise ValueError("<no index>")

    page = render_page(run(make_plan("[phases.a]\n"), [phase("a", measure)]))
    pre = find_section(page, "A").find(".//pre")
    assert pre.text.startswith("Traceback (most recent call last):\n  File")
    assert "ValueError: <no index>" in pre.text


def test_the_content_security_policy_permits_only_embedded_style_and_pictures(full_record):
    page = render_page(full_record)
    policy = parse_page(page).find("head/meta[@http-equiv='Content-Security-Policy']").get("content")
    assert policy == "default-src 'none'; style-src 'unsafe-inline'; img-src data:"
    assert not re.search(r"""(?:src|href)="(?!data:|#)""", page)
    assert "url(" not in page
    assert "@import" not in page


@settings(deadline=None, max_examples=50)
@given(
    text=st.text(st.characters(exclude_categories=()), min_size=1, max_size=20)
    | st.sampled_from(["<script>", '"><img src=x onerror=x>', "]]>"])
)
def test_no_text_of_a_record_becomes_markup(text):
    limit = Limit(None, 1.0)
    phase = PhaseRecord(
        name=text,
        title=text,
        outcome=Outcome.ERROR,
        automatic=False,
        seconds=1.0,
        measurements=[
            Measurement(text, 2.0, text, limit, text, Outcome.FAIL),
            Measurement(text, text, text, None, text, Outcome.PASS),
        ],
        findings=[Finding(text, text, text, 1.0)],
        attachments=[
            Attachment(text, "image/png", b"x", text),
            Attachment(text, text, b"x", text),
            Attachment(text, "text/plain", text.encode("utf-8", "replace"), text),
        ],
        notes=[text],
        problem=text,
    )
    record = TestRecord(text, text, text, text, text, text, {text: text}, text, text, Outcome.ERROR, [phase], 1.0)
    page = render_page(record)
    assert "<script" not in page
    allowed_tags = {
        "html",
        "head",
        "meta",
        "title",
        "style",
        "body",
        "header",
        "main",
        "section",
        "h1",
        "h2",
        "h4",
        "p",
        "b",
    }
    allowed_tags |= {
        "ul",
        "ol",
        "li",
        "a",
        "span",
        "dl",
        "div",
        "dt",
        "dd",
        "code",
        "table",
        "caption",
        "thead",
        "tbody",
        "tr",
    }
    allowed_tags |= {
        "th",
        "td",
        "svg",
        "rect",
        "line",
        "circle",
        "path",
        "figure",
        "img",
        "figcaption",
        "details",
        "summary",
        "pre",
    }
    assert {node.tag for node in parse_page(page).iter()} <= allowed_tags
    assert not any(name.startswith("on") for node in parse_page(page).iter() for name in node.attrib)


def test_earlier_tests_and_moved_values_are_shown(make_record, tmp_path):
    with History(tmp_path / "h.sqlite") as history:
        for white in (4.0, 4.1):
            history.add(make_record(lambda log, white=white: log.measure("white", white, "counts", "TX 3")))
        record = make_record(lambda log: log.measure("white", 7.5, "counts", "TX 3"))
        page = render_page(record, history.compare(record), history.list_earlier("AB-0001"))
    earlier = find_section(page, "Earlier tests")
    changes, runs = earlier.findall("div/table")
    # Name, place, value, last value, median and number of earlier tests, remark.
    assert [read_text(entry) for entry in changes.find("tbody/tr")] == [
        "white Noise", "TX 3", "7.50 counts", "4.10", "4.05", "2", "moved",
    ]  # fmt: skip
    assert len(runs.find("tbody")) == 2


def test_moved_values_are_sorted_by_shift(make_record, tmp_path):
    """With one earlier value, 4.0, and the limit 8, values have moved from 5.0 on: those of TX 0 and TX 2."""

    def make_values_record(*values):
        def measure(log):
            for line, value in enumerate(values):
                log.measure("white", value, "counts", f"TX {line}")

        return make_record(measure)

    with History(tmp_path / "h.sqlite") as history:
        history.add(make_values_record(4.0, 4.0, 4.0))
        page = render_page(make_values_record(5.5, 4.1, 7.5), history.compare(make_values_record(5.5, 4.1, 7.5)))
    rows = find_section(page, "Earlier tests").find("div/table/tbody")
    assert [read_text(row[1]) for row in rows] == ["TX 2", "TX 0"]


def test_without_a_history_the_section_is_missing(full_record):
    assert "Earlier tests" not in render_page(full_record)


def test_a_test_without_phases_has_a_page(make_plan, run, phase):
    page = render_page(run(make_plan("[phases.a]\nenabled = false\n"), [phase("a")], serial_number=""))
    assert "A device without serial number was not tested" in read_text(parse_page(page).find("body/header/h1"))
    assert "The plan has no phase for this kind of device." in page


def test_equal_records_give_equal_pages(full_record):
    assert render_page(full_record) == render_page(dataclasses.replace(full_record))


def test_an_existing_page_is_overwritten_only_on_request(full_record, tmp_path):
    write_page(full_record, tmp_path / "r.html")
    with pytest.raises(ResultFileError, match="an existing one"):
        write_page(full_record, tmp_path / "r.html")
    write_page(full_record, tmp_path / "r.html", overwrite=True)
    assert (tmp_path / "r.html").read_text(encoding="utf-8") == render_page(full_record)


@pytest.mark.parametrize(
    ("value", "limit", "text"),
    [
        (8.0004, Limit(None, 8.0), "8.0004"),
        (7.9996, Limit(None, 8.0), "8.00"),
        (7.9996, Limit(8.0, None), "7.9996"),
        (0.0153, None, "0.0153"),
        (3.0, None, "3"),
        (-1234.5, None, "−1,234"),
        (1e12, None, "1e+12"),
        (1.5e-9, Limit(None, 1e-9), "1.5e−09"),
        (math.nextafter(8.0, 9.0), Limit(None, 8.0), "8.000000000000002"),
        (math.inf, Limit(None, 8.0), "infinite"),
        (math.nan, Limit(None, 8.0), "NaN"),
        (None, None, "no value"),
        ("<b>", None, "&lt;b&gt;"),
    ],
)
def test_the_digits_of_a_value_show_on_which_side_of_the_limit_it_lies(value, limit, text):
    assert format_figure(value, limit) == text


@settings(deadline=None)
@given(
    low=st.none() | st.floats(-1e6, 1e6),
    high=st.none() | st.floats(-1e6, 1e6),
    values=st.lists(st.floats() | st.none(), min_size=1, max_size=4),
)
def test_the_axis_of_a_bar_contains_the_bounds_for_any_values(low, high, values):
    limit = Limit(low, high) if None in (low, high) else Limit(min(low, high), max(low, high))
    axis = build_axis(limit, values)
    assert axis.low < axis.high
    for bound in (limit.minimum, limit.maximum):
        assert bound is None or axis.low <= bound <= axis.high
    for value in values:
        ET.fromstring(render_value_bar(axis, limit, value, Outcome.PASS))


def test_a_value_far_outside_is_shown_as_an_arrow():
    limit = Limit(250.0, 420.0)
    axis = build_axis(limit, [300.0, 1e6])
    assert axis.high < 1000.0
    for value, is_within_axis in ((300.0, True), (1e6, False), (-math.inf, False)):
        bar = render_value_bar(axis, limit, value, Outcome.FAIL)
        assert ("<circle" in bar, "<path" in bar) == (is_within_axis, not is_within_axis)


def test_times_and_durations_are_formatted():
    assert format_time("2026-01-31T09:30:00.125Z") == "2026-01-31 09:30:00\u00a0UTC"
    assert format_time("<soon>") == "&lt;soon&gt;"
    assert [format_duration(seconds) for seconds in (4.25, 200.0, math.nan)] == [
        "4.2\u00a0s",
        "3\u00a0min 20\u00a0s",
        "–",
    ]
