"""Helpers shared by the board commands: addresses on the command line, progress bars, JSON and tables."""

import json
from collections.abc import Sequence
from dataclasses import asdict, is_dataclass
from typing import Any, Final

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeElapsedColumn
from rich.progress import Progress as Bars

from taxel.errors import TaxelError
from taxel_protocol.limits import ADDRESS_MAX, ADDRESS_MIN

URL_HELP: Final = "serial:///dev/ttyUSB0 (the hub), i2c:///dev/i2c-1 (an adapter), emulator: ..."


def parse_address(text: str, option: str) -> int:
    """Parse an I2C address such as 0x21 or 33. Raises `TaxelError` that names the option."""
    try:
        address = int(text, 0)
    except ValueError:
        address = -1
    if not ADDRESS_MIN <= address <= ADDRESS_MAX:
        limits = f"0x{ADDRESS_MIN:02X} to 0x{ADDRESS_MAX:02X}"
        raise TaxelError(f"{option}: expected an I2C address from {limits}, found '{text}'")
    return address


def count_boards(count: int) -> str:
    """Format a number of boards: "1 board", "2 boards"."""
    return f"{count} board" if count == 1 else f"{count} boards"


def make_progress_bars(console: Console) -> Bars:
    """Create progress bars that count flash rows, one bar for each task."""
    return Bars(
        TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(), console=console
    )


def print_json(value: Any) -> None:
    """Print one JSON document on standard output; bytes become hexadecimal digits."""
    print(json.dumps(value, default=_to_json_value, indent=2))


def _to_json_value(value: Any) -> Any:
    """Convert a value that the JSON encoder does not support: bytes to hexadecimal digits, a dataclass to a table.

    Any other value becomes its string.
    """
    if isinstance(value, bytes):
        return value.hex()
    if is_dataclass(value) and not isinstance(value, type):
        return asdict(value)
    return str(value)


def print_table(headings: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """Print columns on standard output, each as wide as its widest cell.

    Lines are never wrapped, so that scripts can read the table.
    """
    widths = [max(map(len, column)) for column in zip(headings, *rows, strict=True)]
    for row in (headings, *rows):
        print("  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip())
