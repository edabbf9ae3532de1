"""Other people's text made safe for the page, and numbers as people read them."""

from __future__ import annotations

import html
import math

from taxel.gap.page.fields import Interval

MINUS = "\N{MINUS SIGN}"
SPACE = "\N{NO-BREAK SPACE}"
ABSENT = "\N{EN DASH}"

SMALL_P = 0.05
"""Below this a p-value is marked: the usual level; the report's p-values are corrected for the search already."""

_DIGITS = 3
_LEAST_P = 0.001


def escaped(text: str) -> str:
    """Text that can stand in an element or in a quoted attribute.

    Control characters, lone surrogates and marks that turn the direction of writing become U+FFFD: XML forbids the
    first two, and the last would let a name rewrite its surroundings.
    """
    plain = " ".join(text.split())
    return html.escape("".join(c if c.isprintable() else "\N{REPLACEMENT CHARACTER}" for c in plain))


def number(value: float | None, beside: float = 0.0) -> str:
    """Three significant digits: 0.0153, 1.53, 15.3, 1,530; as many decimals as `beside` has, if that is larger."""
    if value is None or math.isnan(value):
        return ABSENT
    size = max(abs(value), abs(beside))
    if value == 0.0:
        return "0"
    if not 1e-4 <= size < 1e7:
        return f"{value:.2g}".replace("-", MINUS)
    decimals = max(0, _DIGITS - 1 - math.floor(math.log10(size)))
    return f"{value:,.{decimals}f}".replace("-", MINUS)


def percent(value: float | None) -> str:
    """A share as per cent: 0.4 %, 7.3 %, 63 %."""
    if value is None or math.isnan(value):
        return ABSENT
    scaled = 100.0 * value
    decimals = 0 if abs(scaled) >= 9.95 else 1
    text = f"{scaled:.{decimals}f}"
    if float(text) == 0.0:
        text = "0"
    return f"{text.replace('-', MINUS)}{SPACE}%"


def with_unit(value: float | None, unit: str, beside: float = 0.0) -> str:
    """A number, with decimals as `number` gives them, and its unit, escaped."""
    return ABSENT if value is None else f"{number(value, beside)}{SPACE}{escaped(unit)}".rstrip(SPACE)


def interval(bounds: Interval | None, beside: float = 0.0) -> str:
    """The bounds of an interval, in words, both with the same decimals."""
    if bounds is None:
        return ABSENT
    largest = max(abs(beside), *(abs(bound) for bound in bounds))
    return f"{number(bounds[0], largest)} to {number(bounds[1], largest)}"


def percent_interval(bounds: Interval | None) -> str:
    """The bounds of an interval of shares, in words."""
    return ABSENT if bounds is None else f"{percent(bounds[0])} to {percent(bounds[1])}"


def p_value(value: float | None) -> str:
    """A p-value, escaped: 0.41, 0.003, or below the least that is worth telling apart."""
    if value is None:
        return ABSENT
    if value < _LEAST_P:
        return f"&lt;{SPACE}{_LEAST_P}"
    return f"{value:.3f}" if value < SMALL_P else f"{value:.2f}"


def p_words(value: float | None) -> str:
    """A p-value in a sentence, escaped."""
    if value is None:
        return "not tested"
    sign = "" if value < _LEAST_P else f"={SPACE}"
    return f"p{SPACE}{sign}{p_value(value)}"


def is_small(value: float | None) -> bool:
    """Whether a p-value is to be marked."""
    return value is not None and value < SMALL_P


def words(name: str) -> str:
    """A name of the report as words, escaped: contact_propagation is contact propagation."""
    return escaped(name.replace("_", " "))


def listed(names: list[str], last: str = "and") -> str:
    """Words in a row: a, b and c."""
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} {last} {names[-1]}" if names else ""


def plural(count: int, noun: str, many: str = "") -> str:
    """A number of things."""
    return f"{count:,}{SPACE}{noun if count == 1 else many or f'{noun}s'}"
