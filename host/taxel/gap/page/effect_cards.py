"""The effects of the verdict, one card each: what it is, where, its parameters, and what it was predicted to do."""

from __future__ import annotations

from taxel.gap.page.bars import Axis, predicted_measured
from taxel.gap.page.fields import Value
from taxel.gap.page.glossary import IDENTIFIABILITIES, LACKS
from taxel.gap.page.places import acts_on
from taxel.gap.page.report import Report
from taxel.gap.page.tables import Column, folded, paragraph, table
from taxel.gap.page.text import (
    escaped,
    interval,
    listed,
    number,
    percent,
    percent_interval,
    with_unit,
    words,
)

_COLUMNS = (Column("Parameter"), Column("Value", "n"), Column("95&#160;% interval", "n"))
_MAX_INDEX = 2**20
_MANY = 6  # boards from which on a parameter's values are folded away


def effect_card(report: Report, effect: Value, axis: Axis) -> str:
    """One effect of the verdict; `axis` of the shrinks is common to all cards. Raises GapInputError."""
    name = effect.text("name")
    place = acts_on(report, effect)
    word, meaning = IDENTIFIABILITIES[effect.one_of("identifiability", tuple(IDENTIFIABILITIES))]
    predicted, measured = (effect.maybe_number(f"{key}_shrink") for key in ("predicted", "measured"))
    bounds = effect.maybe_interval("measured_shrink_ci95")
    facts = [
        ("Acts on", place),
        ("Identifiability", f"{word}: {meaning}"),
        ("Share of the shrink", f"{percent(effect.maybe_number('shapley_share'))} (Shapley)"),
        ("Gap with it alone", with_unit(effect.maybe_number("gap_after_alone"), "counts")),
        ("Predicted", f'<span class="glyph">&#9671;</span> {percent(predicted)} of the gap'),
        ("Measured", f'<span class="glyph">&#9679;</span> {percent(measured)}{_within(bounds)}'),
    ]
    terms = "".join(f"<div><dt>{term}</dt><dd>{text}</dd></div>" for term, text in facts if text)
    return (
        f'<article class="card"><h3>{words(name)}</h3>{paragraph(LACKS[name]) if name in LACKS else ""}'
        f"<dl>{terms}</dl>{predicted_measured(axis, predicted, measured, bounds)}"
        f'<div class="scale muted"><span>{percent(axis.low)}</span><span>shrink, held out</span>'
        f"<span>{percent(axis.high)}</span></div>{parameters_html(report, effect)}</article>"
    )


def _within(bounds: tuple[float, float] | None) -> str:
    return "" if bounds is None else f" ({percent_interval(bounds)})"


def parameters_html(report: Report, effect: Value) -> str:
    """The fitted parameters as a table; those of many boards are folded away behind their range."""
    groups: dict[str, list[tuple[str, Value]]] = {}
    for key, parameter in _parameters(effect):
        base, _, board = key.partition("@")
        groups.setdefault(base, []).append((board, parameter))
    plain = [_row(report, base, board, p) for base, own in groups.items() if len(own) < _MANY for board, p in own]
    text = table(_COLUMNS, plain, "Fitted parameters", "parameters") if plain else ""
    for base, own in groups.items():
        if len(own) >= _MANY:
            rows = [_row(report, base, board, parameter) for board, parameter in own]
            text += folded(_range_words(base, own), table(_COLUMNS, rows, "Fitted parameters", "parameters"))
    return text


def parameters_words(report: Report, effect: Value) -> str:
    """The fitted parameters in a row of words."""
    texts = []
    groups: dict[str, list[tuple[str, Value]]] = {}
    for key, parameter in _parameters(effect):
        base, _, board = key.partition("@")
        groups.setdefault(base, []).append((board, parameter))
    for base, own in groups.items():
        if len(own) >= _MANY:
            texts.append(_range_words(base, own))
            continue
        for board, parameter in own:
            name, value, bounds = _row(report, base, board, parameter)
            texts.append(f"{name}\N{NO-BREAK SPACE}{value}" + (f" ({bounds})" if bounds else ""))
    return "; ".join(texts)


def _parameters(effect: Value) -> list[tuple[str, Value]]:
    found = effect.maybe("parameters")
    return [] if found is None else list(found.entries())


def _unit(parameter: Value) -> str:
    """Of a parameter; nothing for a plain number, of which the unit is 1."""
    unit = parameter.maybe_text("unit")
    return "" if unit == "1" else unit


def _row(report: Report, base: str, board: str, parameter: Value) -> tuple[str, str, str]:
    unit = _unit(parameter)
    label = base.removesuffix(f"_{unit}") if unit else base
    where = ""
    if board:
        where = f", {report.board(int(board)) if board.isascii() and board.isdigit() else escaped(board)}"
    bounds = parameter.maybe_interval("ci95")
    return f"{words(label)}{where}", _amount(report, parameter, unit), interval(bounds) if bounds else ""


def _amount(report: Report, parameter: Value, unit: str) -> str:
    """A number and its unit, or the taxels, lines or boards that a parameter lists."""
    value = parameter.field("value")
    if isinstance(value.content, str):
        return escaped(value.content)
    if isinstance(value.content, list):
        return listed([_item(report, item, unit) for item in value.items()]) or "none"
    return with_unit(None if value.content is None else value.as_number(), unit)


def _item(report: Report, item: Value, unit: str) -> str:
    """An index, a board by its address, or a line: [address, axis, index]."""
    if isinstance(item.content, list):
        parts = item.items()
        if len(parts) != 3:
            item.fail("an address, an axis and an index")
        board = report.board(parts[0].as_integer(0, 255))
        return f"{escaped(parts[1].as_text().upper())} {parts[2].as_integer(0, 255)} of {board}"
    if isinstance(item.content, str):
        return escaped(item.content)
    if unit == "index":
        return str(item.as_integer(0, _MAX_INDEX))
    return report.board(item.as_integer(0, 255)) if unit == "address" else number(item.as_number())


def _range_words(base: str, own: list[tuple[str, Value]]) -> str:
    values = [parameter.maybe_number("value") for _, parameter in own]
    known = [value for value in values if value is not None]
    unit = _unit(own[0][1])
    label = words(base.removesuffix(f"_{unit}") if unit else base)
    spread = f"{number(min(known))} to {with_unit(max(known), unit)}" if known else "no values"
    return f"{label} of {len(own)} boards: {spread}"
