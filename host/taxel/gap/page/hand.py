"""The unrolled hand before and after, side by side, with its scale."""

from __future__ import annotations

import math

from taxel.gap.page.colours import STEPS
from taxel.gap.page.report import Report
from taxel.gap.page.tables import Section, paragraph
from taxel.gap.page.text import SMALL_P, listed, number, with_unit, words
from taxel.gap.page.unrolled import LEAST_SHARE, Unrolled, unrolled_of, view_svg

_TICKS = (0.0, 0.25, 0.5, 0.75, 1.0)


def hand_section(report: Report) -> Section | None:
    """The section; None if the report says nothing of taxels. Raises GapInputError."""
    unrolled = unrolled_of(report)
    if unrolled is None:
        return None
    added = [words(name) for name in report.verdict.texts("effects") if name != "unknown"]
    captions = {
        "before": f"<b>Before</b> {with_unit(report.after.maybe_number('before'), 'counts')}",
        "after": f"<b>After</b> {with_unit(report.after.maybe_number('value'), 'counts')}, "
        f"with {listed(added) or 'nothing'} added",
    }
    stages = "\n".join(_stage(unrolled, stage, caption) for stage, caption in captions.items())
    intro = paragraph(
        "Each square is a taxel, each block a board as its matrix of TX lines (rows) and RX lines (columns), seen from "
        "outside with the distal end on top. The colour is the root of the taxel's excess: what differs between hand "
        "and simulator beyond the floor."
    )
    title = "The hand unrolled" if not report.no_gap else "The hand unrolled: noise"
    return Section("hand", title, f'{intro}{_legend(unrolled)}\n<div class="stages">\n{stages}\n</div>')


def _stage(unrolled: Unrolled, stage: str, caption: str) -> str:
    views = "\n".join(view_svg(unrolled, view, stage, f"{stage}-{index}") for index, view in enumerate(unrolled.views))
    return f'<figure class="stage"><figcaption>{caption}</figcaption>\n<div class="views">{views}</div></figure>'


def _legend(unrolled: Unrolled) -> str:
    width = 100.0 / STEPS
    steps = "".join(
        f'<rect class="q{step}" x="{step * width:.3f}%" y="0" width="{width + 0.05:.3f}%" height="12"/>'
        for step in range(STEPS)
    )
    ticks = "".join(f"<span>{number(share * unrolled.top, unrolled.top)}</span>" for share in _TICKS)
    unknown = any(math.isnan(value) for values in unrolled.excess for value in values)
    keys = []
    if unrolled.marks[0].boards:
        least = f"p &lt; {SMALL_P} and {100 * LEAST_SHARE:.0f}&#160;% of the excess or more"
        keys.append(f"<b>Bold frame</b>: board with {least}, and its share")
    if unrolled.marks[0].lines:
        keys.append(f'<span class="key">&#9662;</span> line with p &lt; {SMALL_P}')
    if unrolled.marks[1].boards or unrolled.marks[1].lines:
        keys.append("after: the same marks, where something unexplained is left")
    if unknown:
        keys.append("dashed square: no data")
    return (
        f'<div class="legend"><div class="ramp"><svg width="100%" height="12" aria-hidden="true">{steps}</svg>'
        f'<div class="ticks">{ticks}</div><div class="muted">excess, counts; 0 is the floor or below</div></div>'
        f'<ul class="keys">{"".join(f"<li>{key}</li>" for key in keys)}</ul></div>'
    )
