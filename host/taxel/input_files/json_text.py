"""Parser of JSON texts of unknown origin, with limits on size and number of values."""

import json
import math
import re
from collections import Counter
from typing import Any, Final, NoReturn

import numpy as np

from taxel.input_files.text_error import TextError, decode_utf8, format_reason

JSON_BYTES_MAX: Final = 1 << 26
"""Largest JSON file, bytes: 64 MiB. A test result with a hundred pictures has 25 MB, the report of the largest hand
4 MB. The decoded text may take four times this size.
"""

JSON_VALUES_MAX: Final = 1 << 22
"""Largest number of commas, opening brackets and braces, each of which may add a value. A value takes at most about
200 bytes of memory, so that a file at this limit takes less than 1 GB.
"""


DEPTH_MAX: Final = 100
"""Largest number of nested lists and objects; a gap report has 7. Functions that call themselves for each level of the
data need a few calls for each level, and Python permits 1000.
"""

_DIGITS_MAX: Final = 21
"""Largest number of characters of an integer: sign and the digits of an integer of 64 bits."""

_BITS_MAX: Final = 64
"""Largest number of bits of an integer without its sign: the widest integer type of the fields of a file."""

_OPENING: Final = np.frombuffer(b"[{", np.uint8)
_CLOSING: Final = np.frombuffer(b"]}", np.uint8)
_SURROGATE: Final = re.compile(rb"\\u[dD][89a-fA-F]")
_STRING: Final = re.compile(rb'"(?:[^"\\]|\\.)*"', re.DOTALL)


def parse_json(
    data: bytes,
    size_max: int = JSON_BYTES_MAX,
    values_max: int = JSON_VALUES_MAX,
    permits_surrogates: bool = False,
) -> Any:
    """Parse the bytes of a JSON file of at most `size_max` bytes.

    permits_surrogates: whether texts may contain half of a character (a lone surrogate), which cannot be encoded again.

    Raises TextError for a text that is too large, not UTF-8, nested too deeply or not JSON; for NaN, Infinity and
    numbers beyond the range of a float, which RFC 8259 does not permit; for integers of more than 64 bits; and for a
    key that an object contains twice.
    """
    if len(data) > size_max:
        raise TextError("file", f"at most {size_max} bytes", f"more than {size_max} bytes")
    # Each comma and opening bracket may add a value; this count limits the memory before the text is parsed.
    if sum(data.count(mark) for mark in (b",", b"[", b"{")) > values_max:
        raise TextError("file", f"at most {values_max} values", "more")
    # Brackets inside strings do not nest. The strings are removed only if the count with strings exceeds the limit.
    if _compute_depth(data) > DEPTH_MAX and _compute_depth(_STRING.sub(b"", data)) > DEPTH_MAX:
        raise TextError("file", f"JSON of at most {DEPTH_MAX} levels", "more")
    try:
        document = json.loads(
            decode_utf8(data),
            parse_constant=_refuse,
            parse_float=_parse_float,
            parse_int=_parse_integer,
            object_pairs_hook=_make_object,
        )
    except json.JSONDecodeError as error:
        position = f"line {error.lineno}"
        raise TextError(position, "valid JSON", f"{format_reason(error.msg)} in column {error.colno}") from None
    if not permits_surrogates and _SURROGATE.search(data):
        _check_surrogates(document)
    return document


def _check_surrogates(document: Any) -> None:
    """Raise TextError for a string with half of a character (a lone surrogate), which UTF-8 cannot represent."""
    try:
        json.dumps(document, ensure_ascii=False).encode("utf-8")
    except UnicodeEncodeError:
        raise TextError("file", "texts of whole characters", "half of a character, such as \\ud800") from None


def _compute_depth(data: bytes) -> int:
    """Return the largest number of nested brackets and braces; those inside strings are counted as well."""
    codes = np.frombuffer(data, np.uint8)
    steps = np.isin(codes, _OPENING).astype(np.int8) - np.isin(codes, _CLOSING).astype(np.int8)
    return int(np.cumsum(steps, dtype=np.int32).max(initial=0))


def _refuse(constant: str) -> NoReturn:
    """Raise TextError for a constant such as NaN, which Python accepts although it is not part of JSON."""
    raise TextError("file", "JSON", f"{constant}, which JSON does not have")


def _parse_float(text: str) -> float:
    """Parse a number with a fraction or an exponent. Raises TextError for a number that has no finite float."""
    value = float(text)
    if math.isinf(value):
        raise TextError("file", "numbers of at most 1.8e308", format_reason(text))
    return value


def _parse_integer(text: str) -> int:
    """Parse an integer. Raises TextError for an integer of more than 64 bits."""
    # The length is checked first, because the conversion of a long text takes a time that grows with its square.
    if len(text) > _DIGITS_MAX or int(text).bit_length() > _BITS_MAX:
        raise TextError("file", f"integers of at most {_BITS_MAX} bits", f"an integer of {len(text)} characters")
    return int(text)


def _make_object(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """Return the members of a JSON object as a dict. Raises TextError for a key that occurs twice."""
    result = dict(pairs)
    if len(result) != len(pairs):
        name = Counter(key for key, _ in pairs).most_common(1)[0][0]
        raise TextError("file", "each key of an object once", f"{format_reason(repr(name))} twice")
    return result
