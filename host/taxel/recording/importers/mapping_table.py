"""A table of a mapping file with checks of its keys: each error names the file and the key."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, TypeVar, cast

import numpy as np

from taxel.hand.errors import format_value
from taxel.recording.grasp_checks import Location
from taxel.recording.importers.fields import suggest_names

T = TypeVar("T")

_TYPE_NAMES = {
    str: "a string",
    int: "an integer",
    float: "a number",
    bool: "true or false",
    list: "a list",
    dict: "a table",
}


class MappingTable:
    """A TOML table whose keys are taken one by one; `finish` refuses the keys that were not taken."""

    def __init__(self, values: Mapping[str, Any], location: Location) -> None:
        """Wrap a TOML table. location: place of the table in the mapping file."""
        self._values = dict(values)
        self._known: list[str] = []
        self.location = location

    def take(self, name: str, kind: type[T], default: T | None = None) -> T | None:
        """Remove a key and return its value; `default` if it is absent.

        kind: required type; an integer is accepted for float. Raises DatasetError for another type and a number that is
        not finite.
        """
        self._known.append(name)
        if name not in self._values:
            return default
        value = self._values.pop(name)
        # A larger integer, which float may not represent, is then refused as another type.
        if kind is float and type(value) is int and abs(value) < 1e300:
            value = float(value)
        if type(value) is not kind:
            self.location.key(name).fail(_TYPE_NAMES[kind], format_value(value), "correct the value")
        if kind is float and not np.isfinite(cast("float", value)):
            self.location.key(name).fail("a finite number", format_value(value), "correct the value")
        return value

    def require(self, name: str, kind: type[T], remedy: str) -> T:
        """Remove a key and return its value. Raises DatasetError if it is absent or has another type."""
        value = self.take(name, kind)
        if value is None:
            self.location.key(name).fail(_TYPE_NAMES[kind], "nothing", remedy)
        return value

    def take_any(self, name: str) -> Any:
        """Remove a key and return its value of any type; None if it is absent."""
        self._known.append(name)
        return self._values.pop(name, None)

    def take_choice(self, name: str, choices: tuple[str, ...], default: str | None = None) -> str | None:
        """Remove a key and return its value, one of `choices`. Raises DatasetError for another value."""
        value = self.take(name, str, default)
        if value is not None and value not in choices:
            self.location.key(name).fail(f"one of {', '.join(choices)}", format_value(value), "correct the value")
        return value

    def take_names(self, name: str) -> tuple[str, ...] | None:
        """Remove a key and return its value, a list of strings; None if it is absent.

        Raises DatasetError for another type and an empty list.
        """
        value = self.take(name, list)
        if value is None:
            return None
        if not value or not all(isinstance(entry, str) for entry in value):
            self.location.key(name).fail("a list of names", format_value(value), "write the names in quotation marks")
        return tuple(value)

    def take_integers(self, name: str, least: int = 0, length: int | None = None) -> tuple[int, ...] | None:
        """Remove a key and return its value, a list of integers of at least `least`; None if it is absent.

        length: required number of integers; None: one or more. Raises DatasetError for another value.
        """
        value = self.take(name, list)
        if value is None:
            return None
        is_valid = all(type(entry) is int and entry >= least for entry in value)
        if not value or not is_valid or length not in (None, len(value)):
            count = "a list of" if length is None else f"{length}"
            self.location.key(name).fail(f"{count} integers of {least} or more", repr(value)[:60], "correct the list")
        return tuple(value)

    def finish(self) -> None:
        """Raise DatasetError for the first key that was not taken."""
        for name in self._values:
            self.location.key(name).fail("a known key", "an unknown one", suggest_names(name, self._known))
