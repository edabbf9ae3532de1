"""The unrolled hand before and after, with the colour scale."""

import math
from typing import Any

from taxel.gap.page.cells import SectionData
from taxel.gap.page.colours import STEPS
from taxel.gap.page.hand_drawing import MIN_SHARE, STAGES, UnrolledHand, read_unrolled_hand
from taxel.gap.page.text import SMALL_P, format_number, format_with_unit, join_words, make_readable
from taxel.gap.report.checked_report import CheckedReport

_TICKS = (0.0, 0.25, 0.5, 0.75, 1.0)


def build_hand_section(report: CheckedReport) -> SectionData | None:
    """The section; None if the report has no excess of taxels. Raises GapInputError."""
    hand = read_unrolled_hand(report)
    if hand is None:
        return None
    added = [make_readable(name) for name in report.verdict.texts("effects") if name != "unknown"]
    values = {stage: report.after.optional_number(key) for stage, key in zip(STAGES, ("before", "value"), strict=True)}
    stages = [
        {
            "name": stage,
            "heading": stage.capitalize(),
            "value": format_with_unit(values[stage], "counts"),
            "note": f", with {join_words(added) or 'nothing'} added" if stage == "after" else "",
            "views": hand.draw(stage),
        }
        for stage in STAGES
    ]
    title = "Unrolled hand: noise" if report.is_no_gap else "Unrolled hand"
    return SectionData("hand", title, "hand", {"stages": stages, "legend": _legend(hand)})


def _legend(hand: UnrolledHand) -> dict[str, Any]:
    """Variables of the template for the colour scale and the meaning of the marks."""
    width = 100.0 / STEPS
    before, after = hand.marks
    return {
        "steps": [{"x": f"{step * width:.3f}%", "width": f"{width + 0.05:.3f}%"} for step in range(STEPS)],
        "ticks": [format_number(share * hand.top, hand.top) for share in _TICKS],
        "has_marked_boards": bool(before.boards),
        "has_marked_lines": bool(before.lines),
        "has_marks_after": bool(after.boards or after.lines),
        "has_missing_data": any(math.isnan(value) for values in hand.excess for value in values),
        "small_p": SMALL_P,
        "min_share": f"{100 * MIN_SHARE:.0f}",
    }
