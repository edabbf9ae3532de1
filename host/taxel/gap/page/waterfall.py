"""How the gap shrinks effect by effect, down to the floor."""

from __future__ import annotations

from taxel.gap.page.bars import Axis, waterfall_bar
from taxel.gap.page.fields import Interval
from taxel.gap.page.report import Report
from taxel.gap.page.tables import Column, Section, paragraph, table
from taxel.gap.page.text import MINUS, interval, number, percent, words

_COLUMNS = (
    Column("Step"),
    Column("Gap, held out", "pic"),
    Column("Counts", "n"),
    Column("Change", "n"),
)
_STARTS = ("gap", "before")  # names that a first entry may give to the gap before anything is added


def waterfall_section(report: Report) -> Section | None:
    """The section; None if nothing was added. Raises GapInputError."""
    steps = report.root.maybe_list("waterfall")
    if not steps:
        return None
    floor = report.after.maybe_number("floor")
    gap, bounds = report.after.number("before"), None
    left = report.after.maybe_interval("ci95")
    if steps[0].text("effect") in _STARTS:
        gap, bounds = steps[0].number("gap"), steps[0].maybe_interval("ci95")
        steps = steps[1:]
    axis = Axis.over([gap, floor, *(step.number("gap") for step in steps)])
    whole = gap
    rows = [("Before", waterfall_bar(axis, 0.0, gap, "total", floor), _counts(gap, bounds, whole), "")]
    for step in steps:
        after = step.number("gap")
        kind = "mark" if after <= gap else "worse"
        text = f"+ {words(step.text('effect'))}"
        counts = _counts(after, step.maybe_interval("ci95"), whole)
        rows.append((text, waterfall_bar(axis, gap, after, kind, floor), counts, _change(after - gap, whole)))
        gap = after
    rows.append(
        (
            "<b>What is left</b>",
            waterfall_bar(axis, 0.0, gap, "total", floor),
            f"<b>{_counts(gap, left, whole)}</b>",
            "",
        )
    )
    if floor is not None:
        rows.append(("Floor", waterfall_bar(axis, 0.0, floor, "ground", floor), number(floor, whole), ""))
    intro = paragraph(
        "Each effect is added to those above it, on the grasps that no fit has seen. The dashed line is the floor, "
        "which no model can pass. Below a gap stands its 95&#160;% interval."
    )
    return Section(
        "waterfall", "From gap to floor", intro + table(_COLUMNS, rows, "The gap, step by step", "waterfall")
    )


def _counts(gap: float, bounds: Interval | None, whole: float) -> str:
    below = f'<span class="says">{interval(bounds, whole)}</span>' if bounds else ""
    return f"{number(gap, whole)}{below}"


def _change(difference: float, whole: float) -> str:
    text = percent(difference / whole) if whole > 0 else number(difference)
    return text if text.startswith(MINUS) or difference == 0 else f"+{text}"
