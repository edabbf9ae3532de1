"""Open questions: the unexplained part, and recommended measurements."""

from typing import Any

from taxel.gap.page.bars import Axis, build_share_bar
from taxel.gap.page.cells import Cell, Heading, SectionData, TableData, make_table
from taxel.gap.page.locations import format_location
from taxel.gap.page.text import (
    SMALL_P,
    clean_text,
    format_number,
    format_p_equation,
    format_p_value,
    format_percent,
    is_small,
    join_words,
    make_readable,
)
from taxel.gap.report.checked_report import CheckedReport
from taxel.gap.report.report_values import ReportValue

_MAX_LOCATIONS = 12
_MIN_SHOWN_SHARE = 0.01
_BANK_HEADINGS = (
    Heading("Distortion"),
    Heading("Share of the unexplained part", "pic"),
    Heading("", "n"),
    Heading("p", "n"),
)
_MEANINGS = {
    "amplitude": "the signal is a nonlinear function of the predicted signal",
    "lag": "the signal is earlier or later",
    "history": "release and recovery depend on the preceding load",
    "radial": "the contact area is wider or narrower",
    "shift": "the contact area is displaced",
    "common": "all taxels change together, with or without contact",
    "board": "boards: factor and offset, or a different signal",
    "row": "TX lines: a different signal, or the signal of another line",
    "column": "RX lines: a different signal, or the signal of another line",
    "taxel": "taxels: factor and offset, or a different signal",
    "noise": "variation between frames",
    "missing": "frames are missing",
    "wander": "unloaded taxels drift after the release",
    "session": "the sensitivity differs between sessions",
    "presses": "the sensitivity differs between repeats",
}
_SCOPES = {
    "board": "for each board",
    "row": "for each TX line",
    "column": "for each RX line",
    "taxel": "for each taxel",
}
_RECOMMENDATION_HEADINGS = (
    Heading("Measurement"),
    Heading("Separates or narrows"),
    Heading("Information, bits", "pic"),
    Heading("", "n"),
)


def build_unexplained_section(report: CheckedReport) -> SectionData:
    """Return the section on the part of the gap that the effects of the verdict do not explain.

    The report describes this part in three ways. `signature`: sentence that names the most similar generic distortion
    of the signals, such as a delay. `where`: locations. `bank`: result of each generic distortion that was compared
    with this part; shown only if this part is significant (p-value below `SMALL_P`). Raises GapInputError for a missing
    or malformed field.
    """
    unexplained = report.root.field("unexplained")
    p = unexplained.optional_number("p_value")
    locations = [_format_share_location(report, item) for item in unexplained.optional_list("where") if _is_shown(item)]
    hidden = len(locations) - _MAX_LOCATIONS
    context = {
        "signature": clean_text(unexplained.optional_text("signature")),
        "p_value": format_p_equation(p),
        "is_significant": is_small(p),
        "locations": locations[:_MAX_LOCATIONS] + ([f"{hidden} more locations"] if hidden > 0 else []),
        "bank": _build_bank(unexplained.optional_list("bank")) if is_small(p) else None,
        "small_p": SMALL_P,
    }
    return SectionData("unexplained", "Unexplained part", "unexplained", context)


def _read_share(location: ReportValue) -> float | None:
    return location.optional_number("share") if isinstance(location.content, dict) else None


def _is_shown(location: ReportValue) -> bool:
    share = _read_share(location)
    return share is None or share >= _MIN_SHOWN_SHARE


def _format_share_location(report: CheckedReport, location: ReportValue) -> str:
    share = _read_share(location)
    return format_location(report, location) + ("" if share is None else f": {format_percent(share)}")


def _build_bank(entries: list[ReportValue]) -> dict[str, Any] | None:
    """Return the template variables of the generic distortions: a table, and the names of distortions with a small
    share; None if none was tried.
    """
    if not entries:
        return None
    shares = [entry.number("share") for entry in entries]
    p_values = [entry.optional_number("p_value") for entry in entries]
    axis = Axis.over([1.0, *shares])
    rows = [
        (
            _describe_distortion(entry),
            build_share_bar(axis, share, is_small(p)),
            format_percent(share),
            format_p_value(p),
        )
        for entry, share, p in zip(entries, shares, p_values, strict=True)
        if share >= _MIN_SHOWN_SHARE
    ]
    small = [
        make_readable(entry.text("name"))
        for entry, share in zip(entries, shares, strict=True)
        if share < _MIN_SHOWN_SHARE
    ]
    return {
        "table": make_table(_BANK_HEADINGS, rows, "Generic distortions", "wide") if rows else None,
        "small": join_words(small),
    }


def _describe_distortion(entry: ReportValue) -> Cell:
    """Return a table cell with the name and the meaning of a generic distortion."""
    name, scope = entry.text("name"), entry.optional_text("scope")
    meaning = _MEANINGS.get(name, "")
    if scope != name and meaning:
        meaning = ", ".join(part for part in (meaning, _SCOPES.get(scope, "")) if part)
    return Cell(make_readable(name), meaning)


def build_recommendation_table(report: CheckedReport) -> TableData | None:
    """Return the table of recommended measurements; None if the report has none. Raises GapInputError for a missing or
    malformed field.
    """
    measurements = report.root.optional_list("next_presses")
    if not measurements:
        return None
    gains = [measurement.optional_number("gain") for measurement in measurements]
    axis = Axis.over(gains)
    rows = [
        (
            clean_text(measurement.text("press")),
            join_words([make_readable(name) for name in measurement.texts("separates")]),
            None if gain is None else build_share_bar(axis, gain, True),
            format_number(gain, 1.0),
        )
        for measurement, gain in zip(measurements, gains, strict=True)
    ]
    caption = "Measurements with the largest expected information first"
    return make_table(_RECOMMENDATION_HEADINGS, rows, caption, "recommendations")
