"""A phase's own keys of a plan: each taken by name, and what nobody took is refused."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from typing import Any, NoReturn

from taxel.hand.checks import suggest_name
from taxel.hand.errors import format_value
from taxel_tools.errors import PlanError


class Options:
    """What a plan says for one phase.

    values: keys as TOML gives them. source: the plan's file; places: where in it each key stands; both for errors.
    Every `take_...` raises `PlanError` that names the key where the value is of another type or out of range.
    """

    def __init__(
        self, values: Mapping[str, Any], source: str = "options", places: Mapping[str, str] | None = None
    ) -> None:
        self._values = dict(values)
        self._source = source
        self._places = places or {}
        self._taken: set[str] = set()

    def take_number(self, key: str, default: float, minimum: float = -math.inf, maximum: float = math.inf) -> float:
        """A finite number from `minimum` to `maximum`, both included."""
        value = self._take(key, default)
        if not (is_number(value) and minimum <= value <= maximum):
            self._fail(key, f"a number{_range(minimum, maximum)}", value)
        return float(value)

    def take_whole(self, key: str, default: int, minimum: float = -math.inf, maximum: float = math.inf) -> int:
        """A whole number from `minimum` to `maximum`, both included."""
        value = self._take(key, default)
        if isinstance(value, bool) or not isinstance(value, int) or not minimum <= value <= maximum:
            self._fail(key, f"a whole number{_range(minimum, maximum)}", value)
        return value

    def take_flag(self, key: str, default: bool) -> bool:
        """True or false."""
        value = self._take(key, default)
        if not isinstance(value, bool):
            self._fail(key, "true or false", value)
        return value

    def take_text(self, key: str, default: str, choices: Collection[str] | None = None) -> str:
        """Text; one of `choices` if given."""
        value = self._take(key, default)
        if not isinstance(value, str) or (choices is not None and value not in choices):
            self._fail(key, "text" if choices is None else f"one of {', '.join(sorted(choices))}", value)
        return value

    def done(self) -> None:
        """Call after the last `take_...`, before anything is measured. Raises `PlanError` for a key left over."""
        for key in self._values:
            if key not in self._taken:
                known = suggest_name(key, self._taken) if self._taken else "this phase has no options; take it out"
                raise PlanError(self._source, self._place(key), "an option of this phase", "an unknown key", known)

    def _take(self, key: str, default: Any) -> Any:
        self._taken.add(key)
        return self._values.get(key, default)

    def _place(self, key: str) -> str:
        return self._places.get(key, key)

    def _fail(self, key: str, expected: str, value: object) -> NoReturn:
        raise PlanError(self._source, self._place(key), expected, format_value(value), "correct it, or leave it out")


def is_number(value: object) -> bool:
    """Whether a value of a file is a finite number; true and false are none, nor is an integer that no float holds."""
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < 1e300


def _range(minimum: float, maximum: float) -> str:
    if math.isinf(minimum) and math.isinf(maximum):
        return ""
    if math.isinf(maximum):
        return f" of at least {minimum:g}"
    return f" of at most {maximum:g}" if math.isinf(minimum) else f" from {minimum:g} to {maximum:g}"
