"""Crossing map: ASCII picture of the TX x RX matrix of a board, and its array."""

import numpy as np
from numpy.typing import NDArray

from taxel.hand.errors import Field, format_value

TAXEL = "#"
UNUSED = "."


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
    """Raise an error for a character other than '#' and '.' in the crossing map."""
    for tx, row in enumerate(rows):
        for rx, character in enumerate(row):
            if character not in (TAXEL, UNUSED):
                field.fail(
                    "only '#' (taxel) and '.' (unused crossing)",
                    f"{format_value(character)} at TX {tx}, RX {rx}",
                    "replace that character",
                )


def _check_size(rows: list[str], tx: int, rx: int, field: Field) -> None:
    """Raise an error unless the crossing map has `tx` rows of `rx` characters."""
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
