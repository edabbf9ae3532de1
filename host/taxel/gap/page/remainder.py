"""What stays open: effects that these grasps cannot tell apart, what is unexplained, and what to press next."""

from __future__ import annotations

from taxel.gap.page.bars import Axis, share_bar
from taxel.gap.page.places import place_words
from taxel.gap.page.report import Report
from taxel.gap.page.tables import Column, Section, bullets, paragraph, table
from taxel.gap.page.text import escaped, is_small, listed, number, p_words, words

_MOST_PLACES = 12
_PRESSES = (Column("Press"), Column("Tells apart"), Column("Expected gain", "pic"), Column("", "n"))


def confounded_section(report: Report) -> Section | None:
    """Classes of effects that look the same here; None if there are none. Raises GapInputError."""
    found = report.verdict.maybe("confounded_with")
    classes = [] if found is None else [(name, [i.as_text() for i in value.items()]) for name, value in found.entries()]
    lines = [listed([f"<b>{words(name)}</b>", *map(words, others)], "or") for name, others in classes if others]
    if not lines:
        return None
    more = ' <a href="#next">What to press next</a> says which presses would.' if next_section(report) else ""
    intro = paragraph(f"These grasps do not tell the following apart, so that each line is one answer.{more}")
    return Section("confounded", "Not told apart", intro + bullets(lines, "classes"))


def unexplained_section(report: Report) -> Section:
    """What the verdict's effects leave. Raises GapInputError."""
    left = report.root.field("unexplained")
    p = left.maybe_number("p_value")
    signature = escaped(left.maybe_text("signature"))
    places = [place_words(report, place) for place in left.maybe_list("where")]
    tested = f"({p_words(p)})"
    if not is_small(p):
        body = paragraph(f"What is left is not told from the floor {tested}.")
        return Section("unexplained", "Unexplained", body + (paragraph(signature, "muted") if signature else ""))
    body = paragraph(f"Something is left that the effects above do not explain {tested}.")
    body += paragraph(f"<b>It looks like this:</b> {signature}", "signature") if signature else ""
    if places:
        more = len(places) - _MOST_PLACES
        shown = places[:_MOST_PLACES] + ([f"{more} more places"] if more > 0 else [])
        body += paragraph("<b>Here:</b>") + bullets(shown)
    return Section("unexplained", "Unexplained", body)


def next_section(report: Report) -> Section | None:
    """The presses that would tell most; None if the report names none. Raises GapInputError."""
    presses = report.root.maybe_list("next_presses")
    if not presses:
        return None
    gains = [press.maybe_number("gain") for press in presses]
    axis = Axis.over(gains)
    rows = [
        (
            escaped(press.text("press")),
            listed([words(name) for name in press.texts("separates")]),
            "" if gain is None else share_bar(axis, gain, True),
            number(gain, 1.0),
        )
        for press, gain in zip(presses, gains, strict=True)
    ]
    return Section("next", "What to press next", table(_PRESSES, rows, "Presses, the most telling first", "presses"))
