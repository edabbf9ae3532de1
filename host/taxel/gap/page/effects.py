"""The effects: those of the verdict in full, then every candidate that was tried."""

from __future__ import annotations

from taxel.gap.page.bars import Axis, shrink_bar
from taxel.gap.page.effect_cards import effect_card, parameters_words
from taxel.gap.page.fields import Value
from taxel.gap.page.glossary import IDENTIFIABILITIES
from taxel.gap.page.report import Report
from taxel.gap.page.tables import Column, Section, paragraph, table
from taxel.gap.page.text import number, percent, percent_interval, words

_COLUMNS = (
    Column("Effect"),
    Column("Identifiability"),
    Column("Shrink alone", "pic"),
    Column("", "n"),
    Column("95&#160;% interval", "n"),
    Column("Gap after, counts", "n"),
    Column("Fitted parameters"),
)
_SHRINKS = ("predicted_shrink", "measured_shrink")


def effects_section(report: Report) -> Section | None:
    """The section; None if nothing was tried. Raises GapInputError."""
    effects = report.effects
    if not effects:
        return None
    order = report.verdict.texts("effects")
    named = [effect for effect in effects if effect.flag("in_verdict")]
    named.sort(key=lambda effect: order.index(effect.text("name")) if effect.text("name") in order else len(order))
    return Section("effects", "Effects", _cards(report, named) + _candidates(report, effects))


def _cards(report: Report, named: list[Value]) -> str:
    if not named:
        text = "No effect is needed." if report.no_gap else "No effect of the catalogue is the cause."
        return paragraph(text)
    shrinks = [effect.maybe_number(key) for effect in named for key in _SHRINKS]
    bounds = [effect.maybe_interval("measured_shrink_ci95") or (0.0, 0.0) for effect in named]
    axis = Axis.over([*shrinks, *(end for pair in bounds for end in pair)])
    cards = "\n".join(effect_card(report, effect, axis) for effect in named)
    return f'<div class="cards">\n{cards}\n</div>'


def _candidates(report: Report, effects: list[Value]) -> str:
    intervals = [effect.maybe_interval("shrink_alone_ci95") or (0.0, 0.0) for effect in effects]
    ends = [end for pair in intervals for end in pair]
    axis = Axis.over([*(effect.maybe_number("shrink_alone") for effect in effects), *ends])
    body = table(_COLUMNS, (_candidate(report, effect, axis) for effect in effects), "Every candidate", "candidates")
    intro = "<h3>Every candidate, each on its own</h3>"
    label = "Every candidate, each on its own"
    used = [effect.one_of("identifiability", tuple(IDENTIFIABILITIES)) for effect in effects]
    meanings = [f"<b>{word}</b>: {meaning}" for key, (word, meaning) in IDENTIFIABILITIES.items() if key in used]
    scroll = f'<div class="scroll" role="region" aria-label="{label}" tabindex="0">{body}</div>'
    return f"{intro}{scroll}{paragraph('; '.join(meanings) + '.', 'muted more')}"


def _candidate(report: Report, effect: Value, axis: Axis) -> tuple[str, ...]:
    strong = effect.flag("in_verdict")
    name = words(effect.text("name"))
    shrink = effect.maybe_number("shrink_alone")
    bounds = effect.maybe_interval("shrink_alone_ci95")
    word, _ = IDENTIFIABILITIES[effect.one_of("identifiability", tuple(IDENTIFIABILITIES))]
    return (
        f'<b>{name}</b> <span class="tag">in the verdict</span>' if strong else name,
        word,
        "" if shrink is None else shrink_bar(axis, shrink, bounds, strong),
        percent(shrink),
        percent_interval(bounds) if bounds else "",
        number(effect.maybe_number("gap_after_alone")),
        f'<span class="small">{parameters_words(report, effect)}</span>',
    )
