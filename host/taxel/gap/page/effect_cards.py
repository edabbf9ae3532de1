"""Details of an effect of the verdict: locations, parameters, predicted and measured shrink."""

from typing import Any

from taxel.gap.page.cells import Heading, make_table
from taxel.gap.page.glossary import DESCRIPTIONS, IDENTIFIABILITIES
from taxel.gap.page.locations import format_board, format_board_address, format_effect_locations
from taxel.gap.page.text import (
    clean_text,
    format_interval,
    format_number,
    format_percent,
    format_with_unit,
    join_words,
    make_readable,
)
from taxel.gap.report.checked_report import CheckedReport
from taxel.gap.report.report_values import ReportValue

_HEADINGS = (Heading("Parameter"), Heading("Value", "n"), Heading("95\N{NO-BREAK SPACE}% interval", "n"))
_MAX_INDEX = 2**20
_SAME_QUANTITY = {"log_gain": "scale"}
"""Parameters that are not shown beside another one, of which they are the logarithm."""

_MIN_FOLDED = 6
"""Number of boards from which the values of a parameter are folded behind their range."""

NEUTRAL_DIFFERENCE = 0.005
"""Difference from the neutral value below which two decimals do not show a difference, in the unit of the parameter."""


def build_effect_card(report: CheckedReport, effect: ReportValue) -> dict[str, Any]:
    """Return the variables of the card of an effect: name, description, facts and parameters. Raises GapInputError for
    a missing or malformed field.
    """
    name = effect.text("name")
    identifiability, meaning = IDENTIFIABILITIES[effect.choice("identifiability", tuple(IDENTIFIABILITIES))]
    facts = [
        ("Location", format_effect_locations(report, effect)),
        ("Identifiability", f"{identifiability}: {meaning}"),
    ]
    if sum(other.flag("in_verdict") for other in report.effects) > 1:
        share = format_percent(effect.optional_number("shapley_share"))
        facts.append(("Part of the reduction", f"{share} (Shapley share)"))
    rows, groups = _build_parameter_tables(report, effect)
    return {
        "name": make_readable(name),
        "description": DESCRIPTIONS.get(name, ""),
        "facts": [{"term": term, "text": text} for term, text in facts if text],
        "parameters": make_table(_HEADINGS, rows, "Fitted parameters", "parameters") if rows else None,
        "parameter_groups": groups,
    }


def format_parameters(report: CheckedReport, effect: ReportValue) -> str:
    """Return the fitted parameters of an effect that are not neutral as one line of text; empty if there are none."""
    texts = []
    for base, members in _group_parameters(effect).items():
        if len(members) >= _MIN_FOLDED:
            texts.append(_format_range(base, members))
            continue
        for board, parameter in members:
            name, value, bounds = _format_row(report, base, board, parameter)
            texts.append(f"{name}\N{NO-BREAK SPACE}{value}" + (f" ({bounds})" if bounds else ""))
    return "; ".join(texts)


def _build_parameter_tables(
    report: CheckedReport, effect: ReportValue
) -> tuple[list[tuple[str, str, str]], list[dict[str, Any]]]:
    """Return the rows of parameters with few values, and a folded table for each parameter with values of at least
    `_MIN_FOLDED` boards.
    """
    rows, folded = [], []
    for base, members in _group_parameters(effect).items():
        own_rows = [_format_row(report, base, board, parameter) for board, parameter in members]
        if len(members) < _MIN_FOLDED:
            rows += own_rows
        else:
            table = make_table(_HEADINGS, own_rows, "Fitted parameters", "parameters")
            folded.append({"summary": _format_range(base, members), "table": table})
    return rows, folded


