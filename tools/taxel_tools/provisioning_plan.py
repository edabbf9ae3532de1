"""Provisioning plan: a TOML file that assigns address, kind, serial number and calibration to unique ids.

    taxel_provisioning = 1

    [[board]]
    unique_id = "7d0e4c1a90b3f255"
    address = 0x21
    kind = 1
    serial_number = "FT-0007"
    idac_codes = [16, 16, 17]          # of the first RX lines; lines without a code use the scan settings

Keys that are left out keep the value stored on the board.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, NoReturn

from taxel.hand.errors import format_value
from taxel.input_files import TextError, parse_toml, read_regular_file
from taxel.input_files.toml_text import TOML_BYTES_MAX
from taxel_protocol.bootloader import BOOT_DEFAULT_ADDRESS
from taxel_protocol.limits import ADDRESS_MIN
from taxel_tools.errors import PlanError

SERIAL_SIZE: Final = 16
IDAC_COUNT: Final = 16
KEYS: Final = {"unique_id", "address", "kind", "serial_number", "idac_codes"}


@dataclass(frozen=True)
class Entry:
    """Requested configuration of one board.

    `unique_id` None selects the only board found. None in another field leaves the value of the board unchanged.
    """

    unique_id: bytes | None
    address: int | None = None
    kind: int | None = None
    serial_number: str | None = None
    idac_codes: tuple[int, ...] | None = None


def read_plan(path: Path) -> list[Entry]:
    """Read the entries of a provisioning plan, in file order. Raises `PlanError`, OSError."""
    try:
        document = parse_toml(read_regular_file(path, TOML_BYTES_MAX))
    except TextError as error:
        raise PlanError(str(path), error.position, error.expected, error.found, "correct the file") from None
    version = document.get("taxel_provisioning")
    if type(version) is not int or version != 1:  # in Python, True == 1 and 1.0 == 1
        raise PlanError(str(path), "taxel_provisioning", "1", format_value(version), "is this a provisioning plan?")
    tables = document.get("board")
    if not isinstance(tables, list) or not tables or not all(isinstance(table, dict) for table in tables):
        raise PlanError(str(path), "board", "one table or more", "none", "add a [[board]] table for each board")
    unknown = sorted(set(document) - {"taxel_provisioning", "board"})
    if unknown:
        raise PlanError(str(path), unknown[0], "taxel_provisioning or board", "an unknown key", "correct its name")
    entries = [_parse_entry(str(path), f"board[{index}]", table) for index, table in enumerate(tables)]
    _check_unique(str(path), entries)
    return entries


def _parse_entry(source: str, field: str, table: dict[str, Any]) -> Entry:
    """Parse the table of one board in a provisioning plan. Raises `PlanError`.

    source: name of the file. field: position of the table, such as "board[0]".
    """
    unknown = sorted(set(table) - KEYS)
    if unknown:
        raise PlanError(
            source, f"{field}.{unknown[0]}", f"one of {', '.join(sorted(KEYS))}", "an unknown key", "correct its name"
        )
    unique_id = table.get("unique_id")
    if not isinstance(unique_id, str):
        raise PlanError(
            source, f"{field}.unique_id", "16 hexadecimal digits", repr(unique_id), "taxel scan lists the ids"
        )
    return validate_entry(
        source,
        f"{field}.",
        unique_id,
        table.get("address"),
        table.get("kind"),
        table.get("serial_number"),
        table.get("idac_codes"),
    )


def validate_entry(source: str, prefix: str, unique_id: Any, address: Any, kind: Any, serial: Any, idac: Any) -> Entry:
    """Check the values for one board, which a user has written, and return them as an entry.

    source: file or command, and prefix: text before the field names; both for messages. idac: codes of the current
    source. Raises `PlanError` that names the invalid field.
    """

    def fail(field: str, expected: str, value: object) -> NoReturn:
        """Raise `PlanError` for a field of the entry."""
        raise PlanError(source, f"{prefix}{field}", expected, repr(value), "correct it")

    if unique_id is not None and not (isinstance(unique_id, str) and re.fullmatch(r"[0-9a-fA-F]{16}", unique_id)):
        fail("unique_id", "16 hexadecimal digits", unique_id)
    if address is not None and not (_is_integer(address) and ADDRESS_MIN <= address < BOOT_DEFAULT_ADDRESS):
        fail("address", f"0x{ADDRESS_MIN:02X} to 0x{BOOT_DEFAULT_ADDRESS - 1:02X}", address)
    if kind is not None and not (_is_integer(kind) and 0 <= kind <= 255):
        fail("kind", "0 to 255", kind)
    if serial is not None and not (isinstance(serial, str) and serial.isascii() and serial.isprintable()):
        fail("serial_number", "printable ASCII", serial)
    if serial is not None and len(serial) > SERIAL_SIZE:
        fail("serial_number", f"at most {SERIAL_SIZE} characters", serial)
    if idac is not None and not (
        isinstance(idac, Sequence)
        and not isinstance(idac, str)
        and len(idac) <= IDAC_COUNT
        and all(_is_integer(code) and 0 <= code <= 255 for code in idac)
    ):
        fail("idac_codes", f"at most {IDAC_COUNT} numbers from 0 to 255", idac)
    return Entry(
        None if unique_id is None else bytes.fromhex(unique_id),
        address,
        kind,
        serial,
        None if idac is None else tuple(idac),
    )


def _is_integer(value: object) -> bool:
    """Return whether a value of a file is an integer and not a boolean."""
    return isinstance(value, int) and not isinstance(value, bool)


def _check_unique(source: str, entries: Sequence[Entry]) -> None:
    """Check that unique ids and addresses occur once in a provisioning plan. Raises `PlanError`."""
    for name in ("unique_id", "address"):
        first_index: dict[object, int] = {}
        for index, entry in enumerate(entries):
            value = getattr(entry, name)
            if value is not None and value in first_index:
                value_text = value.hex() if isinstance(value, bytes) else f"0x{value:02X}"
                raise PlanError(
                    source,
                    f"board[{index}].{name}",
                    "a value used once",
                    f"{value_text}, as in board[{first_index[value]}]",
                    "correct it",
                )
            first_index[value] = index
