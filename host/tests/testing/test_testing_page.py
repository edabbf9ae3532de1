"""The page: what it shows first, what it folds, and that nothing in a record can harm who reads it."""

from __future__ import annotations

import dataclasses
import math
import re
import xml.etree.ElementTree as ET

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from taxel_tools.testing.errors import ResultFileError
from taxel_tools.testing.history import History
from taxel_tools.testing.page import page_text, write_page
from taxel_tools.testing.page.bars import axis_of, value_bar
from taxel_tools.testing.page.figures import figure, seconds_words, time_words
from taxel_tools.testing.record import Attachment, Finding, Limit, Measurement, Outcome, PhaseRecord, TestRecord


def tree(page):
    """The page as XML, which it is too."""
    return ET.fromstring(page.removeprefix("<!DOCTYPE html>\n"))


def words(element):
    return " ".join("".join(element.itertext()).replace("\u00a0", " ").split())


def section(page, title):
    return next(one for one in tree(page).iter("section") if words(one.find("h2")).startswith(title))


def test_the_verdict_and_what_to_do_come_first(full_record):
    header = tree(page_text(full_record)).find("body/header")
    assert words(header.find("h1")) == "AB-0001 could not be tested to the end: 2 faults found"
    items = [words(one) for one in header.find("ol")]
    assert items[0] == "open TX line TX 5 check the trace"
    assert items[1] == "noisy TX line TX 3 lift the solder joint J1.4"
    assert items[2] == "Bus ended with an error: /dev/bus: Input/output error"
    assert "Touch: cannot run here: nobody is at the bench" in words(header)


def test_a_passed_board_has_nothing_to_do(record_of):
    page = page_text(record_of(lambda log: log.measure("white", 4.0, "counts")))
    assert "AB-0001 passed" in words(tree(page).find("body/header/h1"))
    assert "What to do" not in page


def test_the_one_fault_is_in_the_title(record_of):
    record = record_of(lambda log: log.finding("open TX line", "TX 3", "mend it", 2.0))
    assert words(tree(page_text(record)).find("head/title")) == "AB-0001 failed: open TX line at TX 3"


def test_a_limit_that_no_finding_explains_is_told_by_its_worst_place(record_of):
    def does(log):
        for place, value in enumerate([9.0, 24.0, 12.0]):
            log.measure("white", value, "counts", f"TX {place}")

    header = words(tree(page_text(record_of(does))).find("body/header"))
    assert "Noise, white: 3 places beyond the limit, the worst 24 counts at TX 1 (allowed ≤ 8)" in header


def test_many_things_to_do_are_folded(record_of):
    def does(log):
        for place in range(30):
            log.finding("open TX line", f"TX {place}", "mend it", float(place))

    header = tree(page_text(record_of(does))).find("body/header")
    assert len(header.find("ol")) == 10
    assert words(header.find("details/summary")) == "20 more"
    assert len(header.find("details/ol")) == 20


def test_the_identity_is_told(full_record):
    listed = {
        words(one.find("dt")): words(one.find("dd")) for one in tree(page_text(full_record)).find("body/header/dl")
    }
    assert listed["serial number"] == "AB-0001"
    assert listed["operator"] == "Zoë"
    assert listed["address"] == "0x21"
    assert listed["tested"].endswith("UTC")


def test_values_stand_beside_their_limits(full_record):
    rows = [[words(cell) for cell in row] for row in section(page_text(full_record), "Noise").find(".//tbody")]
    assert rows[0] == ["white", "TX 3", "9.50 counts", "≤ 8", "", "fail"]
    assert rows[2] == ["white", "TX 5", "NaN", "≤ 8", "", "fail"]
    assert rows[3] == ["white", "TX 6", "no value", "≤ 8", "", "fail"]


def test_columns_that_would_be_empty_are_left_out(full_record):
    heads = [words(one) for one in section(page_text(full_record), "Identity").find(".//thead/tr")]
    assert heads == ["measurement", "value"]


def test_many_measurements_are_folded_and_the_failing_ones_shown(record_of):
    def does(log):
        for place in range(300):
            log.measure("white", 9.0 if place in (7, 80) else 4.0 + place / 1000, "counts", f"taxel {place}")

    page = page_text(record_of(does))
    noise = section(page, "Noise")
    summary, failing = (table for table in noise.findall("div/table"))
    assert [words(cell) for cell in summary.find("tbody/tr")][:7] == [
        "white, counts", "300", "2", "4", "4.15", "9", "≤ 8",
    ]  # fmt: skip
    assert [words(row[1]) for row in failing.find("tbody")] == ["taxel 7", "taxel 80"]
    assert words(noise.find("details/summary")) == "All 300 measurements"
    assert len(noise.find("details//tbody")) == 300
    assert len(page) < 300_000


def test_pictures_are_inside_the_page_and_files_can_be_saved(full_record):
    noise = section(page_text(full_record), "Noise")
    assert noise.find(".//img").get("src").startswith("data:image/png;base64,iVBOR")
    assert noise.find(".//img").get("alt") == "White noise"
    link = noise.find(".//a[@download]")
    assert link.get("download") == "raw.bin"
    assert link.get("href").startswith("data:application/octet-stream;base64,")


@pytest.mark.parametrize("media_type", ["text/html", "image/jpeg", 'image/png" onload="x', "IMAGE/SVG+XML"])
def test_only_known_pictures_are_shown(record_of, media_type):
    record = record_of(lambda log: log.attach("x", media_type, b"<script>alert(1)</script>"))
    page = page_text(record)
    assert "<img" not in page
    assert "data:application/octet-stream;base64," in page
    assert media_type not in page


