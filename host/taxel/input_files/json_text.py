"""Parser of JSON texts of unknown origin, with limits on size and number of values."""

import json
import math
from collections import Counter
from typing import Any, Final, NoReturn

from taxel.input_files.text_error import TextError, decode_utf8, format_reason

JSON_BYTES_MAX: Final = 1 << 26
"""Largest JSON file, bytes: 64 MiB. A test result with a hundred pictures has 25 MB, the report of the largest hand
4 MB. The decoded text may take four times this size.
"""

JSON_VALUES_MAX: Final = 1 << 22
"""Largest number of commas, opening brackets and braces, each of which may add a value. A value takes at most about
200 bytes of memory, so that a file at this limit takes less than 1 GB.
"""


def parse_json(data: bytes, size_max: int = JSON_BYTES_MAX, values_max: int = JSON_VALUES_MAX) -> Any:
    """Parse the bytes of a JSON file of at most `size_max` bytes.

    Raises TextError for a text that is too large, not UTF-8, nested too deeply or not JSON; for NaN, Infinity and
    numbers beyond the range of a float, which RFC 8259 does not permit; and for a key that an object contains twice.
    """
    if len(data) > size_max:
        raise TextError("file", f"at most {size_max} bytes", f"more than {size_max} bytes")
    if sum(data.count(mark) for mark in (b",", b"[", b"{")) > values_max:
        raise TextError("file", f"at most {values_max} values", "more")
    try:
        return json.loads(
            decode_utf8(data), parse_constant=_refuse, parse_float=_parse_float, object_pairs_hook=_make_object
        )
    except RecursionError:
        raise TextError("file", "JSON of a few levels", "hundreds of levels") from None
    except json.JSONDecodeError as error:
        position = f"line {error.lineno}"
        raise TextError(position, "valid JSON", f"{format_reason(error.msg)} in column {error.colno}") from None
    except TextError:
        raise
    except ValueError:  # Python refuses an integer of thousands of digits.
        raise TextError("file", "JSON", "an integer of thousands of digits") from None


def _refuse(constant: str) -> NoReturn:
    """Refuse a constant such as NaN, which Python reads although JSON does not have it."""
    raise TextError("file", "JSON", f"{constant}, which JSON does not have")


def _parse_float(text: str) -> float:
    """Parse a number with a fraction or an exponent. Raises TextError for a number that has no finite float."""
    value = float(text)
    if math.isinf(value):
        raise TextError("file", "numbers of at most 1.8e308", format_reason(text))
    return value


def _make_object(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """Make the dict of a JSON object. Raises TextError for a repeated key, of which Python keeps only one value."""
    result = dict(pairs)
    if len(result) != len(pairs):
        name = Counter(key for key, _ in pairs).most_common(1)[0][0]
        raise TextError("file", "each key of an object once", f"{format_reason(repr(name))} twice")
    return result
