"""Crossing map: ASCII picture of a board's TX x RX matrix. Layout: table of its taxels on the unrolled sheet."""

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from taxel.hand.errors import Field, format_value

TAXEL = "#"
UNUSED = "."

LAYOUT_MAX = 16
"""Largest number of rows and of columns of a layout, the limit of the emulator."""


def parse_crossings(text: str) -> NDArray[np.bool_]:
    """Convert a checked crossing map to an array.

    Returns:
        bool[tx, rx], true where a crossing carries a taxel.
    """
    return np.array([[character == TAXEL for character in row] for row in _split_rows(text)], dtype=np.bool_)


def check_crossings(text: str, tx: int, rx: int, taxels: int, field: Field) -> None:
    """Check a crossing map against the declared numbers of lines and taxels.

    Args:
        text: one row per TX line, one column per RX line; '#' is a taxel, '.' an unused crossing. Blanks around a
            row and empty lines before the first and after the last row are ignored.
        tx: declared number of TX lines.
        rx: declared number of RX lines.
        taxels: declared number of taxels.
        field: position of the map in the file, for errors.

    Raises:
        HandDescriptionError: a wrong character, rows of unequal length, a size or number of taxels that differs from
            the declared one, or a line without a taxel.
    """
    rows = _split_rows(text)
    _check_characters(rows, field)
    _check_size(rows, tx, rx, field)
    crossings = parse_crossings(text)
    if (count := int(crossings.sum())) != taxels:
        field.fail(f"{taxels} '#' (taxels = {taxels})", str(count), "correct the map or the number of taxels")
    for line, axis in (("TX", 1), ("RX", 0)):
        empty = np.flatnonzero(~crossings.any(axis=axis))
        if empty.size:
            field.fail(
                "a taxel on every line",
                f"{line} line {empty[0]} has no taxel",
                f"mark its taxels with '#', or remove the line and reduce {line.lower()}",
            )


def _split_rows(text: str) -> list[str]:
    """Divide a crossing map into its rows, one for each TX line, without surrounding blanks."""
    # Not splitlines(), which also splits at characters that must be reported as wrong.
    return [line.strip(" \t\r") for line in text.strip(" \t\r\n").split("\n")]


def _check_characters(rows: list[str], field: Field) -> None:
    """Raise HandDescriptionError for a character other than '#' and '.' in the rows of a crossing map."""
    for tx, row in enumerate(rows):
        for rx, character in enumerate(row):
            if character not in (TAXEL, UNUSED):
                field.fail(
                    "only '#' (taxel) and '.' (unused crossing)",
                    f"{format_value(character)} at TX {tx}, RX {rx}",
                    "replace that character",
                )


def _check_size(rows: list[str], tx: int, rx: int, field: Field) -> None:
    """Raise HandDescriptionError unless the crossing map has `tx` rows of `rx` characters."""
    for line, row in enumerate(rows):
        if len(row) != len(rows[0]):
            field.fail(
                f"rows of equal length ({len(rows[0])}, as row TX 0)",
                f"{len(row)} characters in row TX {line}",
                "fill the row with '.' or shorten it",
            )
    if len(rows) != tx:
        field.fail(
            f"{tx} rows, one per TX line (tx = {tx})",
            str(len(rows)),
            "correct the map or tx; rows are TX lines",
        )
    if len(rows[0]) != rx:
        field.fail(
            f"{rx} columns, one per RX line (rx = {rx})",
            str(len(rows[0])),
            "correct the map or rx; columns are RX lines",
        )


def parse_layout(text: str) -> NDArray[np.int16]:
    """Convert a checked layout to the row and column of each taxel, i16[taxels, 2]."""
    places = {
        int(word): (row, column)
        for row, words in enumerate(_split_words(text))
        for column, word in enumerate(words)
        if word != UNUSED
    }
    return np.array([places[index] for index in range(len(places))], dtype=np.int16)


def check_layout(text: str, taxels: int, field: Field) -> None:
    """Check that a layout contains every taxel index once, in rows of equal length.

    Args:
        text: one row of words per row of the unrolled sheet: the index of a taxel, or '.' for no taxel.
        taxels: number of taxels of the kind.
        field: position of the layout in the file, for errors.

    Raises:
        HandDescriptionError: another word, rows of unequal length, more than LAYOUT_MAX rows or columns, or an index
            that is missing, repeated or too large.
    """
    rows = _split_words(text)
    for row, words in enumerate(rows):
        if len(words) != len(rows[0]):
            field.fail(f"rows of equal length ({len(rows[0])})", f"{len(words)} words in row {row}", "fill with '.'")
        for word in words:
            if word != UNUSED and not (word.isascii() and word.isdigit()):
                field.fail("taxel indices and '.'", f"{format_value(word)} in row {row}", "replace that word")
    if max(len(rows), len(rows[0])) > LAYOUT_MAX:
        field.fail(f"at most {LAYOUT_MAX} rows and columns", f"{len(rows)} x {len(rows[0])}", "divide the board")
    indices = sorted(int(word) for words in rows for word in words if word != UNUSED)
    if indices != list(range(taxels)):
        field.fail(f"every index from 0 to {taxels - 1} once", _describe_indices(indices, taxels), "correct the layout")


def _describe_indices(indices: list[int], taxels: int) -> str:
    """Return text for the first wrong index of a layout: "index 3 more than once", "no index 3" or "index 30".

    indices: all indices of the layout, ascending. taxels: number of taxels, which is above all permitted indices.
    """
    repeated = [a for a, b in pairwise(indices) if a == b]
    missing = sorted(set(range(taxels)) - set(indices))
    if repeated:
        return f"index {repeated[0]} more than once"
    return f"no index {missing[0]}" if missing else f"index {indices[-1]}"


def _split_words(text: str) -> list[list[str]]:
    """Divide a layout into rows of words, without the empty lines around it."""
    return [line.split() for line in text.strip(" \t\r\n").split("\n")]
