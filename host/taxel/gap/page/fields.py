"""A value of a report together with its place in it: what has the wrong type is refused with one clear line."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NoReturn

from taxel.gap.errors import GapInputError
from taxel.hand.errors import format_value

Interval = tuple[float, float]

REMEDY = "make the report again with taxel gap diagnose"


@dataclass(frozen=True)
class Value:
    """A value as `json.load` gives it, and the path that an error names.

    Every method raises GapInputError where the report says something else than it asks for. Those named `maybe_...`
    take an absent field, or null, as None.
    """

    content: object
    path: str = ""

    def fail(self, expected: str) -> NoReturn:
        """Raise GapInputError for this place."""
        raise GapInputError(f"report: {self.path or 'file'}", expected, format_value(self.content), REMEDY)

    # --- itself

    def table(self) -> dict[str, object]:
        """Its keys and their content."""
        if not isinstance(self.content, dict):
            self.fail("a table")
        return self.content

    def items(self) -> list[Value]:
        """The elements of a list."""
        if not isinstance(self.content, list):
            self.fail("a list")
        return [Value(item, f"{self.path}[{index}]") for index, item in enumerate(self.content)]

    def entries(self) -> Iterator[tuple[str, Value]]:
        """The keys of a table and their values."""
        for key, content in self.table().items():
            yield key, Value(content, _joined(self.path, key))

    def as_text(self) -> str:
        """A string."""
        if not isinstance(self.content, str):
            self.fail("a string")
        return self.content

    def as_number(self) -> float:
        """A finite number."""
        content = self.content
        if isinstance(content, bool) or not isinstance(content, int | float):
            self.fail("a number")
        # An integer of many digits would overflow.
        if not -1e300 < content < 1e300:
            self.fail("a finite number")
        return float(content)

    def as_integer(self, low: int, high: int) -> int:
        """An integer from `low` to `high`."""
        content = self.content
        if isinstance(content, bool) or not isinstance(content, int) or not low <= content <= high:
            self.fail(f"an integer from {low} to {high}")
        return content

    # --- fields of a table

    def field(self, key: str) -> Value:
        """A field that must be there; it may be null."""
        table = self.table()
        if key not in table:
            raise GapInputError(f"report: {_joined(self.path, key)}", "a field of that name", "none", REMEDY)
        return Value(table[key], _joined(self.path, key))

    def maybe(self, key: str) -> Value | None:
        """A field that may be absent or null."""
        content = self.table().get(key)
        return None if content is None else Value(content, _joined(self.path, key))

    def text(self, key: str) -> str:
        """A string that must be there."""
        return self.field(key).as_text()

    def maybe_text(self, key: str) -> str:
        """A string, empty if absent."""
        found = self.maybe(key)
        return "" if found is None else found.as_text()

    def number(self, key: str) -> float:
        """A finite number that must be there."""
        return self.field(key).as_number()

    def maybe_number(self, key: str) -> float | None:
        """A finite number."""
        found = self.maybe(key)
        return None if found is None else found.as_number()

    def maybe_interval(self, key: str) -> Interval | None:
        """The two bounds of an interval."""
        found = self.maybe(key)
        if found is None:
            return None
        bounds = [item.as_number() for item in found.items()]
        if len(bounds) != 2 or bounds[0] > bounds[1]:
            found.fail("two numbers, the lower first, or null")
        return bounds[0], bounds[1]

    def flag(self, key: str) -> bool:
        """True or false; false if absent."""
        found = self.maybe(key)
        if found is None:
            return False
        if not isinstance(found.content, bool):
            found.fail("true or false")
        return found.content

    def one_of(self, key: str, known: Sequence[str]) -> str:
        """One of the words that the format knows."""
        found = self.field(key)
        if found.content not in known:
            found.fail(f"one of {', '.join(known)}")
        return found.as_text()

    def maybe_list(self, key: str) -> list[Value]:
        """The elements of a list, none if it is absent."""
        found = self.maybe(key)
        return [] if found is None else found.items()

    def texts(self, key: str) -> list[str]:
        """A list of strings, empty if absent."""
        return [item.as_text() for item in self.maybe_list(key)]

    def integers(self, key: str, low: int, high: int) -> list[int]:
        """A list of integers that must be there, each from `low` to `high`."""
        return [item.as_integer(low, high) for item in self.field(key).items()]

    def numbers(self, key: str, count: int) -> list[float]:
        """A list of `count` numbers that must be there; null is read as NaN: nothing is known there."""
        found = self.field(key)
        items = found.items()
        if len(items) != count:
            raise GapInputError(f"report: {found.path}", f"{count} numbers", str(len(items)), REMEDY)
        return [math.nan if item.content is None else item.as_number() for item in items]


def _joined(path: str, key: str) -> str:
    name = key if key.isidentifier() and len(key) <= 60 else format_value(key)
    return f"{path}.{name}" if path else name
