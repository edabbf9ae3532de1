"""Measured gaps of the simulations with the most probable sets of effects."""

from taxel.gap.page.bars import Axis, build_before_after_bar
from taxel.gap.page.cells import Heading, SectionData, make_table
from taxel.gap.page.text import format_number, format_percent, format_percent_interval, make_readable
from taxel.gap.report.checked_report import CheckedReport

_HEADINGS = (
    Heading("Effects in the simulator"),
    Heading("Measured gap", "pic"),
    Heading("Counts", "n"),
    Heading("Shrink", "n"),
    Heading("95 % interval", "n"),
)


def build_resimulated_section(report: CheckedReport) -> SectionData | None:
    """Return the section with the measured gaps of simulations with effects; None if no such simulation was made.
    Raises GapInputError for a missing or malformed field.
    """
    entries = report.root.optional_list("resimulated")
    if not entries:
        return None
    axis = Axis.over([value for entry in entries for value in (entry.number("before"), entry.number("after"))])
    rows = []
    for entry in entries:
        before, after, bounds = entry.number("before"), entry.number("after"), entry.optional_interval("shrink_ci95")
        names = ", ".join(make_readable(name) for name in entry.texts("effects"))
        bar = build_before_after_bar(axis, before, after, entry.number("floor"))
        interval = format_percent_interval(bounds)
        rows.append((names, bar, format_number(after, before), format_percent(entry.number("shrink")), interval))
    table = make_table(_HEADINGS, rows, "Measured gaps of simulations with effects", "wide")
    return SectionData("resimulated", "Simulated again with the effects", "table", {"table": table})
