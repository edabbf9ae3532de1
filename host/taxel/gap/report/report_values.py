"""A value of a report with its path in the report; a value of the wrong type raises a one-line error."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NoReturn

from taxel.gap.errors import GapInputError
from taxel.hand.errors import format_value

Interval = tuple[float, float]
"""Lower and upper bound of a 95 % interval."""

REMEDY = "make the report again with taxel gap diagnose"
"""Last part of the message of every error about the content of a report."""


@dataclass(frozen=True)
class ReportValue:
    """A value as `json.load` returns it, with its path for error messages.

    Every method raises GapInputError if the value does not have the expected type. The methods `optional_...` return
    None, or an empty value, for a field that is absent or null.
    """

    content: object
    path: str = ""

    def reject(self, expected: str) -> NoReturn:
        """Raise GapInputError for this value. expected: description of a permitted value."""
        raise GapInputError(f"report: {self.path or 'file'}", expected, format_value(self.content), REMEDY)

    # --- the value itself

    def table(self) -> dict[str, object]:
        """Return keys and contents of a table."""
        if not isinstance(self.content, dict):
            self.reject("a table")
        return self.content

    def items(self) -> list[ReportValue]:
        """Return the elements of a list."""
        if not isinstance(self.content, list):
            self.reject("a list")
        return [ReportValue(item, f"{self.path}[{index}]") for index, item in enumerate(self.content)]

    def entries(self) -> Iterator[tuple[str, ReportValue]]:
        """Iterate over the keys of a table and their values."""
        for key, content in self.table().items():
            yield key, ReportValue(content, _join_path(self.path, key))

    def as_text(self) -> str:
        """Return the value as a string."""
        if not isinstance(self.content, str):
            self.reject("a string")
        return self.content

    def as_number(self) -> float:
        """Return the value as a finite number."""
        content = self.content
        if isinstance(content, bool) or not isinstance(content, int | float):
            self.reject("a number")
        # The conversion of an integer with many digits would overflow.
        if not -1e300 < content < 1e300:
            self.reject("a finite number")
        return float(content)

    def as_integer(self, low: int, high: int) -> int:
        """Return the value as an integer from `low` to `high`."""
        content = self.content
        if isinstance(content, bool) or not isinstance(content, int) or not low <= content <= high:
            self.reject(f"an integer from {low} to {high}")
        return content

    # --- fields of a table

    def field(self, key: str) -> ReportValue:
        """Return a required field, which may be null."""
        table = self.table()
        if key not in table:
            raise GapInputError(f"report: {_join_path(self.path, key)}", "a field of that name", "none", REMEDY)
        return ReportValue(table[key], _join_path(self.path, key))

    def optional(self, key: str) -> ReportValue | None:
        """Return an optional field; None if it is absent or null."""
        content = self.table().get(key)
        return None if content is None else ReportValue(content, _join_path(self.path, key))

    def text(self, key: str) -> str:
        """Return a required string."""
        return self.field(key).as_text()

    def optional_text(self, key: str) -> str:
        """Return an optional string; empty if absent."""
        value = self.optional(key)
        return "" if value is None else value.as_text()

    def number(self, key: str) -> float:
        """Return a required finite number."""
        return self.field(key).as_number()

    def optional_number(self, key: str) -> float | None:
        """Return an optional finite number; None if it is absent or null."""
        value = self.optional(key)
        return None if value is None else value.as_number()

    def optional_interval(self, key: str) -> Interval | None:
        """Return the two bounds of an optional interval, the smaller first; None if it is absent or null."""
        value = self.optional(key)
        if value is None:
            return None
        bounds = [item.as_number() for item in value.items()]
        if len(bounds) != 2 or bounds[0] > bounds[1]:
            value.reject("two numbers, the smaller first, or null")
        return bounds[0], bounds[1]

    def flag(self, key: str) -> bool:
        """Return an optional truth value; false if absent."""
        value = self.optional(key)
        if value is None:
            return False
        if not isinstance(value.content, bool):
            value.reject("true or false")
        return value.content

    def choice(self, key: str, allowed: Sequence[str]) -> str:
        """Return a required string that is one of `allowed`."""
        value = self.field(key)
        if value.content not in allowed:
            value.reject(f"one of {', '.join(allowed)}")
        return value.as_text()

    def optional_list(self, key: str) -> list[ReportValue]:
        """Return the elements of an optional list; an empty list if absent."""
        value = self.optional(key)
        return [] if value is None else value.items()

    def texts(self, key: str) -> list[str]:
        """Return an optional list of strings; empty if absent."""
        return [item.as_text() for item in self.optional_list(key)]

    def integers(self, key: str, low: int, high: int) -> list[int]:
        """Return a required list of integers from `low` to `high`."""
        return [item.as_integer(low, high) for item in self.field(key).items()]

    def numbers(self, key: str, count: int) -> list[float]:
        """Return a required list of `count` numbers; null becomes NaN (no data)."""
        value = self.field(key)
        items = value.items()
        if len(items) != count:
            raise GapInputError(f"report: {value.path}", f"{count} numbers", str(len(items)), REMEDY)
        return [math.nan if item.content is None else item.as_number() for item in items]


def _join_path(path: str, key: str) -> str:
    """Return the path of a field: the path of its table and the key. An unusual or long key is quoted."""
    name = key if key.isidentifier() and len(key) <= 60 else format_value(key)
    return f"{path}.{name}" if path else name
