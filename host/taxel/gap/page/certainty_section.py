"""The certainty of the verdict: probabilities of causes, reasons for doubt, decisive conditions, faulty grasps."""

from typing import Any

from taxel.gap.calibration.calibration import LISTED
from taxel.gap.page.bars import Axis, build_share_bar
from taxel.gap.page.cells import Cell, CellContent, Heading, SectionData, make_table
from taxel.gap.page.glossary import DESCRIPTIONS
from taxel.gap.page.text import clean_text, format_percent, make_readable
from taxel.gap.report.checked_report import CheckedReport

MIN_SHOWN = 0.05
"""Probability below which a cause shares one line with the others."""

NO_GAP_DESCRIPTION = "No cause is present that alone produces a gap of half the floor."

_HEADINGS = (Heading("Cause"), Heading("Probability", "pic"), Heading("", "n"))


def build_certainty_section(report: CheckedReport) -> SectionData | None:
    """The section; None for a report of version 1, which has no probabilities. Raises GapInputError."""
    table = report.verdict.optional("probabilities")
    if table is None:
        return None
    values = sorted(((name, value.as_number()) for name, value in table.entries()), key=lambda pair: -pair[1])
    axis = Axis.over([1.0])
    rows: list[tuple[CellContent, ...]] = [
        (
            Cell(_label(name), _describe(name), is_bold=value >= LISTED),
            build_share_bar(axis, value, value >= LISTED),
            format_percent(value),
        )
        for name, value in values
        if value >= MIN_SHOWN
    ]
    small = [_label(name) for name, value in values if value < MIN_SHOWN]
    context: dict[str, Any] = {
        "table": make_table(_HEADINGS, rows, "Probabilities of the causes", "wide"),
        "small": ", ".join(small),
        "min_shown": format_percent(MIN_SHOWN),
        "reasons": [clean_text(text) for text in report.verdict.texts("reasons")],
        "influence": _describe_influence(report),
        "problems": [
            f"{clean_text(one.text('grasp'))}: {clean_text(one.text('problem'))} ({clean_text(one.text('handled'))})"
            for one in report.root.field("inputs").optional_list("problems")
        ],
    }
    return SectionData("certainty", "Certainty", "certainty", context)


def _label(name: str) -> str:
    return "unknown cause" if name == "unknown" else make_readable(name)


def _describe(name: str) -> str:
    return NO_GAP_DESCRIPTION if name == "no_gap" else "" if name == "unknown" else DESCRIPTIONS.get(name, "")


def _describe_influence(report: CheckedReport) -> list[str]:
    """For each named effect the conditions with the largest shares of its evidence."""
    shares: dict[str, list[str]] = {}
    for entry in report.root.optional_list("influence"):
        place = f"{clean_text(entry.text('object'))} {clean_text(entry.text('approach'))}"
        text = f"{make_readable(place)} ({format_percent(entry.number('share'))})"
        shares.setdefault(entry.text("effect"), []).append(text)
    return [f"{make_readable(name)}: {', '.join(texts)}" for name, texts in shares.items()]
