"""What the commands share: addresses on the command line, and ways to print."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, is_dataclass
from typing import Any, Final

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeElapsedColumn
from rich.progress import Progress as Bars

from taxel.errors import TaxelError
from taxel_protocol.limits import ADDRESS_MAX, ADDRESS_MIN

URL_HELP: Final = "serial:///dev/ttyUSB0 (the hub), /dev/i2c-1 (an adapter), emulator: ..."


def address_of(text: str, option: str) -> int:
    """An I2C address from 0x21 or 33. Raises `TaxelError` that names the option."""
    try:
        address = int(text, 0)
    except ValueError:
        address = -1
    if not ADDRESS_MIN <= address <= ADDRESS_MAX:
        raise TaxelError(f"{option}: expected an I2C address from 0x08 to 0x77, found '{text}'")
    return address


def boards(count: int) -> str:
    """1 board, 2 boards."""
    return f"{count} board" if count == 1 else f"{count} boards"


def progress_bars(console: Console) -> Bars:
    """Bars of rows, one a task."""
    return Bars(
        TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(), console=console
    )


def print_json(value: Any) -> None:
    """One JSON document on standard output; bytes as hexadecimal digits."""
    print(json.dumps(value, default=_plain, indent=2))


def _plain(value: Any) -> Any:
    if isinstance(value, bytes):
        return value.hex()
    if is_dataclass(value) and not isinstance(value, type):
        return asdict(value)
    return str(value)


def print_table(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """Columns as wide as their widest cell, on standard output; never wrapped, so that other programs can read them."""
    widths = [max(map(len, column)) for column in zip(heads, *rows, strict=True)]
    for row in (heads, *rows):
        print("  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip())
