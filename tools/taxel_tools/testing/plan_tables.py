"""Tables of a plan file, one for each phase, with the checks that need only one table."""

from __future__ import annotations

import re
from collections.abc import Collection
from dataclasses import dataclass
from typing import Any, NoReturn

from taxel.hand.checks import suggest_name
from taxel.hand.errors import format_value
from taxel.input_files import TextError
from taxel.input_files import parse_toml as parse_bounded_toml
from taxel_tools.errors import PlanError

FILE_BYTES_MAX = 2**18
LINE_BYTES_MAX = 400  # A plan is written by hand; a longer line is a sign of another kind of file.

_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,63}")


@dataclass(frozen=True, slots=True)
class Location:
    """Position in a plan, for error messages."""

    file: str
    path: str = ""

    def fail(self, expected: str, found: str, remedy: str) -> NoReturn:
        """Raise `PlanError` for this location in a test plan."""
        raise PlanError(self.file, self.path or "file", expected, found, remedy)

    def key(self, name: str) -> Location:
        """Return the location in a test plan of a key below this one."""
        key = name if _NAME.fullmatch(name) else format_value(name)
        return Location(self.file, f"{self.path}.{key}" if self.path else key)

    def name(self, name: str) -> Location:
        """Return the location of a key that names a phase, a kind or a limit in a test plan.

        Raises `PlanError` for an invalid name.
        """
        if not _NAME.fullmatch(name):
            self.key(name).fail(
                "a letter, then letters, digits and _ (64 at most)", format_value(name), "rename the key"
            )
        return self.key(name)

    def table(self, value: object) -> dict[str, Any]:
        """Check that a value of a test plan is a table. Returns it; raises `PlanError` otherwise."""
        if not isinstance(value, dict):
            self.fail("a table", format_value(value), "write a table")
        return value

    def flag(self, value: object) -> bool:
        """Check that a value of a test plan is true or false. Returns it; raises `PlanError` otherwise."""
        if not isinstance(value, bool):
            self.fail("true or false", format_value(value), "correct the value")
        return value

    def line(self, value: object, longest: int) -> str:
        """Check that a value of a test plan is a text of one line, of at most `longest` characters. Returns it.

        Raises `PlanError` otherwise.
        """
        if not (isinstance(value, str) and value.strip() and value.isprintable() and len(value) <= longest):
            self.fail(f"one line of text, at most {longest} characters", format_value(value), "correct the value")
        return value

    def check_keys(self, table: dict[str, Any], required: Collection[str], optional: Collection[str] = ()) -> None:
        """Check that a table of a test plan has the required keys and no unknown ones. Raises `PlanError` otherwise."""
        known = (*required, *optional)
        for key in table:
            if key not in known:
                self.key(key).fail("a known key", "an unknown one", suggest_name(key, known))
        for key in required:
            if key not in table:
                self.key(key).fail("this key", "nothing", f"add {key}")


@dataclass(frozen=True, slots=True)
class PhaseTable:
    """Table of one phase.

    `enabled` is None if the table does not state it; `bounds`: bounds of each limit, under "min" and "max".
    """

    location: Location
    name: str
    enabled: bool | None
    options: dict[str, Any]
    bounds: dict[str, dict[str, float]]


def parse_toml(data: bytes, top: Location) -> dict[str, Any]:
    """Parse the TOML text of a test plan. Raises `PlanError` for a file that is too large, not UTF-8 or not TOML."""
    if len(data) > FILE_BYTES_MAX:
        top.fail(f"at most {FILE_BYTES_MAX} bytes", "more", "is this a test plan?")
    longest = max(map(len, data.split(b"\n")))
    if longest > LINE_BYTES_MAX:
        top.fail(f"lines of at most {LINE_BYTES_MAX} bytes", f"one of {longest}", "split this line")
    try:
        return parse_bounded_toml(data, FILE_BYTES_MAX)
    except TextError as error:
        raise PlanError(top.file, error.position, error.expected, error.found, "correct the syntax") from None


def read_phases(location: Location, value: object) -> dict[str, PhaseTable]:
    """Parse the tables of phases in a test plan, or those for one kind of board, in file order. Raises `PlanError`."""
    return {name: _parse_phase(location.name(name), name, table) for name, table in location.table(value).items()}


def _parse_phase(location: Location, name: str, value: object) -> PhaseTable:
    """Parse the table of one phase in a test plan: its options, its limits, and whether it is enabled."""
    options = dict(location.table(value))
    enabled = options.pop("enabled", None)
    limits = location.key("limits").table(options.pop("limits", {}))
    return PhaseTable(
        location,
        name,
        None if enabled is None else location.key("enabled").flag(enabled),
        options,
        {limit: _parse_bounds(location.key("limits").name(limit), bounds) for limit, bounds in limits.items()},
    )


def _parse_bounds(location: Location, value: object) -> dict[str, float]:
    """Parse a limit of a test plan, a table with "min", "max" or both."""
    table = location.table(value)
    location.check_keys(table, (), ("min", "max"))
    if not table:
        location.fail("min, max or both", "neither", "write a bound such as { max = 8.0 }")
    return {key: _parse_bound(location.key(key), key, bound) for key, bound in table.items()}


def _parse_bound(location: Location, key: str, value: object) -> float:
    """Parse one bound of a limit; the infinite value of its side means no bound. key: "min" or "max"."""
    unbounded = float("inf" if key == "max" else "-inf")
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    if not is_number or not (value == unbounded or abs(value) < 1e300):  # type: ignore[arg-type, operator, unused-ignore]
        location.fail(
            f"a number, or {unbounded} for no bound", format_value(value), "correct the value; numbers have no quotes"
        )
    return float(value)  # type: ignore[arg-type]
