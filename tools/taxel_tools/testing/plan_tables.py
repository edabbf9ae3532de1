"""The tables of a plan as they stand in the file: one phase each, checked as far as one table can be."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Collection
from dataclasses import dataclass
from typing import Any, NoReturn

from taxel.hand.checks import suggest_name
from taxel.hand.errors import format_value
from taxel_tools.errors import PlanError

LARGEST_BYTES = 2**18
LONGEST_LINE = 400  # bytes: a dotted key costs tomllib memory by the square of its parts

_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,63}")


@dataclass(frozen=True, slots=True)
class Place:
    """A place in a plan: where an error points."""

    file: str
    path: str = ""

    def fail(self, expected: str, found: str, remedy: str) -> NoReturn:
        """Raise PlanError for this place."""
        raise PlanError(self.file, self.path or "file", expected, found, remedy)

    def key(self, name: str) -> Place:
        """The place of a key below this one."""
        bare = name if _NAME.fullmatch(name) else format_value(name)
        return Place(self.file, f"{self.path}.{bare}" if self.path else bare)

    def name(self, name: str) -> Place:
        """The place of a key that is the name of a phase, a kind or a limit."""
        if not _NAME.fullmatch(name):
            self.key(name).fail("a letter, then letters, digits and _ (64 at most)", format_value(name), "rename it")
        return self.key(name)

    def table(self, value: object) -> dict[str, Any]:
        """A table."""
        if not isinstance(value, dict):
            self.fail("a table", format_value(value), "make it a table")
        return value

    def flag(self, value: object) -> bool:
        """True or false."""
        if not isinstance(value, bool):
            self.fail("true or false", format_value(value), "correct it")
        return value

    def line(self, value: object, longest: int) -> str:
        """Text of one line."""
        if not (isinstance(value, str) and value.strip() and value.isprintable() and len(value) <= longest):
            self.fail(f"one line of text, at most {longest} characters", format_value(value), "correct it")
        return value

    def check_keys(self, table: dict[str, Any], required: Collection[str], optional: Collection[str] = ()) -> None:
        """The table has the required keys and no unknown ones."""
        known = (*required, *optional)
        for key in table:
            if key not in known:
                self.key(key).fail("a known key", "an unknown one", suggest_name(key, known))
        for key in required:
            if key not in table:
                self.key(key).fail("this key", "nothing", f"add {key}")


@dataclass(frozen=True, slots=True)
class PhaseTable:
    """One phase's table. enabled: None where it does not say; bounds: of each limit, under "min" and "max"."""

    place: Place
    name: str
    enabled: bool | None
    options: dict[str, Any]
    bounds: dict[str, dict[str, float]]


def parse_toml(data: bytes, top: Place) -> dict[str, Any]:
    """The document. Raises `PlanError`: too large, not UTF-8, not TOML."""
    if len(data) > LARGEST_BYTES:
        top.fail(f"at most {LARGEST_BYTES} bytes", "more", "is this a test plan?")
    longest = max(map(len, data.split(b"\n")))
    if longest > LONGEST_LINE:
        top.fail(f"lines of at most {LONGEST_LINE} bytes", f"one of {longest}", "break that line")
    try:
        return tomllib.loads(data.decode("utf-8"))
    except RecursionError:
        top.fail("a few levels of lists", "hundreds", "is this a test plan?")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        top.fail("UTF-8 text", f"byte 0x{data[error.start]:02X} in line {line}", "save the file as UTF-8")
    except ValueError as error:
        problem = str(error).partition("\n")[0]
        top.fail("TOML", problem if problem.isprintable() else format_value(problem), "correct the syntax there")


def read_phases(place: Place, value: object) -> dict[str, PhaseTable]:
    """The tables below `phases` or a kind, in their order. Raises `PlanError`."""
    return {name: _phase(place.name(name), name, table) for name, table in place.table(value).items()}


def _phase(place: Place, name: str, value: object) -> PhaseTable:
    options = dict(place.table(value))
    enabled = options.pop("enabled", None)
    limits = place.key("limits").table(options.pop("limits", {}))
    return PhaseTable(
        place,
        name,
        None if enabled is None else place.key("enabled").flag(enabled),
        options,
        {limit: _bounds(place.key("limits").name(limit), bounds) for limit, bounds in limits.items()},
    )


def _bounds(place: Place, value: object) -> dict[str, float]:
    table = place.table(value)
    place.check_keys(table, (), ("min", "max"))
    if not table:
        place.fail("min, max or both", "neither", "write a bound such as { max = 8.0 }")
    return {key: _bound(place.key(key), key, bound) for key, bound in table.items()}


def _bound(place: Place, key: str, value: object) -> float:
    none_there = float("inf" if key == "max" else "-inf")
    number = isinstance(value, int | float) and not isinstance(value, bool)
    if not number or not (value == none_there or abs(value) < 1e300):  # type: ignore[arg-type, operator, unused-ignore]
        place.fail(f"a number, or {none_there} for no bound", format_value(value), "correct it, without quotes")
    return float(value)  # type: ignore[arg-type]
