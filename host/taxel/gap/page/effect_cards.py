"""Details of an effect of the verdict: locations, parameters, predicted and measured shrink."""

from typing import Any

from taxel.gap.page.bars import Axis, build_prediction_bar
from taxel.gap.page.cells import Heading, make_table
from taxel.gap.page.glossary import DESCRIPTIONS, IDENTIFIABILITIES
from taxel.gap.page.locations import format_board, format_effect_locations
from taxel.gap.page.text import (
    clean_text,
    format_interval,
    format_number,
    format_percent,
    format_percent_interval,
    format_with_unit,
    join_words,
    make_readable,
)
from taxel.gap.report.checked_report import CheckedReport
from taxel.gap.report.report_values import ReportValue

_HEADINGS = (Heading("Parameter"), Heading("Value", "n"), Heading("95\N{NO-BREAK SPACE}% interval", "n"))
_MAX_INDEX = 2**20
_MIN_FOLDED = 6
"""Number of boards from which the values of a parameter are folded behind their range."""

_DIAMOND, _DOT = "\N{WHITE DIAMOND}", "\N{BLACK CIRCLE}"


def build_effect_card(report: CheckedReport, effect: ReportValue, axis: Axis) -> dict[str, Any]:
    """Variables of the card of an effect. axis: of the shrinks, common to all cards. Raises GapInputError."""
    name = effect.text("name")
    identifiability, meaning = IDENTIFIABILITIES[effect.choice("identifiability", tuple(IDENTIFIABILITIES))]
    predicted, measured = (effect.optional_number(f"{key}_shrink") for key in ("predicted", "measured"))
    bounds = effect.optional_interval("measured_shrink_ci95")
    measured_interval = f" ({format_percent_interval(bounds)})" if bounds else ""
    facts = [
        ("Location", "", format_effect_locations(report, effect)),
        ("Identifiability", "", f"{identifiability}: {meaning}"),
        ("Share of the shrink", "", f"{format_percent(effect.optional_number('shapley_share'))} (Shapley)"),
        ("Gap with this effect alone", "", format_with_unit(effect.optional_number("gap_after_alone"), "counts")),
        ("Predicted", _DIAMOND, f"{format_percent(predicted)} of the gap"),
        ("Measured", _DOT, f"{format_percent(measured)}{measured_interval}"),
    ]
    rows, groups = _parameter_tables(report, effect)
    return {
        "name": make_readable(name),
        "description": DESCRIPTIONS.get(name, ""),
        "facts": [{"term": term, "symbol": symbol, "text": text} for term, symbol, text in facts if text],
        "bar": build_prediction_bar(axis, predicted, measured, bounds),
        "low": format_percent(axis.low),
        "high": format_percent(axis.high),
        "parameters": make_table(_HEADINGS, rows, "Fitted parameters", "parameters") if rows else None,
        "parameter_groups": groups,
    }


def format_parameters(report: CheckedReport, effect: ReportValue) -> str:
    """The fitted parameters in one line of text."""
    texts = []
    for base, members in _parameter_groups(effect).items():
        if len(members) >= _MIN_FOLDED:
            texts.append(_range_text(base, members))
            continue
        for board, parameter in members:
            name, value, bounds = _row(report, base, board, parameter)
            texts.append(f"{name}\N{NO-BREAK SPACE}{value}" + (f" ({bounds})" if bounds else ""))
    return "; ".join(texts)


def _parameter_tables(
    report: CheckedReport, effect: ReportValue
) -> tuple[list[tuple[str, str, str]], list[dict[str, Any]]]:
    """Rows of parameters with few values, and a folded table for each parameter with values of many boards."""
    rows, folded = [], []
    for base, members in _parameter_groups(effect).items():
        own_rows = [_row(report, base, board, parameter) for board, parameter in members]
        if len(members) < _MIN_FOLDED:
            rows += own_rows
        else:
            table = make_table(_HEADINGS, own_rows, "Fitted parameters", "parameters")
            folded.append({"summary": _range_text(base, members), "table": table})
    return rows, folded


def _parameter_groups(effect: ReportValue) -> dict[str, list[tuple[str, ReportValue]]]:
    """Boards and values of each parameter, by the name of the parameter without "@board"."""
    parameters = effect.optional("parameters")
    groups: dict[str, list[tuple[str, ReportValue]]] = {}
    for key, parameter in parameters.entries() if parameters is not None else ():
        base, _, board = key.partition("@")
        groups.setdefault(base, []).append((board, parameter))
    return groups


def _unit(parameter: ReportValue) -> str:
    """Unit of a parameter; empty for a pure number, whose unit is 1."""
    unit = parameter.optional_text("unit")
    return "" if unit == "1" else unit


def _row(report: CheckedReport, base: str, board: str, parameter: ReportValue) -> tuple[str, str, str]:
    """Label, value and interval of a parameter as text. base: name without the board. board: address or name, or ""."""
    unit = _unit(parameter)
    label = make_readable(base.removesuffix(f"_{unit}") if unit else base)
    if board:
        is_address = board.isascii() and board.isdigit()
        label += f", {format_board(report, int(board)) if is_address else clean_text(board)}"
    bounds = parameter.optional_interval("ci95")
    return label, _amount(report, parameter, unit), format_interval(bounds) if bounds else ""


def _amount(report: CheckedReport, parameter: ReportValue, unit: str) -> str:
    """A number with its unit, or the taxels, lines or boards that the parameter lists."""
    value = parameter.field("value")
    if isinstance(value.content, str):
        return clean_text(value.content)
    if isinstance(value.content, list):
        return join_words([_item(report, item, unit) for item in value.items()]) or "none"
    return format_with_unit(None if value.content is None else value.as_number(), unit)


def _item(report: CheckedReport, item: ReportValue, unit: str) -> str:
    """A taxel index, a board by its address, or a line: [address, axis, index]."""
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


def _range_text(base: str, members: list[tuple[str, ReportValue]]) -> str:
    """The smallest and the largest value of a parameter of several boards as text."""
    values = [parameter.optional_number("value") for _, parameter in members]
    known = [value for value in values if value is not None]
    unit = _unit(members[0][1])
    label = make_readable(base.removesuffix(f"_{unit}") if unit else base)
    value_range = f"{format_number(min(known))} to {format_with_unit(max(known), unit)}" if known else "no values"
    return f"{label} of {len(members)} boards: {value_range}"
