"""Checked access to the values of a result file: a value of the wrong type gives one error line with its position."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from typing import NoReturn

from taxel.hand.checks import suggest_name
from taxel.hand.errors import format_value
from taxel_tools.testing.errors import ResultFileError

REMEDY = "use the file as the test wrote it"

_NOT_FINITE = {"nan": math.nan, "inf": math.inf, "-inf": -math.inf}


def encode_number(value: float) -> float | dict[str, str]:
    """Encode a number for JSON, which has no infinite values and no NaN: these become a table such as
    `{"not_finite": "nan"}`.
    """
    return value if math.isfinite(value) else {"not_finite": str(value)}


@dataclass(frozen=True, slots=True)
class Field:
    """A value as `json.loads` returns it, and its position. Every method raises `ResultFileError`."""

    file: str
    content: object
    path: str = ""

    def fail(self, expected: str, remedy: str = REMEDY, found: str = "") -> NoReturn:
        """Raise `ResultFileError` for the position of this field in a result file."""
        raise ResultFileError(self.file, self.path or "file", expected, found or format_value(self.content), remedy)

    def table(self, keys: Collection[str]) -> dict[str, Field]:
        """Return the fields of a JSON object that must have exactly these keys. Raises `ResultFileError` otherwise."""
        fields = dict(self.entries())
        for key, field in fields.items():
            if key not in keys:
                field.fail("a known key", suggest_name(key, keys), "an unknown one")
        for key in keys:
            if key not in fields:
                Field(self.file, None, f"{self.path}.{key}" if self.path else key).fail("this key", found="nothing")
        return fields

    def entries(self) -> Iterator[tuple[str, Field]]:
        """Yield key and field of each entry of a JSON object with any keys.

        Raises `ResultFileError` for another value.
        """
        if not isinstance(self.content, dict):
            self.fail("a table")
        for key, content in self.content.items():
            name = key if key.isidentifier() and len(key) <= 60 else format_value(key)
            yield key, Field(self.file, content, f"{self.path}.{name}" if self.path else name)

    def items(self) -> list[Field]:
        """Return the elements of a JSON list as fields. Raises `ResultFileError` for another value."""
        if not isinstance(self.content, list):
            self.fail("a list")
        return [Field(self.file, item, f"{self.path}[{index}]") for index, item in enumerate(self.content)]

    def text(self) -> str:
        """Return the value of this field, which must be a string. Raises `ResultFileError` otherwise."""
        if not isinstance(self.content, str):
            self.fail("a string")
        return self.content

    def flag(self) -> bool:
        """Return the value of this field, which must be true or false. Raises `ResultFileError` otherwise."""
        if not isinstance(self.content, bool):
            self.fail("true or false")
        return self.content

    def number(self) -> float:
        """Return the value of this field, a number that is finite or encoded by `encode_number`.

        Raises `ResultFileError` otherwise.
        """
        content = self.content
        if isinstance(content, dict) and list(content) == ["not_finite"]:
            name = content["not_finite"]
            if not isinstance(name, str) or name not in _NOT_FINITE:
                self.fail(f"not_finite to be one of {', '.join(_NOT_FINITE)}")
            return _NOT_FINITE[name]
        # An integer of many digits would overflow, and 1e999 is parsed as infinite: every float is below 2**1024.
        if isinstance(content, bool) or not isinstance(content, int | float) or not abs(content) < 2**1023 * 2:
            self.fail("a finite number")
        return float(content)

    def finite(self, minimum: float = -math.inf) -> float:
        """Return the value of this field, a finite number of at least `minimum`. Raises `ResultFileError` otherwise."""
        number = self.number()
        if not math.isfinite(number) or number < minimum:
            self.fail("a finite number" if math.isinf(minimum) else f"a number of at least {minimum:g}")
        return number
