"""What stays open: effects that these grasps cannot tell apart, what is unexplained, and what to press next."""

from __future__ import annotations

from taxel.gap.page.bars import Axis, share_bar
from taxel.gap.page.fields import Value
from taxel.gap.page.places import place_words
from taxel.gap.page.report import Report
from taxel.gap.page.tables import Column, Section, bullets, paragraph, table
from taxel.gap.page.text import SMALL_P, escaped, is_small, listed, number, p_value, p_words, percent, words

_MOST_PLACES = 12
_LEAST_SHOWN = 0.01
_BANK = (Column("Distortion"), Column("Share of what is left", "pic"), Column("", "n"), Column("p", "n"))
_MEANINGS = {
    "amplitude": "a curve over the predicted drop",
    "lag": "later or earlier",
    "history": "release and recovery remember the press",
    "radial": "a print wider or narrower, ring by ring",
    "shift": "a print beside its place",
    "common": "all taxels together, touched or not",
    "board": "boards: factor and offset, or wrong throughout",
    "row": "TX lines wrong throughout, or showing another's drop",
    "column": "RX lines, the same",
    "taxel": "taxels: factor and offset, or wrong throughout",
    "noise": "scatter from frame to frame",
    "missing": "frames that do not arrive",
    "wander": "untouched taxels after release",
    "session": "sensitivity differs between sessions",
    "presses": "sensitivity changes from press to press",
}
_SCOPES = {
    "board": "for each board",
    "row": "for each TX line",
    "column": "for each RX line",
    "taxel": "for each taxel",
}
_PRESSES = (Column("Press"), Column("Tells"), Column("Expected gain, bits", "pic"), Column("", "n"))


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
    places = [_place(report, place) for place in left.maybe_list("where") if _is_shown(place)]
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
    return Section("unexplained", "Unexplained", body + _bank(left.maybe_list("bank")))


def _share_of(place: Value) -> float | None:
    return place.maybe_number("share") if isinstance(place.content, dict) else None


def _is_shown(place: Value) -> bool:
    share = _share_of(place)
    return share is None or share >= _LEAST_SHOWN


def _place(report: Report, place: Value) -> str:
    """A place, with the share of what is left that lies there."""
    share = _share_of(place)
    return place_words(report, place) + ("" if share is None else f": {percent(share)}")


def _bank(entries: list[Value]) -> str:
    """What each generic distortion tells of what is left; empty if none was tried."""
    if not entries:
        return ""
    shares = [entry.number("share") for entry in entries]
    tested = [entry.maybe_number("p_value") for entry in entries]
    axis = Axis.over([1.0, *shares])
    rows = [
        (_distortion(entry), share_bar(axis, share, is_small(p)), percent(share), p_value(p))
        for entry, share, p in zip(entries, shares, tested, strict=True)
        if share >= _LEAST_SHOWN
    ]
    intro = paragraph(
        "Generic distortions, each alone, on approaches that it was not fitted to; shares overlap and need not add to "
        "100&#160;%. Of those that tell about as much, the words above are of the simplest. A full bar marks "
        f"p&#160;&lt;&#160;{SMALL_P}, corrected for the bank. What differs between sessions or presses is no part of "
        "the excess: its share is of the two together.",
        "muted",
    )
    little = [words(entry.text("name")) for entry, share in zip(entries, shares, strict=True) if share < _LEAST_SHOWN]
    rest = paragraph(f"Less than 1&#160;%: {listed(little)}.", "muted more") if little else ""
    body = table(_BANK, rows, "Generic distortions", "wide") if rows else ""
    return f"<h3>The bank of distortions</h3>{intro}{body}{rest}"


def _distortion(entry: Value) -> str:
    name, scope = entry.text("name"), entry.maybe_text("scope")
    says = _MEANINGS.get(name, "")
    if scope != name and says:
        says = ", ".join(part for part in (says, _SCOPES.get(scope, "")) if part)
    return f'{words(name)}<span class="says">{says}</span>' if says else words(name)


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
