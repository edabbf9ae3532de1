"""Shares of the excess by board, line, taxel, phase, object and approach."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from taxel.gap.page.bars import Axis, build_share_bar
from taxel.gap.page.cells import Cell, Heading, SectionData, make_table
from taxel.gap.page.locations import format_board_address, format_line, format_taxel, read_axis, read_line
from taxel.gap.page.text import SMALL_P, format_p_value, format_percent, is_small, make_readable
from taxel.gap.report.checked_report import CheckedReport, get_address
from taxel.gap.report.report_values import ReportValue

_MAX_INDEX = 2**20


@dataclass(frozen=True)
class Panel:
    """A list of shares of the excess. name: function that returns the text of an entry. max_rows: number of entries
    that are shown.
    """

    title: str
    entries: list[ReportValue]
    name: Callable[[ReportValue], str]
    max_rows: int


def build_location_section(report: CheckedReport) -> SectionData | None:
    """Return the section with the shares of the excess by location; None if the report has no shares. Raises
    GapInputError for a missing or malformed field.
    """
    panels = [_build_panel(panel) for panel in _list_panels(report) if panel.entries]
    if not panels:
        return None
    title = "Location of the noise" if report.is_no_gap else "Location of the gap"
    context = {"panels": panels, "is_no_gap": report.is_no_gap, "small_p": SMALL_P}
    return SectionData("where", title, "locations", context)


def _list_panels(report: CheckedReport) -> list[Panel]:
    """Return all lists of shares: boards, phases, lines, objects, approaches and taxels; also those without entries.

    The last argument of each `Panel` is the largest number of rows that are shown.
    """
    where = report.where
    lines = where.optional_list("lines")
    by_axis = [(axis, [entry for entry in lines if read_axis(entry) == axis]) for axis in ("tx", "rx")]
    return [
        Panel(
            "Boards", where.optional_list("sensors"), lambda entry: format_board_address(report, get_address(entry)), 17
        ),
        Panel("Phases", where.optional_list("phases"), lambda entry: make_readable(entry.text("phase")), 10),
        *(
            Panel(f"{axis.upper()} lines", entries, lambda entry: format_line(report, read_line(entry)), 8)
            for axis, entries in by_axis
        ),
        Panel("Objects", where.optional_list("objects"), lambda entry: make_readable(entry.text("name")), 10),
        Panel("Approaches", where.optional_list("approaches"), _format_condition, 15),
        Panel("Taxels", where.optional_list("taxels"), lambda entry: format_taxel(report, _read_index(entry)), 8),
    ]


def _format_condition(entry: ReportValue) -> str:
    return f"{make_readable(entry.text('object'))}, {make_readable(entry.text('approach'))}"


def _read_index(entry: ReportValue) -> int:
    return entry.field("index").as_integer(0, _MAX_INDEX)


def _build_panel(panel: Panel) -> dict[str, Any]:
    """Return the template variables of a list: the table of the largest shares, and number and sum of the shares that
    are not shown.
    """
    shares = [entry.number("share") for entry in panel.entries]
    p_values = [entry.optional_number("p_value") for entry in panel.entries]
    axis = Axis.over(shares)
    rows = [
        (
            panel.name(entry),
            build_share_bar(axis, share, is_small(p)),
            format_percent(share),
            Cell(format_p_value(p), has_dot=is_small(p)),
        )
        for entry, share, p in list(zip(panel.entries, shares, p_values, strict=True))[: panel.max_rows]
    ]
    headings = (Heading(panel.title), Heading("Share", "pic"), Heading("", "n"), Heading("p", "n"))
    hidden = shares[panel.max_rows :]
    return {
        "table": make_table(headings, rows, f"Shares by {panel.title.lower()}", "shares"),
        "hidden_count": len(hidden),
        "hidden_significant": sum(is_small(p) for p in p_values[panel.max_rows :]),
        "hidden_share": format_percent(sum(hidden)),
    }
