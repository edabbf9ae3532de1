"""Options of a phase in a plan: each is read by name, and keys that the phase does not read are refused."""

import math
from collections.abc import Collection, Mapping
from typing import Any, NoReturn

from taxel.hand.checks import suggest_name
from taxel.hand.errors import format_value
from taxel_tools.errors import PlanError


class Options:
    """Options of one phase.

    `values`: keys and values as TOML returns them. `source`: file of the plan, and `locations`: position of each key in
    the file, both for error messages. Every `take_...` method raises `PlanError` that names the key for a value of the
    wrong type or out of range.
    """

    def __init__(
        self, values: Mapping[str, Any], source: str = "options", locations: Mapping[str, str] | None = None
    ) -> None:
        """Create the options of a test phase, which are checked when they are taken.

        values: by name. source: file for error messages. locations: position of each option in the file.
        """
        self._values = dict(values)
        self._source = source
        self._locations = locations or {}
        self._read_keys: set[str] = set()

    def take_number(self, key: str, default: float, minimum: float = -math.inf, maximum: float = math.inf) -> float:
        """Take the value of an option: a finite number from `minimum` to `maximum`, both included.

        Raises `PlanError` otherwise.
        """
        value = self._take(key, default)
        if not (is_number(value) and minimum <= value <= maximum):
            self._fail(key, f"a number{_format_range(minimum, maximum)}", value)
        return float(value)

    def take_integer(self, key: str, default: int, minimum: float = -math.inf, maximum: float = math.inf) -> int:
        """Take the value of an option: an integer from `minimum` to `maximum`, both included.

        Raises `PlanError` otherwise.
        """
        value = self._take(key, default)
        if isinstance(value, bool) or not isinstance(value, int) or not minimum <= value <= maximum:
            self._fail(key, f"an integer{_format_range(minimum, maximum)}", value)
        return value

    def take_flag(self, key: str, default: bool) -> bool:
        """Take the value of an option: true or false. Raises `PlanError` otherwise."""
        value = self._take(key, default)
        if not isinstance(value, bool):
            self._fail(key, "true or false", value)
        return value

    def take_text(self, key: str, default: str, choices: Collection[str] | None = None) -> str:
        """Take the value of an option: a text, one of `choices` if given. Raises `PlanError` otherwise."""
        value = self._take(key, default)
        if not isinstance(value, str) or (choices is not None and value not in choices):
            self._fail(key, "text" if choices is None else f"one of {', '.join(sorted(choices))}", value)
        return value

    def refuse_unknown_keys(self) -> None:
        """Raise `PlanError` for an option that the phase does not have.

        To be called after the last `take_...`, before any measurement.
        """
        for key in self._values:
            if key not in self._read_keys:
                remedy = "this phase has no options; remove the key"
                if self._read_keys:
                    remedy = suggest_name(key, self._read_keys)
                raise PlanError(
                    self._source, self._get_location(key), "an option of this phase", "an unknown key", remedy
                )

    def _take(self, key: str, default: Any) -> Any:
        """Return the value of an option, or the default, and record that the phase has read the option."""
        self._read_keys.add(key)
        return self._values.get(key, default)

    def _get_location(self, key: str) -> str:
        """Return the position of an option in the plan, for error messages; its key if the position is unknown."""
        return self._locations.get(key, key)

    def _fail(self, key: str, expected: str, value: object) -> NoReturn:
        """Raise `PlanError` for an option whose value is not as expected."""
        raise PlanError(
            self._source, self._get_location(key), expected, format_value(value), "correct or remove the value"
        )


def is_number(value: object) -> bool:
    """Return whether a value of a file is a number of a size below 1e300 and not a boolean.

    The bound excludes infinite values, NaN, and integers beyond the range of a float.
    """
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < 1e300


def _format_range(minimum: float, maximum: float) -> str:
    """Format the text for a permitted range, such as " from 1 to 5"; empty if both bounds are infinite."""
    if math.isinf(minimum) and math.isinf(maximum):
        return ""
    if math.isinf(maximum):
        return f" of at least {minimum:g}"
    return f" of at most {maximum:g}" if math.isinf(minimum) else f" from {minimum:g} to {maximum:g}"
