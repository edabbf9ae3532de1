"""Who is to be which board: unique ids with address, kind, serial number and calibration.

    taxel_provisioning = 1

    [[board]]
    unique_id = "7d0e4c1a90b3f255"
    address = 0x21
    kind = 1
    serial_number = "FT-0007"
    idac_codes = [16, 16, 17]          # of each RX line from the first on; the rest is 0: as the scan settings say

What is left out stays as the board has it.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, NoReturn

from taxel_protocol.bootloader import BOOT_DEFAULT_ADDRESS
from taxel_protocol.limits import ADDRESS_MIN
from taxel_tools.errors import PlanError

SERIAL_SIZE: Final = 16
IDAC_COUNT: Final = 16
KEYS: Final = {"unique_id", "address", "kind", "serial_number", "idac_codes"}


@dataclass(frozen=True)
class Entry:
    """One board of a plan. `unique_id` None: the only board that is found. None elsewhere: as it is."""

    unique_id: bytes | None
    address: int | None = None
    kind: int | None = None
    serial_number: str | None = None
    idac_codes: tuple[int, ...] | None = None


def read_plan(path: Path) -> list[Entry]:
    """The entries of a plan, in its order. Raises `PlanError`, OSError."""
    try:
        document = tomllib.loads(path.read_text())
    except ValueError as error:
        raise PlanError(str(path), "file", "TOML", str(error).splitlines()[0], "mend it") from None
    if document.get("taxel_provisioning") != 1:
        found = repr(document.get("taxel_provisioning"))
        raise PlanError(str(path), "taxel_provisioning", "1", found, "is this a provisioning plan?")
    tables = document.get("board")
    if not isinstance(tables, list) or not tables or not all(isinstance(table, dict) for table in tables):
        raise PlanError(str(path), "board", "one table or more", "none", "name the boards in [[board]] tables")
    entries = [_entry(str(path), f"board[{place}]", table) for place, table in enumerate(tables)]
    _check_once(str(path), entries)
    return entries


def _entry(source: str, field: str, table: dict[str, Any]) -> Entry:
    unknown = sorted(set(table) - KEYS)
    if unknown:
        raise PlanError(
            source, f"{field}.{unknown[0]}", f"one of {', '.join(sorted(KEYS))}", "an unknown key", "correct its name"
        )
    unique_id = table.get("unique_id")
    if not isinstance(unique_id, str):
        raise PlanError(source, f"{field}.unique_id", "16 hexadecimal digits", repr(unique_id), "scan shows the ids")
    return checked(
        source,
        f"{field}.",
        unique_id,
        table.get("address"),
        table.get("kind"),
        table.get("serial_number"),
        table.get("idac_codes"),
    )


def checked(source: str, prefix: str, unique_id: Any, address: Any, kind: Any, serial: Any, idac: Any) -> Entry:
    """An entry of values that may be anything. Raises `PlanError` that names the one which cannot be."""

    def fail(field: str, expected: str, found: object) -> NoReturn:
        raise PlanError(source, f"{prefix}{field}", expected, repr(found), "correct it")

    if unique_id is not None and not (isinstance(unique_id, str) and re.fullmatch(r"[0-9a-fA-F]{16}", unique_id)):
        fail("unique_id", "16 hexadecimal digits", unique_id)
    if address is not None and not (_is_whole(address) and ADDRESS_MIN <= address < BOOT_DEFAULT_ADDRESS):
        fail("address", f"0x{ADDRESS_MIN:02X} to 0x{BOOT_DEFAULT_ADDRESS - 1:02X}", address)
    if kind is not None and not (_is_whole(kind) and 0 <= kind <= 255):
        fail("kind", "0 to 255", kind)
    if serial is not None and not (isinstance(serial, str) and serial.isascii() and serial.isprintable()):
        fail("serial_number", "printable ASCII", serial)
    if serial is not None and len(serial) > SERIAL_SIZE:
        fail("serial_number", f"at most {SERIAL_SIZE} characters", serial)
    if idac is not None and not (
        isinstance(idac, Sequence)
        and not isinstance(idac, str)
        and len(idac) <= IDAC_COUNT
        and all(_is_whole(code) and 0 <= code <= 255 for code in idac)
    ):
        fail("idac_codes", f"at most {IDAC_COUNT} numbers from 0 to 255", idac)
    return Entry(
        None if unique_id is None else bytes.fromhex(unique_id),
        address,
        kind,
        serial,
        None if idac is None else tuple(idac),
    )


def _is_whole(value: object) -> bool:
    return isinstance(value, int) and not isinstance(value, bool)


def _check_once(source: str, entries: Sequence[Entry]) -> None:
    for name in ("unique_id", "address"):
        seen: dict[object, int] = {}
        for place, entry in enumerate(entries):
            value = getattr(entry, name)
            if value is not None and value in seen:
                shown = value.hex() if isinstance(value, bytes) else f"0x{value:02X}"
                raise PlanError(
                    source, f"board[{place}].{name}", "each once", f"{shown}, as in board[{seen[value]}]", "correct it"
                )
            seen[value] = place
