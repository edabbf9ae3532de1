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
    """Return the section of the main figures, without the sections of their details. Raises GapInputError for a missing
    or malformed field.
    """
    rows = [*_list_gap_rows(report), *_list_significance_rows(report), *_list_cloud_rows(report)]
    return SectionData("figures", "Figures", "figures", {"table": make_table(_HEADINGS, rows, "Figures", "figures")})


def _list_gap_rows(report: CheckedReport) -> list[Row]:
    """Return the table rows with gap before, gap after, floor, shrink and predicted gap, all of the same held-out
    grasps.

    Without a named effect there are only the gap and the floor (the gap that repeats and sessions alone cause).
    """
    after, effects = report.after, len(report.named_effects)
    before, floor = after.optional_number("before"), after.optional_number("floor")
    rows = [_make_row("Gap before" if effects else "Gap", before, "counts", "RMS difference in held-out grasps")]
    floor_row = _make_row("Floor", floor, "counts", "part that repeats and sessions alone cause")
    if not _has_floor(report):
        floor_row = ("Floor", Cell("not measured"), Cell("no repeats and one session", is_small=True))
    if not effects:
        return [*rows, floor_row]
    value, predicted = after.optional_number("value"), after.optional_number("predicted_shrink")
    note = f"with {format_count(effects, 'effect')} added, fitted to the other sessions"
    rows += [_make_row("Gap after", value, "counts", note, after.optional_interval("ci95")), floor_row]
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
        rows.append(_make_row("Predicted gap after", before * (1.0 - predicted), "counts", note))
    return rows


def _has_floor(report: CheckedReport) -> bool:
    """Return whether repeats or sessions determine the floor, the gap that they alone cause."""
    return any(part.optional_number("floor") != 0.0 for part in (report.after, report.gap))


def _list_significance_rows(report: CheckedReport) -> list[Row]:
    """Return the table rows of the significance test that compares the gap with the floor, over all sessions together.

    The floor is the gap that repeats and sessions alone cause; without a floor there is no test, and the list is empty.
    If the verdict is "no gap", a second row states the upper bound of the gap above the floor.
    """
    gap = report.gap
    if not _has_floor(report):
        return []
    significance = "the gap is above the floor" if gap.flag("significant") else "the gap is not above the floor"
    p_value = format_p_equation(gap.optional_number("p_value"))
    rows = [("Test of all sessions", Cell(p_value), Cell(significance, is_small=True))]
    if report.is_no_gap and (bound := gap.optional_number("bound")) is not None:
        note = "the part of the gap above the floor is smaller, with a probability of 95 %"
        rows.append(_make_row("Bound", bound, "counts", note))
    return rows


def _list_cloud_rows(report: CheckedReport) -> list[Row]:
    """Return the table rows with the distance of the contact clouds in millimetres, its floor and its placebo; empty if
    the report has no such distance.
    """
    mm = report.gap.optional("mm")
    if mm is None or mm.optional_number("value") is None:
        return []
    floor_note = "between repeats of the same grasp"
    note = "with as many random taxels active: the influence of a denser cloud"
    return [
        _make_row("Cloud distance", mm.number("value"), "mm", "between contact clouds", mm.optional_interval("ci95")),
        *([_make_row("its floor", mm.optional_number("floor"), "mm", floor_note)] if _has_floor(report) else []),
        _make_row("its placebo", mm.optional_number("placebo"), "mm", note),
    ]


def _make_row(label: str, value: float | None, unit: str, note: str, bounds: Interval | None = None) -> Row:
    """Return the table row of a number: label, value with its 95 % interval, and meaning. bounds: the interval; None
    omits it.
    """
    if unit == "counts":
        interval = f"{bounds[0]:.1f} to {bounds[1]:.1f}" if bounds else ""
        return label, Cell(format_counts(value), interval), Cell(note, is_small=True)
    interval = format_interval(bounds, value or 0.0) if bounds else ""
    return label, Cell(format_with_unit(value, unit), interval), Cell(note, is_small=True)
