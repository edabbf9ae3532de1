"""The gap after each added effect, down to the floor."""

from taxel.gap.page.bars import Axis, build_waterfall_bar
from taxel.gap.page.cells import Cell, CellContent, Heading, SectionData, make_table
from taxel.gap.page.text import MINUS, format_interval, format_number, make_readable
from taxel.gap.report.checked_report import CheckedReport
from taxel.gap.report.report_values import Interval

_HEADINGS = (
    Heading("Step"),
    Heading("Gap of held-out grasps", "pic"),
    Heading("Counts", "n"),
    Heading("Change", "n"),
)
_START_NAMES = ("gap", "before")  # names of a first entry that contains the gap without effects


def build_waterfall_section(report: CheckedReport) -> SectionData | None:
    """Return the section with the gap after each added effect. Raises GapInputError for a missing or malformed field.

    None for fewer than two effects, because the gaps before and after are then all steps.
    """
    steps = report.root.optional_list("waterfall")
    if sum(step.text("effect") not in _START_NAMES for step in steps) < 2:
        return None
    floor = report.after.optional_number("floor")
    gap, bounds = report.after.number("before"), None
    bounds_after = report.after.optional_interval("ci95")
    if steps[0].text("effect") in _START_NAMES:
        gap, bounds = steps[0].number("gap"), steps[0].optional_interval("ci95")
        steps = steps[1:]
    axis = Axis.over([gap, floor, *(step.number("gap") for step in steps)])
    first = gap
    rows: list[tuple[CellContent, ...]] = [
        ("Before", build_waterfall_bar(axis, 0.0, gap, "total", floor), _make_counts_cell(gap, bounds, first), "")
    ]
    for step in steps:
        after = step.number("gap")
        kind = "mark" if after <= gap else "worse"
        bar = build_waterfall_bar(axis, gap, after, kind, floor)
        counts = _make_counts_cell(after, step.optional_interval("ci95"), first)
        rows.append((f"+ {make_readable(step.text('effect'))}", bar, counts, _format_change(after - gap, first)))
        gap = after
    bar = build_waterfall_bar(axis, 0.0, gap, "total", floor)
    rows.append(
        (Cell("Remaining gap", is_bold=True), bar, _make_counts_cell(gap, bounds_after, first, is_bold=True), "")
    )
    if floor is not None:
        rows.append(
            ("Floor", build_waterfall_bar(axis, 0.0, floor, "ground", floor), Cell(format_number(floor, first)), "")
        )
    table = make_table(_HEADINGS, rows, "The gap after each effect", "waterfall")
    return SectionData("waterfall", "Gap after each effect", "waterfall", {"table": table})


def _make_counts_cell(gap: float, bounds: Interval | None, first: float, is_bold: bool = False) -> Cell:
    return Cell(format_number(gap, first), format_interval(bounds, first) if bounds else "", is_bold=is_bold)


def _format_change(difference: float, first: float) -> str:
    text = format_number(difference, first)
    return text if text.startswith(MINUS) or difference == 0 else f"+{text}"