def _group_parameters(effect: ReportValue) -> dict[str, list[tuple[str, ReportValue]]]:
    """Return boards and values of each parameter that is not neutral, by the name of the parameter without "@board".

    Parameters that state the same quantity as another parameter are omitted. The board is "" for a value of the whole
    hand.
    """
    parameters = effect.optional("parameters")
    groups: dict[str, list[tuple[str, ReportValue]]] = {}
    entries = list(parameters.entries()) if parameters is not None else []
    bases = {key.partition("@")[0] for key, _ in entries}
    for key, parameter in entries:
        base, _, board = key.partition("@")
        if _SAME_QUANTITY.get(base) in bases or is_neutral(parameter):
            continue
        groups.setdefault(base, []).append((board, parameter))
    return groups


def is_neutral(parameter: ReportValue) -> bool:
    """Return whether a parameter changes nothing: a number within rounding of its neutral value, or an empty list.

    False for a text, and for a parameter without a value or without a neutral value.
    """
    value, neutral = parameter.field("value").content, parameter.optional_number("neutral")
    if isinstance(value, list):
        return not value
    if neutral is None or value is None or isinstance(value, str):
        return False
    size = max(1.0, abs(neutral))
    return abs(parameter.number("value") - neutral) < NEUTRAL_DIFFERENCE * size


def _get_unit(parameter: ReportValue) -> str:
    """Return the unit of a parameter; empty for a pure number, whose unit is 1."""
    unit = parameter.optional_text("unit")
    return "" if unit == "1" else unit


def _format_row(report: CheckedReport, base: str, board: str, parameter: ReportValue) -> tuple[str, str, str]:
    """Return label, value and interval of a parameter as texts. base: name of the parameter without the board. board:
    address or name of the board, or "".
    """
    unit = _get_unit(parameter)
    label = make_readable(base.removesuffix(f"_{unit}") if unit else base)
    if board:
        is_address = board.isascii() and board.isdigit()
        label += f", {format_board_address(report, int(board)) if is_address else clean_text(board)}"
    bounds = parameter.optional_interval("ci95")
    return label, _format_amount(report, parameter, unit), format_interval(bounds) if bounds else ""


def _format_amount(report: CheckedReport, parameter: ReportValue, unit: str) -> str:
    """Return the value of a parameter as text: a number with its unit, or the taxels, lines or boards that it lists."""
    value = parameter.field("value")
    if isinstance(value.content, str):
        return clean_text(value.content)
    if isinstance(value.content, list):
        return join_words([_format_item(report, item, unit) for item in value.items()]) or "none"
    return format_with_unit(None if value.content is None else value.as_number(), unit)


def _format_item(report: CheckedReport, item: ReportValue, unit: str) -> str:
    """Return an item of a list as text: a line [address, axis, index], a text, a taxel index, a board by its address,
    or another number.

    unit: unit of the parameter. A number is a taxel index if the unit is "index", the address of a board if the unit is
    "address", and a plain number otherwise.
    """
    if isinstance(item.content, list):
        fields = item.items()
        if len(fields) != 3:
            item.reject("an address, an axis and an index")
        address, axis, index = fields
        board = format_board(report, address.as_integer(0, 255))
        return f"{clean_text(axis.as_text().upper())} {index.as_integer(0, 255)} of {board}"
    if isinstance(item.content, str):
        return clean_text(item.content)
    if unit == "index":
        return str(item.as_integer(0, _MAX_INDEX))
    return format_board(report, item.as_integer(0, 255)) if unit == "address" else format_number(item.as_number())


def _format_range(base: str, members: list[tuple[str, ReportValue]]) -> str:
    """Return the smallest and the largest value of a parameter of several boards as text. base: name of the parameter.
    members: board and value.
    """
    values = [parameter.optional_number("value") for _, parameter in members]
    known = [value for value in values if value is not None]
    unit = _get_unit(members[0][1])
    label = make_readable(base.removesuffix(f"_{unit}") if unit else base)
    value_range = f"{format_number(min(known))} to {format_with_unit(max(known), unit)}" if known else "no values"
    return f"{label} of {len(members)} boards: {value_range}"
