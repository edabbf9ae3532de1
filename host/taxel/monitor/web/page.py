"""HTML of the texts and tables in the browser view."""

import math
from html import escape

from taxel.monitor.colours import INACTIVE_STEPS, STEPS, TABLE
from taxel.monitor.reading import BoardReading, SkinReading
from taxel.monitor.summary_text import Part, format_clock, format_errors, format_load, format_rates

_HEADINGS = (
    ("board", "the address is shown over the name"),
    ("Hz", "frames per second"),
    ("active", "active taxels"),
    ("signal", "largest signal (counts below the baseline)"),
    ("lost", "missing frames"),
    ("bad", "frames with a wrong CRC of the board"),
    ("bus", "failed polls on the bus"),
)
_BAD_STYLE = "color:#c0392b;font-weight:600"
_MUTED_STYLE = "opacity:0.65"
_NUMBER_STYLE = "padding:0.05em 0.3em;text-align:right;white-space:nowrap"
_NAME_STYLE = "padding:0.05em 0.3em;text-align:left;white-space:nowrap"


def format_status_html(reading: SkinReading, title: str) -> str:
    """Format rates, errors, processor load and advice of a reading as HTML for the monitor's web page.

    The attributes `data-...` of the element are read by the script banner.js.
    """
    load = f'<span style="{_MUTED_STYLE}">{_join_parts(format_load(reading))}</span>'
    rows = [_join_parts(format_rates(reading)), _join_parts(format_errors(reading)), load]
    advice = f'<div style="color:#b9770e;font-weight:600">{escape(reading.advice)}</div>' if reading.advice else ""
    body = "".join(f"<div>{row}</div>" for row in rows)
    since = "" if reading.no_data_since_s is None else format_clock(reading.no_data_since_s)
    state = f'data-updated="{reading.watched_s:.2f}" data-ended="{reading.is_ended:d}" data-no-data-since="{since}"'
    return (
        f'<div id="taxel-status" {state} style="padding:0.2em 1em;font-size:0.85em">'
        f"<b>{escape(title)}</b>{body}{advice}</div>"
    )


def _join_parts(parts: list[Part]) -> str:
    """Join the parts of a status line to HTML, with problems in bold red."""
    return " &middot; ".join(f'<span style="{_BAD_STYLE}">{text}</span>' if is_bad else text for text, is_bad in parts)


def format_legend_html(threshold: float, top: float) -> str:
    """Format the legend of the colour scale as HTML. threshold, top: activation threshold and end of scale, counts."""
    return (
        f'<div style="padding:0.2em 1em;font-size:0.8em;{_MUTED_STYLE}">signal (counts below the baseline)</div>'
        '<div style="padding:0 1em 0.3em;font-size:0.8em;display:flex;align-items:center;gap:0.4em">0'
        f'<span style="flex:1;height:0.9em;background:{_format_gradient(0, INACTIVE_STEPS - 1)}"></span>{threshold:g}'
        f'<span style="flex:3;height:0.9em;background:{_format_gradient(INACTIVE_STEPS, STEPS - 1)}"></span>{top:g}'
        f'<span style="width:0.9em;height:0.9em;background:{_format_rgb(STEPS)}"></span>no data</div>'
    )


def _format_gradient(first: int, last: int) -> str:
    """Format the colours of the steps `first` to `last` of the colour table as a CSS gradient."""
    stops = [first + (last - first) * i // 6 for i in range(7)]
    return f"linear-gradient(to right,{','.join(_format_rgb(step) for step in stops)})"


def _format_rgb(step: int) -> str:
    """Format the colour of a step of the colour table for CSS."""
    red, green, blue = TABLE[step].tolist()
    return f"rgb({red},{green},{blue})"


def format_table_html(reading: SkinReading) -> str:
    """Format a reading as an HTML table with one row for each board."""
    head = "".join(
        f'<th style="{_NAME_STYLE if name == "board" else _NUMBER_STYLE}" title="{text}">{name}</th>'
        for name, text in _HEADINGS
    )
    rows = "".join(_format_row(board) for board in reading.boards)
    return (
        '<div style="padding:0.2em 0.6em;overflow-x:auto"><table style="font-size:0.72em;border-collapse:collapse;'
        f'font-variant-numeric:tabular-nums"><tr>{head}</tr>{rows}</table></div>'
    )


def _format_row(board: BoardReading) -> str:
    """Format one board as a row of the HTML table."""
    style = _BAD_STYLE if not board.is_streaming else "font-weight:600" if board.active else ""
    active = str(board.active) if board.baseline_progress >= 1.0 else f"{100 * board.baseline_progress:.0f} %"
    values = [
        f"{board.rate_hz:.1f}" if board.is_streaming else escape(board.state),
        active,
        "-" if math.isnan(board.largest_signal) else f"{board.largest_signal:.0f}",
        str(board.missing),
        str(board.damaged),
        "-" if board.bus_faults is None else str(board.bus_faults),
    ]
    name = escape(board.board.name.replace("_", " "))
    middle = "".join(f'<td style="{_NUMBER_STYLE}">{value}</td>' for value in values)
    return f'<tr style="{style}"><td style="{_NAME_STYLE}" title="0x{board.board.address:02X}">{name}</td>{middle}</tr>'
