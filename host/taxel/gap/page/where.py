"""Where the excess lies: shares by board, line, taxel, phase, object and approach."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from taxel.gap.page.bars import Axis, share_bar
from taxel.gap.page.fields import Value
from taxel.gap.page.places import axis_of, line_of, line_words, taxel_words
from taxel.gap.page.report import Report, address_of
from taxel.gap.page.tables import Column, Section, paragraph, table
from taxel.gap.page.text import SMALL_P, is_small, p_value, percent, words

_MAX_INDEX = 2**20


@dataclass(frozen=True)
class Panel:
    """A list of shares: its title, its entries, their names in words (HTML), and how many are shown."""

    title: str
    entries: list[Value]
    name: Callable[[Value], str]
    most: int


def where_section(report: Report) -> Section | None:
    """The section; None if the report gives no share. Raises GapInputError."""
    panels = [panel for panel in _panels(report) if panel.entries]
    if not panels:
        return None
    body = "\n".join(_panel_html(panel) for panel in panels)
    if report.no_gap:
        title, first = "Where the noise falls", "There is no gap to place; these are shares of what noise leaves."
    else:
        title, first = "Where", "Shares of the excess; within each list they add to 100&#160;%."
    intro = paragraph(
        f"{first} A full bar and <small>&#9679;</small> mark p&#160;&lt;&#160;{SMALL_P}, corrected for the search; "
        "pale bars may be chance. A share below zero is less than the floor."
    )
    return Section("where", title, f'{intro}\n<div class="panels">\n{body}\n</div>')


def _panels(report: Report) -> list[Panel]:
    where = report.where
    lines = where.maybe_list("lines")
    axes = [(axis, [entry for entry in lines if axis_of(entry) == axis]) for axis in ("tx", "rx")]
    return [
        Panel("Boards", where.maybe_list("sensors"), lambda entry: report.board(address_of(entry)), 17),
        Panel("Phases", where.maybe_list("phases"), lambda entry: words(entry.text("phase")), 10),
        *(
            Panel(f"{axis.upper()} lines", entries, lambda entry: line_words(report, line_of(entry)), 8)
            for axis, entries in axes
        ),
        Panel("Objects", where.maybe_list("objects"), lambda entry: words(entry.text("name")), 10),
        Panel("Approaches", where.maybe_list("approaches"), _approach, 15),
        Panel("Taxels", where.maybe_list("taxels"), lambda entry: taxel_words(report, _index(entry)), 8),
    ]


def _approach(entry: Value) -> str:
    return f"{words(entry.text('object'))}, {words(entry.text('approach'))}"


def _index(entry: Value) -> int:
    return entry.field("index").as_integer(0, _MAX_INDEX)


def _panel_html(panel: Panel) -> str:
    shares = [entry.number("share") for entry in panel.entries]
    p_values = [entry.maybe_number("p_value") for entry in panel.entries]
    axis = Axis.over(shares)
    rows = [
        (panel.name(entry), share_bar(axis, share, is_small(p)), percent(share), _marked(p))
        for entry, share, p in list(zip(panel.entries, shares, p_values, strict=True))[: panel.most]
    ]
    columns = (Column(panel.title), Column("Share", "pic"), Column("", "n"), Column("p", "n"))
    rest = shares[panel.most :]
    more = ""
    if rest:
        marked = sum(is_small(p) for p in p_values[panel.most :])
        of_them = f", {marked} of them with p&#160;&lt;&#160;{SMALL_P}" if marked else ""
        more = paragraph(f"{len(rest):,} more{of_them}: {percent(sum(rest))} together", "muted more")
    return f'<div class="panel">{table(columns, rows, f"Shares by {panel.title.lower()}", "shares")}{more}</div>'


def _marked(value: float | None) -> str:
    return f'{p_value(value)}<span class="flag">{"&#9679;" if is_small(value) else ""}</span>'
