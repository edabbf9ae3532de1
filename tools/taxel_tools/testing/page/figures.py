"""Values, times and sizes as escaped text."""

import math
from datetime import datetime

from taxel.gap.page.text import ABSENT, MINUS, SPACE, format_count
from taxel_tools.testing.page.html_text import escape_text
from taxel_tools.testing.record import Limit, Value

_DIGITS = 3
_DIGITS_MAX = 17  # Distinguishes any two doubles.


def format_figure(value: Value, limit: Limit | None = None) -> str:
    """Format a measured value with three digits, or as many more as distinguish it from its limit.

    A value just above the limit 8 becomes 8.0004. None becomes "no value".
    """
    if value is None:
        return "no value"
    if isinstance(value, str):
        return escape_text(value)
    if not math.isfinite(value):
        return "NaN" if math.isnan(value) else "infinite" if value > 0 else f"{MINUS}infinite"
    text = _format_digits(value, _DIGITS)
    for digits in range(_DIGITS + 1, _DIGITS_MAX + 1):
        if limit is None or limit.contains(float(text.replace(",", ""))) == limit.contains(value):
            break
        text = _format_digits(value, digits)
    return text.replace("-", MINUS)


def format_with_unit(value: Value, unit: str, limit: Limit | None = None) -> str:
    """Format a measured value with its unit; the unit is omitted for text and values that are not finite."""
    is_finite = isinstance(value, int | float) and math.isfinite(value)
    return (
        f"{format_figure(value, limit)}{SPACE}{escape_text(unit)}"
        if is_finite and unit.strip()
        else format_figure(value, limit)
    )


def format_limit(limit: Limit | None) -> str:
    """Format a limit with mathematical signs: one bound with a sign, or "LOW to HIGH"."""
    if limit is None:
        return ABSENT
    low, high = (f"{bound:,.10g}".replace("-", MINUS) for bound in limit.bounds)
    if limit.minimum is None:
        return ABSENT if limit.maximum is None else f"\N{LESS-THAN OR EQUAL TO} {high}"
    if limit.maximum is None:
        return f"\N{GREATER-THAN OR EQUAL TO} {low}"
    return f"= {low}" if low == high else f"{low} to {high}"


def format_time(started_utc: str) -> str:
    """Format the time of a record, such as 2026-01-31 09:30:00 UTC, as HTML. A text that is no time is only escaped."""
    try:
        return f"{datetime.fromisoformat(started_utc):%Y-%m-%d %H:%M:%S}{SPACE}UTC"
    except ValueError:
        return escape_text(started_utc)


def format_duration(seconds: float) -> str:
    """Format a duration, such as 4.2 s or 3 min 20 s."""
    if not math.isfinite(seconds):
        return ABSENT
    if seconds < 100:
        return f"{seconds:.1f}{SPACE}s"
    minutes, remainder = divmod(round(seconds), 60)
    return f"{minutes:,}{SPACE}min {remainder}{SPACE}s"


def format_size(size: int) -> str:
    """Format a number of bytes, such as 512 bytes or 12 kB."""
    return format_count(size, "byte") if size < 1000 else f"{size / 1000:,.0f}{SPACE}kB"


def _format_digits(value: float, digits: int) -> str:
    """Format a number with `digits` significant digits; whole numbers below ten million keep all digits."""
    size = abs(value)
    if value == 0 or (size < 1e7 and value.is_integer()):
        return f"{value:,.0f}"
    if not 1e-4 <= size < 1e7:
        return f"{value:.{digits - 1}g}"
    return f"{value:,.{max(0, digits - 1 - math.floor(math.log10(size)))}f}"
