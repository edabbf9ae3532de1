"""The shrink taken apart: without each effect, by object and by board, and in the thesis's own terms."""

from __future__ import annotations

from taxel.gap.page.bars import Axis, before_after, share_bar
from taxel.gap.page.fields import Value
from taxel.gap.page.report import Report, address_of
from taxel.gap.page.tables import Column, Section, paragraph, table
from taxel.gap.page.text import number, words

_BAR = Column("Gap, held out", "pic")
_COUNTS = Column("Counts", "n")


def ablation_section(report: Report) -> Section | None:
    """The gap when one of the verdict's effects is left out; None if the report does not say. Raises GapInputError."""
    entries = report.root.maybe_list("ablation")
    if not entries:
        return None
    whole = report.after.number("value")
    gaps = [entry.number("gap") for entry in entries]
    axis = Axis.over([whole, *gaps])
    rows = [("all of the verdict's effects", share_bar(axis, whole, False), number(whole, axis.high), "")]
    rows += [
        (
            f"without {words(entry.text('without'))}",
            share_bar(axis, gap, True),
            number(gap, axis.high),
            _more(gap - whole, axis.high),
        )
        for entry, gap in zip(entries, gaps, strict=True)
    ]
    columns = (Column("Effects added"), _BAR, _COUNTS, Column("More", "n"))
    return Section("ablation", "Without each effect", table(columns, rows, "The gap without each effect", "wide"))


def parts_section(report: Report) -> Section | None:
    """Before and after by object and by board; None if the report does not say. Raises GapInputError."""
    root = report.root
    objects = [(words(entry.text("name")), entry) for entry in root.maybe_list("by_object")]
    boards = [(report.board(address_of(entry)), entry) for entry in root.maybe_list("by_sensor")]
    panels = [_parts("Object", objects), _parts("Board", boards)]
    if not any(panels):
        return None
    intro = paragraph(
        'Counts: <span class="glyph">&#9675;</span> before, <span class="glyph">&#9679;</span> after, dashed the floor.'
    )
    body = "\n".join(f'<div class="panel">{panel}</div>' for panel in panels if panel)
    return Section("parts", "By object and by board", f'{intro}<div class="panels">{body}</div>')


def _parts(title: str, entries: list[tuple[str, Value]]) -> str:
    if not entries:
        return ""
    keys = ("before", "after", "floor")
    numbers = [[entry.maybe_number(key) for key in keys] for _, entry in entries]
    axis = Axis.over(value for row in numbers for value in row)
    columns = (Column(title), Column("", "pic"), *(Column(key.capitalize(), "n") for key in keys))
    rows = []
    for (name, _), (before, after, floor) in zip(entries, numbers, strict=True):
        drawn = "" if before is None or after is None else before_after(axis, before, after, floor)
        rows.append((name, drawn, *(number(value, axis.high) for value in (before, after, floor))))
    return table(columns, rows, f"Before and after by {title.lower()}", "parts")


def thesis_section(report: Report) -> Section | None:
    """The decomposition in the thesis's terms; None if the report does not say. Raises GapInputError."""
    entries = report.root.maybe_list("thesis_terms")
    if not entries:
        return None
    gaps = [entry.maybe_number("gap") for entry in entries]
    axis = Axis.over(gaps)
    rows = [
        (
            words(entry.text("step")),
            "" if gap is None else share_bar(axis, gap, True),
            number(gap, axis.high),
            number(entry.maybe_number("mm")),
        )
        for entry, gap in zip(entries, gaps, strict=True)
    ]
    columns = (Column("Step"), Column("Gap", "pic"), _COUNTS, Column("Millimetres", "n"))
    return Section("thesis", "In the thesis's terms", table(columns, rows, "The thesis's decomposition", "wide"))


def _more(difference: float, beside: float) -> str:
    return f"+{number(difference, beside)}" if difference > 0 else number(difference, beside)
