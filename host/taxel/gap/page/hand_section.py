"""The picture before and after: the gap as bars, and the unrolled hand with the colour scale."""

import math
from typing import Any

from taxel.gap.page.bars import Axis, build_waterfall_bar
from taxel.gap.page.cells import Cell, CellContent, Heading, SectionData, TableData, make_table
from taxel.gap.page.colours import STEPS
from taxel.gap.page.hand_drawing import MIN_SHARE, STAGES, UnrolledHand, read_unrolled_hand
from taxel.gap.page.text import SMALL_P, format_counts, format_number, format_shrink, join_words, make_readable
from taxel.gap.report.checked_report import CheckedReport

_TICKS = (0.0, 0.25, 0.5, 0.75, 1.0)


def build_hand_section(report: CheckedReport) -> SectionData:
    """Return the section with the gap as bars and pictures of the hand, before and after the named effects are added.

    The section of a report without excess of taxels contains only the bars. Raises GapInputError for a missing or
    malformed field.
    """
    hand = read_unrolled_hand(report)
    added = [make_readable(name) for name in report.named_effects]
    stages = [] if hand is None else [_build_stage(hand, stage, added) for stage in (STAGES if added else STAGES[:1])]
    title = "Before and after" if added else "The remaining noise" if report.is_no_gap else "The difference"
    context = {
        "bars": _build_bars(report, added),
        "has_floor": bool(report.after.optional_number("floor")),
        "stages": stages,
        "legend": None if hand is None else _build_legend(hand),
    }
    return SectionData("hand", title, "hand", context)


def _build_bars(report: CheckedReport, added: list[str]) -> TableData:
    """Return the table with the gap of held-out grasps as bars: before and, with named effects, after. added: names of
    the effects.
    """
    after = report.after
    before, floor = after.number("before"), after.optional_number("floor") or None
    value = after.optional_number("value")
    axis = Axis.over([before, floor, value])
    rows: list[tuple[CellContent, ...]] = [
        (
            "Gap before" if added else "Gap",
            build_waterfall_bar(axis, 0.0, before, "total", floor),
            format_counts(before),
        )
    ]
    if added and value is not None:
        shrink = after.optional_number("shrink")
        note = f"shrink {format_shrink(shrink)}" if shrink is not None else ""
        bar = build_waterfall_bar(axis, 0.0, value, "mark", floor)
        rows.append((f"with {join_words(added)}", bar, Cell(format_counts(value), note)))
    headings = (Heading("Simulator"), Heading("Gap", "pic"), Heading("", "n"))
    return make_table(headings, rows, "The gap before and after", "bars")


def _build_stage(hand: UnrolledHand, stage: str, added: list[str]) -> dict[str, Any]:
    """Return the template variables of the pictures of a stage. stage: "before" or "after". added: names of the effects
    that are added in "after".
    """
    heading = {"before": "Before", "after": f"With {join_words(added)}"}[stage] if added else "Measured"
    return {"name": stage, "heading": heading, "views": hand.draw(stage)}


def _build_legend(hand: UnrolledHand) -> dict[str, Any]:
    """Return the template variables for the colour scale and the meaning of the marks."""
    width = 100.0 / STEPS
    before, after = hand.marks
    return {
        # 0.05 %: the rectangles overlap a little, so that no gap is visible between them.
        "steps": [{"x": f"{step * width:.3f}%", "width": f"{width + 0.05:.3f}%"} for step in range(STEPS)],
        "ticks": [format_number(share * hand.top, hand.top) for share in _TICKS],
        "has_marked_boards": bool(before.boards),
        "has_marked_lines": bool(before.lines),
        "has_marks_after": bool(after.boards or after.lines),
        "has_missing_data": any(math.isnan(value) for values in hand.excess for value in values),
        "small_p": SMALL_P,
        "min_share": f"{100 * MIN_SHARE:.0f}",
    }
