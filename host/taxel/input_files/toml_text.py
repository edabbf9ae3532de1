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
    """Raise TextError for integers of more than 64 bits, which TOML does not have, and for tables and lists that are
    nested too deeply for functions that call themselves.
    """
    level: list[Any] = [document]
    for _ in range(DEPTH_MAX):
        values = [value for each in level for value in (each.values() if isinstance(each, dict) else each)]
        if any(map(_is_large, values)):
            position, size = _find_large(document, "") or ("file", 64)
            raise TextError(position, "an integer of 64 bits", f"an integer of {size} bits")
        level = [value for value in values if isinstance(value, dict | list)]
        if not level:
            return
    raise TextError("file", f"at most {DEPTH_MAX} nested tables and lists", "more")


def _is_large(value: Any) -> bool:
    """Whether a value is an integer of more than 64 bits."""
    return type(value) is int and not -INTEGER_LIMIT <= value < INTEGER_LIMIT


def _find_large(value: Any, path: str) -> tuple[str, int] | None:
    """Return the path and the number of bits of the first integer of more than 64 bits. path: of the value."""
    if isinstance(value, dict):
        members = [(f"{path}.{key}" if path else str(key), each) for key, each in value.items()]
    elif isinstance(value, list):
        members = [(f"{path}[{index}]", each) for index, each in enumerate(value)]
    else:
        return (format_reason(path), value.bit_length()) if _is_large(value) else None
    found = (_find_large(each, own) for own, each in members)
    return next((each for each in found if each is not None), None)
