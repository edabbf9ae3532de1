"""Values and times as people read them, safe to stand in HTML."""

from __future__ import annotations

import math
from datetime import datetime

from taxel.gap.page.text import ABSENT, MINUS, SPACE, escaped, plural
from taxel_tools.testing.record import Limit, Value

_DIGITS = 3
_MOST_DIGITS = 17  # enough to tell any two doubles apart


def figure(value: Value, limit: Limit | None = None) -> str:
    """Three digits, or as many more as show on which side of its limit the value is: 8.0004 where 8 is allowed."""
    if value is None:
        return "no value"
    if isinstance(value, str):
        return escaped(value)
    if not math.isfinite(value):
        return "NaN" if math.isnan(value) else "infinite" if value > 0 else f"{MINUS}infinite"
    text = _rounded(value, _DIGITS)
    for digits in range(_DIGITS + 1, _MOST_DIGITS + 1):
        if limit is None or limit.holds(float(text.replace(",", ""))) == limit.holds(value):
            break
        text = _rounded(value, digits)
    return text.replace("-", MINUS)


def with_unit(value: Value, unit: str, limit: Limit | None = None) -> str:
    """A value and its unit."""
    known = isinstance(value, int | float) and math.isfinite(value)
    return f"{figure(value, limit)}{SPACE}{escaped(unit)}" if known and unit.strip() else figure(value, limit)


def allowed(limit: Limit | None) -> str:
    """A limit in signs: at most, at least, from to."""
    if limit is None:
        return ABSENT
    low, high = (f"{bound:,.10g}".replace("-", MINUS) for bound in limit.bounds)
    if limit.minimum is None:
        return ABSENT if limit.maximum is None else f"\N{LESS-THAN OR EQUAL TO} {high}"
    if limit.maximum is None:
        return f"\N{GREATER-THAN OR EQUAL TO} {low}"
    return f"= {low}" if low == high else f"{low} to {high}"


def time_words(started_utc: str) -> str:
    """A time of a record: 2026-01-31 09:30:00 UTC; as it is where it is no time."""
    try:
        return f"{datetime.fromisoformat(started_utc):%Y-%m-%d %H:%M:%S}{SPACE}UTC"
    except ValueError:
        return escaped(started_utc)


def seconds_words(seconds: float) -> str:
    """A duration: 4.2 s, 3 min 20 s."""
    if not math.isfinite(seconds):
        return ABSENT
    if seconds < 100:
        return f"{seconds:.1f}{SPACE}s"
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes:,}{SPACE}min {rest}{SPACE}s"


def size_words(size: int) -> str:
    """A number of bytes: 512 bytes, 12 kB."""
    return plural(size, "byte") if size < 1000 else f"{size / 1000:,.0f}{SPACE}kB"


def _rounded(value: float, digits: int) -> str:
    size = abs(value)
    if value == 0 or (size < 1e7 and value.is_integer()):
        return f"{value:,.0f}"
    if not 1e-4 <= size < 1e7:
        return f"{value:.{digits - 1}g}"
    return f"{value:,.{max(0, digits - 1 - math.floor(math.log10(size)))}f}"
