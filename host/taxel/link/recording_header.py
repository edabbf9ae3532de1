"""Check of the header of a recording: a JSON object in a capture, an MCAP or Parquet file, or a folder of CSV files.

Readers ignore unknown fields. The known fields have a fixed type, so that the code that uses them needs no check.
"""

import math
from typing import Any, Final

from taxel.input_files import TextError

_TEXTS: Final = ("url", "hand", "hand_description", "taxel_version", "created")
_CLOCKS: Final = ("host", "hub")
_TIME_NS_MAX: Final = 2**63
"""Limit of a time in a recording, nanoseconds: 292 years."""
_JOINTS_MAX: Final = 1000
"""Largest number of joint angles in a header; a hand with an arm has about 30."""


def check_recording_header(header: Any) -> dict[str, Any]:
    """Return the header unchanged. Raises TextError, which names the first field with a value of another type.

    Fields: `baud`, a number; `clock`, "host" or "hub"; `epoch_offset_ns`, an integer; `joint_position`, numbers,
    radians; `url`, `hand`, `hand_description`, `taxel_version` and `created`, texts. Every field is optional.
    """
    if not isinstance(header, dict):
        raise TextError("header", "a JSON object", _describe(header))
    for name in _TEXTS:
        if name in header and not isinstance(header[name], str):
            raise TextError(name, "a string", _describe(header[name]))
    if "clock" in header and header["clock"] not in _CLOCKS:
        raise TextError("clock", " or ".join(map(repr, _CLOCKS)), _describe(header["clock"]))
    if "baud" in header and not _is_number(header["baud"]):
        raise TextError("baud", "a number", _describe(header["baud"]))
    offset = header.get("epoch_offset_ns", 0)
    if isinstance(offset, bool) or not isinstance(offset, int) or abs(offset) >= _TIME_NS_MAX:
        raise TextError("epoch_offset_ns", "an integer of 64 bits", _describe(offset))
    angles = header.get("joint_position", [])
    if not isinstance(angles, list) or len(angles) > _JOINTS_MAX or not all(map(_is_number, angles)):
        raise TextError("joint_position", f"a list of at most {_JOINTS_MAX} numbers", _describe(angles))
    return header


def _is_number(value: Any) -> bool:
    """Whether a value of JSON is a finite number with an absolute value below 1e300; True and False are no numbers.

    The limit also excludes integers that do not fit into a float.
    """
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    return abs(value) < 1e300 and math.isfinite(value)


def _describe(value: Any) -> str:
    """Format a JSON value for an error message: at most 40 characters, or "a list" or "a dict"."""
    text = ascii(value) if not isinstance(value, list | dict) else f"a {type(value).__name__}"
    return text if len(text) <= 40 else text[:40] + "..."
