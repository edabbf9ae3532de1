"""The main figures: gap, floor and shrink, and the sections with their details."""

from taxel.gap.page.cells import Cell, Heading, SectionData, make_table
from taxel.gap.page.text import (
    format_count,
    format_counts,
    format_interval,
    format_p_equation,
    format_shrink,
    format_shrink_interval,
    format_with_unit,
)
from taxel.gap.report.checked_report import CheckedReport
from taxel.gap.report.report_values import Interval

_HEADINGS = (Heading("Figure"), Heading("Value", "n"), Heading("Meaning"))

Row = tuple[str, Cell, Cell]


def build_figures_section(report: CheckedReport) -> SectionData:
    """The section without its details. Raises GapInputError."""
    rows = [*_gap_rows(report), *_test_rows(report), *_mm_rows(report)]
    return SectionData("figures", "Figures", "figures", {"table": make_table(_HEADINGS, rows, "Figures", "figures")})


def _gap_rows(report: CheckedReport) -> list[Row]:
    """Gap before and after, floor and shrink, all of the same held-out grasps."""
    after, effects = report.after, sum(name != "unknown" for name in report.verdict.texts("effects"))
    before, floor = after.optional_number("before"), after.optional_number("floor")
    rows = [_row("Gap before" if effects else "Gap", before, "counts", "RMS difference in held-out grasps")]
    floor_row = _row("Floor", floor, "counts", "part that repeats and sessions alone cause")
    if not _has_floor(report):
        floor_row = ("Floor", Cell("not measured"), Cell("no repeats and one session", is_small=True))
    if not effects:
        return [*rows, floor_row]
    value, predicted = after.optional_number("value"), after.optional_number("predicted_shrink")
    note = f"with {format_count(effects, 'effect')} added, fitted to the other sessions"
    rows += [_row("Gap after", value, "counts", note, after.optional_interval("ci95")), floor_row]
    shrink, bounds = after.optional_number("shrink"), after.optional_interval("shrink_ci95")
    rows.append(
        (
            "Shrink",
            Cell(format_shrink(shrink), format_shrink_interval(bounds)),
            Cell("1 \u2212 after / before", is_small=True),
        )
    )
    if predicted is not None and before is not None:
        note = "fixed before the held-out grasps were evaluated"
        rows.append(_row("Predicted gap after", before * (1.0 - predicted), "counts", note))
    return rows


def _has_floor(report: CheckedReport) -> bool:
    """Whether repeats or sessions determine the floor."""
    return any(part.optional_number("floor") != 0.0 for part in (report.after, report.gap))


def _test_rows(report: CheckedReport) -> list[Row]:
    """Whether a gap exists, from all sessions together."""
    gap = report.gap
    if not _has_floor(report):
        return []
    significance = "the gap is above the floor" if gap.flag("significant") else "the gap is not above the floor"
    p_value = format_p_equation(gap.optional_number("p_value"))
    rows = [("Test of all sessions", Cell(p_value), Cell(significance, is_small=True))]
    if report.is_no_gap and (bound := gap.optional_number("bound")) is not None:
        note = "the part of the gap above the floor is smaller, with a probability of 95 %"
        rows.append(_row("Bound", bound, "counts", note))
    return rows


def _mm_rows(report: CheckedReport) -> list[Row]:
    """Distances of contact clouds in millimetres; none if the report has no such distances."""
    mm = report.gap.optional("mm")
    if mm is None or mm.optional_number("value") is None:
        return []
    floor_note = "between repeats of the same grasp"
    note = "with as many random taxels active: the influence of a denser cloud"
    return [
        _row("Cloud distance", mm.number("value"), "mm", "between contact clouds", mm.optional_interval("ci95")),
        *([_row("its floor", mm.optional_number("floor"), "mm", floor_note)] if _has_floor(report) else []),
        _row("its placebo", mm.optional_number("placebo"), "mm", note),
    ]


def _row(label: str, value: float | None, unit: str, note: str, bounds: Interval | None = None) -> Row:
    """Label, value with its 95 % interval, and meaning of a number."""
    if unit == "counts":
        interval = f"{bounds[0]:.1f} to {bounds[1]:.1f}" if bounds else ""
        return label, Cell(format_counts(value), interval), Cell(note, is_small=True)
    interval = format_interval(bounds, value or 0.0) if bounds else ""
    return label, Cell(format_with_unit(value, unit), interval), Cell(note, is_small=True)
