"""Numbers, names and other texts of a page."""

import math

from taxel.gap.report.report_values import Interval

MINUS = "\N{MINUS SIGN}"
SPACE = "\N{NO-BREAK SPACE}"
ABSENT = "\N{EN DASH}"

SMALL_P = 0.05
"""p-values below this are marked (usual level); the p-values of a report are already corrected for the search."""

_DIGITS = 3
_MIN_P = 0.001


def clean_text(text: str) -> str:
    """Return a text on one line in which every unprintable character is replaced by U+FFFD.

    XML forbids control characters and lone surrogates. Characters that change the direction of writing would allow a
    name to alter the text around it.
    """
    line = " ".join(text.split())
    return "".join(character if character.isprintable() else "\N{REPLACEMENT CHARACTER}" for character in line)


def make_readable(name: str) -> str:
    """Return a name of the report as words: contact_propagation becomes "contact propagation"."""
    return clean_text(name.replace("_", " "))


def format_number(value: float | None, compared_with: float = 0.0) -> str:
    """Return a number with three significant digits: 0.0153, 1.53, 15.3, 1,530; a dash for None and NaN.

    compared_with: another number of the same table; if it is larger, it determines the number of decimals.
    """
    if value is None or math.isnan(value):
        return ABSENT
    size = max(abs(value), abs(compared_with))
    if value == 0.0:
        return "0"
    if not 1e-4 <= size < 1e7:
        return f"{value:.2g}".replace("-", MINUS)
    decimals = max(0, _DIGITS - 1 - math.floor(math.log10(size)))
    return f"{value:,.{decimals}f}".replace("-", MINUS)


def format_percent(value: float | None) -> str:
    """Return a share in per cent: 0.4 %, 7.3 %, 63 %; a dash for None and NaN."""
    if value is None or math.isnan(value):
        return ABSENT
    scaled = 100.0 * value
    decimals = 0 if abs(scaled) >= 9.95 else 1
    text = f"{scaled:.{decimals}f}"
    if float(text) == 0.0:
        text = "0"
    return f"{text.replace('-', MINUS)}{SPACE}%"


def format_probability(value: float) -> str:
    """Return a probability in whole per cent: < 1 %, 3 %, 97 %, > 99 %.

    Decimals would have no meaning, because the probabilities are calibrated with only some hundred datasets.
    """
    if value < 0.005 or value > 0.995:
        return f"<{SPACE}1{SPACE}%" if value < 0.5 else f">{SPACE}99{SPACE}%"
    return f"{100.0 * value:.0f}{SPACE}%"


def format_shrink(value: float | None) -> str:
    """Return a shrink in whole per cent, as in the sentence of the verdict: 61 %; a dash for None and NaN."""
    if value is None or math.isnan(value):
        return ABSENT
    text = f"{100.0 * value:.0f}"
    return f"{'0' if text == '-0' else text.replace('-', MINUS)}{SPACE}%"


def format_shrink_interval(bounds: Interval | None) -> str:
    """Return the bounds of the interval of a shrink: "55 % to 74 %"; empty for None."""
    return "" if bounds is None else f"{format_shrink(bounds[0])} to {format_shrink(bounds[1])}"


def format_counts(value: float | None) -> str:
    """Return a gap or a floor with one decimal, as in the sentence of the verdict: 24.3 counts; a dash for None and
    NaN.
    """
    return ABSENT if value is None or math.isnan(value) else f"{value:,.1f}{SPACE}counts".replace("-", MINUS)


def format_with_unit(value: float | None, unit: str, compared_with: float = 0.0) -> str:
    """Return a number as by `format_number`, and its unit; a dash for None."""
    return ABSENT if value is None else f"{format_number(value, compared_with)}{SPACE}{clean_text(unit)}".rstrip(SPACE)


def format_interval(bounds: Interval | None, compared_with: float = 0.0) -> str:
    """Return the bounds of an interval with the same number of decimals: "1.20 to 3.40"; a dash for None.

    compared_with: another number of the same table, as for `format_number`.
    """
    if bounds is None:
        return ABSENT
    largest = max(abs(compared_with), *(abs(bound) for bound in bounds))
    return f"{format_number(bounds[0], largest)} to {format_number(bounds[1], largest)}"


def format_percent_interval(bounds: Interval | None) -> str:
    """Return the bounds of an interval of shares: "12 % to 34 %"; a dash for None."""
    return ABSENT if bounds is None else f"{format_percent(bounds[0])} to {format_percent(bounds[1])}"


def format_p_value(value: float | None) -> str:
    """Return a p-value: 0.41, 0.003, or "< 0.001"; a dash for None."""
    if value is None:
        return ABSENT
    if value < _MIN_P:
        return f"<{SPACE}{_MIN_P}"
    return f"{value:.3f}" if value < SMALL_P else f"{value:.2f}"


def format_p_equation(value: float | None) -> str:
    """Return a p-value as in a sentence: "p = 0.41"; "not tested" for None."""
    if value is None:
        return "not tested"
    sign = "" if value < _MIN_P else f"={SPACE}"
    return f"p{SPACE}{sign}{format_p_value(value)}"


def is_small(value: float | None) -> bool:
    """Return whether a p-value is below `SMALL_P`, so that the page marks it; False for None."""
    return value is not None and value < SMALL_P


def join_words(names: list[str], last: str = "and") -> str:
    """Return a list as in a sentence: "a, b and c"; empty without names. last: word before the last name."""
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} {last} {names[-1]}" if names else ""


def format_count(count: int, noun: str, plural_noun: str = "") -> str:
    """Return a count and its noun: "1 board", "2 boards"."""
    return f"{count:,}{SPACE}{noun if count == 1 else plural_noun or f'{noun}s'}"
