"""Gaps in detail: without each effect, by object and by board, and after each processing step of the thesis."""

from taxel.gap.page.bars import Axis, build_before_after_bar, build_share_bar
from taxel.gap.page.cells import Heading, SectionData, TableData, make_table
from taxel.gap.page.locations import format_board_address
from taxel.gap.page.text import format_number, make_readable
from taxel.gap.report.checked_report import CheckedReport, get_address
from taxel.gap.report.report_values import ReportValue

_GAP = Heading("Gap of held-out grasps", "pic")
_COUNTS = Heading("Counts", "n")


def build_ablation_section(report: CheckedReport) -> SectionData | None:
    """Return the section with the gap without each effect of the verdict; None if the report has no such gaps. Raises
    GapInputError for a missing or malformed field.
    """
    entries = report.root.optional_list("ablation")
    if not entries:
        return None
    complete = report.after.number("value")
    gaps = [entry.number("gap") for entry in entries]
    axis = Axis.over([complete, *gaps])
    rows = [
        ("all effects of the verdict", build_share_bar(axis, complete, False), format_number(complete, axis.high), "")
    ]
    rows += [
        (
            f"without {make_readable(entry.text('without'))}",
            build_share_bar(axis, gap, True),
            format_number(gap, axis.high),
            _format_increase(gap - complete, axis.high),
        )
        for entry, gap in zip(entries, gaps, strict=True)
    ]
    headings = (Heading("Added effects"), _GAP, _COUNTS, Heading("Increase", "n"))
    table = make_table(headings, rows, "The gap without each effect", "wide")
    return SectionData("ablation", "Without each effect", "table", {"table": table})


def build_parts_section(report: CheckedReport) -> SectionData | None:
    """Return the section with the gap before and after by object and by board; None if the report has neither. Raises
    GapInputError for a missing or malformed field.
    """
    root = report.root
    objects = [(make_readable(entry.text("name")), entry) for entry in root.optional_list("by_object")]
    boards = [(format_board_address(report, get_address(entry)), entry) for entry in root.optional_list("by_sensor")]
    tables = [
        table
        for table in (_build_before_after_table("Object", objects), _build_before_after_table("Board", boards))
        if table
    ]
    return SectionData("parts", "By object and by board", "parts", {"tables": tables}) if tables else None


def _build_before_after_table(title: str, entries: list[tuple[str, ReportValue]]) -> TableData | None:
    """Return the table of gap before, gap after and floor for objects or boards; None without entries.

    title: "Object" or "Board". entries: name and report entry of each row.
    """
    if not entries:
        return None
    keys = ("before", "after", "floor")
    numbers = [[entry.optional_number(key) for key in keys] for _, entry in entries]
    axis = Axis.over(value for row in numbers for value in row)
    headings = (Heading(title), Heading("", "pic"), *(Heading(key.capitalize(), "n") for key in keys))
    rows = []
    for (name, _), (before, after, floor) in zip(entries, numbers, strict=True):
        bar = None if before is None or after is None else build_before_after_bar(axis, before, after, floor)
        rows.append((name, bar, *(format_number(value, axis.high) for value in (before, after, floor))))
    return make_table(headings, rows, f"Before and after by {title.lower()}", "parts")


def build_thesis_section(report: CheckedReport) -> SectionData | None:
    """Return the section with the gap after each processing step of the thesis; None if the report has none. Raises
    GapInputError for a missing or malformed field.
    """
    entries = report.root.optional_list("thesis_terms")
    if not entries:
        return None
    gaps = [entry.optional_number("gap") for entry in entries]
    axis = Axis.over(gaps)
    rows = [
        (
            make_readable(entry.text("step")),
            None if gap is None else build_share_bar(axis, gap, True),
            format_number(gap, axis.high),
            format_number(entry.optional_number("mm")),
        )
        for entry, gap in zip(entries, gaps, strict=True)
    ]
    headings = (Heading("Step"), Heading("Mean difference", "pic"), _COUNTS, Heading("Millimetres", "n"))
    table = make_table(headings, rows, "Mean difference after the processing steps of the thesis", "wide")
    return SectionData("thesis", "Processing steps of the thesis", "table", {"table": table})


def _format_increase(difference: float, compared_with: float) -> str:
    """Return a difference as text, with a plus sign if it is positive. compared_with: number that determines the
    decimals.
    """
    text = format_number(difference, compared_with)
    return f"+{text}" if difference > 0 else text
