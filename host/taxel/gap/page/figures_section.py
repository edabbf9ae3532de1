"""The main figures: gap, floor and shrink."""

from taxel.gap.page.cells import Cell, Heading, SectionData, make_table
from taxel.gap.page.text import (
    format_count,
    format_interval,
    format_p_equation,
    format_percent,
    format_with_unit,
)
from taxel.gap.report.checked_report import CheckedReport
from taxel.gap.report.report_values import ReportValue

_COUNTS = "counts"
_TERMS = {"Gap": "gap", "Floor": "floor", "Excess": "excess"}
"""Terms of the labels, for links to the section of terms."""

Row = tuple[Cell, Cell]


def build_figures_section(report: CheckedReport) -> SectionData:
    """The section. Raises GapInputError."""
    groups = (
        ("All grasps", _gap_rows(report)),
        ("Held-out grasps", _after_rows(report)),
        ("In millimetres", _mm_rows(report)),
    )
    tables = [
        make_table((Heading(title), Heading("Value", "n")), rows, title, "figures") for title, rows in groups if rows
    ]
    has_interval = report.gap.optional_interval("ci95") is not None
    return SectionData("figures", "Figures", "figures", {"tables": tables, "has_interval": has_interval})


def _gap_rows(report: CheckedReport) -> list[Row]:
    """Rows on the gap over all grasps, in counts."""
    gap = report.gap
    significance = "above the floor" if gap.flag("significant") else "not above the floor"
    excess = f"gap² minus floor²; {format_p_equation(gap.optional_number('p_value'))}, {significance}"
    rows = [
        _row(gap, "value", "Gap", _COUNTS, "RMS difference of the mean features"),
        _row(gap, "floor", "Floor", _COUNTS, "gap caused by repeats and sessions alone"),
        _row(gap, "excess", "Excess", "counts²", excess),
    ]
    if gap.optional_number("bound") is not None:
        note = "with a probability of 95 %, the part of the gap above the floor is smaller"
        rows.append(_row(gap, "bound", "Bound", _COUNTS, note))
    return rows


def _after_rows(report: CheckedReport) -> list[Row]:
    """Rows on the gap of held-out grasps, before and after the effects of the verdict are added."""
    after, effects = report.after, _effect_count(report)
    predicted = after.optional_number("predicted_shrink")
    prediction = (
        "" if predicted is None or not effects else f"; predicted before this evaluation: {format_percent(predicted)}"
    )
    reducible = after.optional_number("reducible_shrink")
    reducible_note = (
        "not stated, because the excess before is not significantly positive"
        if reducible is None
        else "share of the squared gap above the floor"
    )
    added = f"the {format_count(effects, 'effect')} of the verdict" if effects else "nothing"
    return [
        _row(after, "before", "Before", _COUNTS, "gap of the grasps that were not used for the fit"),
        _row(after, "value", "After", _COUNTS, f"with {added} added"),
        _row(after, "floor", "Floor", _COUNTS, "of the same grasps"),
        (
            Cell("Shrink", f"share of the gap{prediction}", term="shrink"),
            Cell(format_percent(after.optional_number("shrink"))),
        ),
        (Cell("Reducible shrink", reducible_note), Cell(format_percent(reducible))),
        *_repeated_search_rows(report),
    ]


def _repeated_search_rows(report: CheckedReport) -> list[Row]:
    """Agreement of the searches that were repeated without each session."""
    searches = report.after.optional_list("chosen_inside")
    if not searches:
        return []
    names = set(report.verdict.texts("effects")) - {"unknown"}
    agreeing = sum({name.as_text() for name in search.items()} == names for search in searches)
    note = "searches without one session that find the same effects"
    return [(Cell("Repeated searches", note), Cell(f"{agreeing} of {len(searches)}"))]


def _effect_count(report: CheckedReport) -> int:
    return sum(name != "unknown" for name in report.verdict.texts("effects"))


def _mm_rows(report: CheckedReport) -> list[Row]:
    """Rows on the gap in millimetres; none if the report has no such gap."""
    mm = report.gap.optional("mm")
    if mm is None or mm.optional_number("value") is None:
        return []
    return [
        _row(mm, "value", "Gap", "mm", "between the clouds of active taxels"),
        _row(mm, "floor", "Floor", "mm", "between repeats of the same grasp"),
        _row(
            mm,
            "placebo",
            "Placebo",
            "mm",
            "with the same number of randomly activated taxels: the effect of a denser cloud",
        ),
    ]


def _row(entry: ReportValue, key: str, label: str, unit: str, note: str) -> Row:
    """Label and value of a number of the report, with its 95 % interval if the key is "value"."""
    content = entry.field(key)
    value = None if content.content is None else content.as_number()
    bounds = entry.optional_interval("ci95") if key == "value" else None
    return Cell(label, note, term=_TERMS.get(label, "")), Cell(
        format_with_unit(value, unit), format_interval(bounds, value or 0.0) if bounds else ""
    )
