"""The effects of the verdict in detail, and a table of all candidates."""

from taxel.gap.page.bars import Axis, build_shrink_bar
from taxel.gap.page.cells import Cell, CellContent, Heading, SectionData, TableData, make_table
from taxel.gap.page.effect_cards import build_effect_card, format_parameters
from taxel.gap.page.glossary import IDENTIFIABILITIES
from taxel.gap.page.text import make_readable
from taxel.gap.report.checked_report import CheckedReport
from taxel.gap.report.report_values import ReportValue

_HEADINGS = (
    Heading("Effect"),
    Heading("Identifiability"),
    Heading("Reduction alone", "pic"),
    Heading("Fitted parameters"),
)


def build_effects_section(report: CheckedReport) -> SectionData | None:
    """Return the section with the effects of the verdict and a table of all candidates; None if no effect was tried.
    Raises GapInputError for a missing or malformed field.
    """
    effects = report.effects
    if not effects:
        return None
    order = report.verdict.texts("effects")
    named = [effect for effect in effects if effect.flag("in_verdict")]
    named.sort(key=lambda effect: order.index(effect.text("name")) if effect.text("name") in order else len(order))
    shown = [effect.choice("identifiability", tuple(IDENTIFIABILITIES)) for effect in effects]
    context = {
        "cards": [build_effect_card(report, effect) for effect in named],
        "is_no_gap": report.is_no_gap,
        "candidates": _build_candidate_table(report, effects),
        "identifiabilities": [texts for key, texts in IDENTIFIABILITIES.items() if key in shown],
    }
    return SectionData("effects", "Effects", "effects", context)


def _build_candidate_table(report: CheckedReport, effects: list[ReportValue]) -> TableData:
    """Return the table of all candidate effects, each added alone.

    The bars have no numbers, because the fits use all sessions: the shrink of the bars is in-sample, and must not be
    compared with the shrink of held-out grasps.
    """
    intervals = [effect.optional_interval("shrink_alone_ci95") or (0.0, 0.0) for effect in effects]
    ends = [end for pair in intervals for end in pair]
    axis = Axis.over([1.0, *(effect.optional_number("shrink_alone") for effect in effects), *ends])
    rows = [_build_candidate_row(report, effect, axis) for effect in effects]
    return make_table(_HEADINGS, rows, "All candidate effects", "candidates")


def _build_candidate_row(report: CheckedReport, effect: ReportValue, axis: Axis) -> tuple[CellContent, ...]:
    """Return the row of one candidate effect. axis: axis of the shrinks, common to all rows."""
    in_verdict = effect.flag("in_verdict")
    shrink = effect.optional_number("shrink_alone")
    bounds = effect.optional_interval("shrink_alone_ci95")
    identifiability, _ = IDENTIFIABILITIES[effect.choice("identifiability", tuple(IDENTIFIABILITIES))]
    return (
        Cell(make_readable(effect.text("name")), is_bold=in_verdict, tag="in the verdict" if in_verdict else ""),
        identifiability,
        None if shrink is None else build_shrink_bar(axis, shrink, bounds, in_verdict),
        Cell(effect.optional_text("reason") or format_parameters(report, effect), is_small=True),
    )