def test_a_picture_that_holds_a_script_is_only_a_picture(record_of):
    record = record_of(lambda log: log.attach("x.svg", "image/svg+xml", b"<svg><script>alert(1)</script></svg>"))
    assert "<script" not in page_text(record)
    assert section(page_text(record), "Noise").find(".//img") is not None


def test_a_traceback_can_be_read_on_the_page(plan_of, phase, run):
    def does(context, options, log):
        raise ValueError("<no index>")

    page = page_text(run(plan_of("[phases.a]\n"), [phase("a", does)]))
    pre = section(page, "A").find(".//pre")
    assert pre.text.startswith("Traceback (most recent call last):\n  File")
    assert "ValueError: <no index>" in pre.text


def test_the_policy_forbids_everything_but_its_own_style_and_pictures(full_record):
    page = page_text(full_record)
    policy = tree(page).find("head/meta[@http-equiv='Content-Security-Policy']").get("content")
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
    page = page_text(record)
    assert "<script" not in page
    allowed = {
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
    allowed |= {
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
    allowed |= {
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
    assert {one.tag for one in tree(page).iter()} <= allowed
    assert not any(name.startswith("on") for one in tree(page).iter() for name in one.attrib)


def test_earlier_tests_and_what_moved_are_shown(record_of, tmp_path):
    with History(tmp_path / "h.sqlite") as history:
        for white in (4.0, 4.1):
            history.add(record_of(lambda log, white=white: log.measure("white", white, "counts", "TX 3")))
        record = record_of(lambda log: log.measure("white", 7.5, "counts", "TX 3"))
        page = page_text(record, history.compare(record), history.earlier("AB-0001"))
    earlier = section(page, "Earlier tests")
    changes, runs = earlier.findall("div/table")
    assert [words(cell) for cell in changes.find("tbody/tr")] == [
        "white Noise", "TX 3", "7.50 counts", "4.10", "4.05", "2", "moved",
    ]  # fmt: skip
    assert len(runs.find("tbody")) == 2


def test_what_moved_most_comes_first(record_of, tmp_path):
    def test_of(*values):
        def does(log):
            for place, value in enumerate(values):
                log.measure("white", value, "counts", f"TX {place}")

        return record_of(does)

    with History(tmp_path / "h.sqlite") as history:
        history.add(test_of(4.0, 4.0, 4.0))
        page = page_text(test_of(5.5, 4.1, 7.5), history.compare(test_of(5.5, 4.1, 7.5)))
    moved = section(page, "Earlier tests").find("div/table/tbody")
    assert [words(row[1]) for row in moved] == ["TX 2", "TX 0"]


def test_without_a_history_there_is_no_such_section(full_record):
    assert "Earlier tests" not in page_text(full_record)


def test_a_test_without_phases_still_has_a_page(plan_of, run, phase):
    page = page_text(run(plan_of("[phases.a]\nenabled = false\n"), [phase("a")], serial_number=""))
    assert "A device without serial number was not tested" in words(tree(page).find("body/header/h1"))
    assert "The plan has no phase for this kind of device." in page


def test_the_same_record_gives_the_same_page(full_record):
    assert page_text(full_record) == page_text(dataclasses.replace(full_record))


def test_a_page_that_is_there_is_kept(full_record, tmp_path):
    write_page(full_record, tmp_path / "r.html")
    with pytest.raises(ResultFileError, match="an existing one"):
        write_page(full_record, tmp_path / "r.html")
    write_page(full_record, tmp_path / "r.html", overwrite=True)
    assert (tmp_path / "r.html").read_text(encoding="utf-8") == page_text(full_record)


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
def test_a_value_shows_on_which_side_of_its_limit_it_is(value, limit, text):
    assert figure(value, limit) == text


@settings(deadline=None)
@given(
    low=st.none() | st.floats(-1e6, 1e6),
    high=st.none() | st.floats(-1e6, 1e6),
    values=st.lists(st.floats() | st.none(), min_size=1, max_size=4),
)
def test_a_bar_shows_its_bounds_whatever_the_values(low, high, values):
    limit = Limit(low, high) if None in (low, high) else Limit(min(low, high), max(low, high))
    axis = axis_of(limit, values)
    assert axis.low < axis.high
    for bound in (limit.minimum, limit.maximum):
        assert bound is None or axis.low <= bound <= axis.high
    for value in values:
        ET.fromstring(value_bar(axis, limit, value, Outcome.PASS))


def test_a_value_far_outside_is_an_arrow_at_the_end():
    limit = Limit(250.0, 420.0)
    axis = axis_of(limit, [300.0, 1e6])
    assert axis.high < 1000.0
    for value, inside in ((300.0, True), (1e6, False), (-math.inf, False)):
        bar = value_bar(axis, limit, value, Outcome.FAIL)
        assert ("<circle" in bar, "<path" in bar) == (inside, not inside)


def test_times_and_durations_read_as_people_say_them():
    assert time_words("2026-01-31T09:30:00.125Z") == "2026-01-31 09:30:00\u00a0UTC"
    assert time_words("<soon>") == "&lt;soon&gt;"
    assert [seconds_words(one) for one in (4.25, 200.0, math.nan)] == ["4.2\u00a0s", "3\u00a0min 20\u00a0s", "–"]
