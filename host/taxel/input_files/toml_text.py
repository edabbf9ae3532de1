"""Parser of TOML texts of unknown origin, with limits on size and nesting."""

import re
import tomllib
from typing import Any, Final

from taxel.input_files.text_error import TextError, decode_utf8, format_reason

TOML_BYTES_MAX: Final = 1 << 20
"""Largest TOML file, bytes. The largest packaged description has 100 kB."""

KEY_PARTS_MAX: Final = 32
"""Largest number of parts of a dotted key; the deepest key of the project's formats has 6. The time and the memory of
tomllib grow with the square of this number.
"""

DEPTH_MAX: Final = 64
"""Largest number of nested tables and lists."""

INTEGER_LIMIT: Final = 2**63
"""Limit of an integer (toml.io/en/v1.0.0, Integer). Python fails to print an integer of thousands of digits, and to
convert one of hundreds of digits to a float.
"""

_DEEP_KEY: Final = re.compile(rb"(?:\.[ \t]*[\w\"'-][^.,=\n\[\]]*){%d}" % KEY_PARTS_MAX)
_POSITION: Final = re.compile(r"^(.*?) \(at (.*)\)$", re.DOTALL)


def parse_toml(data: bytes, size_max: int = TOML_BYTES_MAX) -> dict[str, Any]:
    """Parse the bytes of a TOML file of at most `size_max` bytes.

    Raises TextError for a text that is too large, not UTF-8, nested too deeply, or not TOML.
    """
    if len(data) > size_max:
        raise TextError("file", f"at most {size_max} bytes", f"more than {size_max} bytes")
    text = decode_utf8(data)
    deep = _DEEP_KEY.search(data)
    if deep is not None:
        line = data.count(b"\n", 0, deep.start()) + 1
        raise TextError(f"line {line}", f"keys of at most {KEY_PARTS_MAX} parts", "a longer dotted key")
    try:
        document = tomllib.loads(text)
    except RecursionError:
        raise TextError("file", "a few nested lists", "hundreds of nested lists") from None
    except ValueError as error:
        # TOMLDecodeError, or a ValueError of Python for a number or a date.
        match = _POSITION.match(str(error))
        message, position = (match[1], match[2]) if match else (str(error), "file")
        raise TextError(position, "valid TOML", format_reason(message)) from None
    _check_values(document)
    return document


def _check_values(document: dict[str, Any]) -> None:
    """Raise TextError for integers of more than 64 bits, and for tables and lists nested more than `DEPTH_MAX` deep.

    TOML has no larger integers, and deeper nesting would exceed the recursion limit of later functions.
    """
    containers: list[Any] = [document]
    for _ in range(DEPTH_MAX):
        values = [
            value
            for container in containers
            for value in (container.values() if isinstance(container, dict) else container)
        ]
        if any(map(_is_large, values)):
            position, size = _find_large_integer(document, "") or ("file", 64)
            raise TextError(position, "an integer of 64 bits", f"an integer of {size} bits")
        containers = [value for value in values if isinstance(value, dict | list)]
        if not containers:
            return
    raise TextError("file", f"at most {DEPTH_MAX} nested tables and lists", "more")


def _is_large(value: Any) -> bool:
    """Whether a value is an integer of more than 64 bits."""
    return type(value) is int and not -INTEGER_LIMIT <= value < INTEGER_LIMIT


def _find_large_integer(value: Any, path: str) -> tuple[str, int] | None:
    """Find the first integer of more than 64 bits in a value; return (its path, number of bits), None without one.

    path: path of `value` in the document, such as "boards[0].address".
    """
    if isinstance(value, dict):
        members = [(f"{path}.{key}" if path else str(key), member) for key, member in value.items()]
    elif isinstance(value, list):
        members = [(f"{path}[{index}]", member) for index, member in enumerate(value)]
    else:
        return (format_reason(path), value.bit_length()) if _is_large(value) else None
    found = (_find_large_integer(member, member_path) for member_path, member in members)
    return next((result for result in found if result is not None), None)
