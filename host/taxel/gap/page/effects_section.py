"""The effects of the verdict in detail, and a table of all candidates."""

from taxel.gap.page.bars import Axis, build_shrink_bar
from taxel.gap.page.cells import Cell, CellContent, Heading, SectionData, TableData, make_table
from taxel.gap.page.effect_cards import build_effect_card, format_parameters
from taxel.gap.page.glossary import IDENTIFIABILITIES
from taxel.gap.page.text import format_number, format_percent, format_percent_interval, make_readable
from taxel.gap.report.checked_report import CheckedReport
from taxel.gap.report.report_values import ReportValue

_HEADINGS = (
    Heading("Effect"),
    Heading("Identifiability"),
    Heading("Shrink alone", "pic"),
    Heading("", "n"),
    Heading("95\N{NO-BREAK SPACE}% interval", "n"),
    Heading("Gap after, counts", "n"),
    Heading("Fitted parameters"),
)
_SHRINKS = ("predicted_shrink", "measured_shrink")


def build_effects_section(report: CheckedReport) -> SectionData | None:
    """The section; None if no effect was tried. Raises GapInputError."""
    effects = report.effects
    if not effects:
        return None
    order = report.verdict.texts("effects")
    named = [effect for effect in effects if effect.flag("in_verdict")]
    named.sort(key=lambda effect: order.index(effect.text("name")) if effect.text("name") in order else len(order))
    shown = [effect.choice("identifiability", tuple(IDENTIFIABILITIES)) for effect in effects]
    context = {
        "axis_of_cards": (axis := _axis_of_cards(named)),
        "cards": [build_effect_card(report, effect, axis) for effect in named],
        "is_no_gap": report.is_no_gap,
        "candidates": _candidate_table(report, effects),
        "identifiabilities": [texts for key, texts in IDENTIFIABILITIES.items() if key in shown],
    }
    return SectionData("effects", "Effects", "effects", context)


def _axis_of_cards(named: list[ReportValue]) -> Axis:
    """The common axis of the shrinks of all cards."""
    shrinks = [effect.optional_number(key) for effect in named for key in _SHRINKS]
    bounds = [effect.optional_interval("measured_shrink_ci95") or (0.0, 0.0) for effect in named]
    return Axis.over([*shrinks, *(end for pair in bounds for end in pair)])


def _candidate_table(report: CheckedReport, effects: list[ReportValue]) -> TableData:
    """Table of all candidate effects, each added alone."""
    intervals = [effect.optional_interval("shrink_alone_ci95") or (0.0, 0.0) for effect in effects]
    ends = [end for pair in intervals for end in pair]
    axis = Axis.over([*(effect.optional_number("shrink_alone") for effect in effects), *ends])
    rows = [_candidate_row(report, effect, axis) for effect in effects]
    return make_table(_HEADINGS, rows, "All candidate effects", "candidates")


def _candidate_row(report: CheckedReport, effect: ReportValue, axis: Axis) -> tuple[CellContent, ...]:
    """The row of one candidate effect. axis: of the shrinks, common to all rows."""
    in_verdict = effect.flag("in_verdict")
    shrink = effect.optional_number("shrink_alone")
    bounds = effect.optional_interval("shrink_alone_ci95")
    identifiability, _ = IDENTIFIABILITIES[effect.choice("identifiability", tuple(IDENTIFIABILITIES))]
    return (
        Cell(make_readable(effect.text("name")), is_bold=in_verdict, tag="in the verdict" if in_verdict else ""),
        identifiability,
        None if shrink is None else build_shrink_bar(axis, shrink, bounds, in_verdict),
        format_percent(shrink),
        format_percent_interval(bounds) if bounds else "",
        format_number(effect.optional_number("gap_after_alone")),
        Cell(effect.optional_text("reason") or format_parameters(report, effect), is_small=True),
    )
