"""From the bytes of a file to a TOML table; the bytes are not trusted."""

from __future__ import annotations

import os
import re
import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from taxel.hand.errors import Field, HandDescriptionError, format_path, format_value

MAX_FILE_BYTES = 1 << 20  # 1 MiB; the 17 boards of allegro.toml take 6 kB
MAX_LINE_BYTES = 200  # a dotted key costs tomllib memory by the square of its parts: 1 MiB of one takes it all

_TOML_PLACE = re.compile(r"^(.*?) \(at (.*)\)$", re.DOTALL)


def parse_toml(data: bytes, file: str) -> dict[str, Any]:
    """Parse a TOML file.

    Args:
        data: its content, at most 1 MiB of UTF-8 in lines of at most 200 bytes.
        file: its name, for errors.

    Raises:
        HandDescriptionError: too large, not UTF-8, or not TOML; the field is the line and column.
    """
    _check_size(data, file)
    try:
        return tomllib.loads(data.decode("utf-8"))
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        Field(file, f"line {line}").fail("UTF-8 text", f"byte 0x{data[error.start]:02X}", "save the file as UTF-8")
    except RecursionError:
        Field(file).fail("a few levels of lists", "hundreds, nested", "is it a hand description?")
    except ValueError as error:
        # TOMLDecodeError, or Python's own refusal of a number or a date.
        match = _TOML_PLACE.match(str(error))
        message, place = (match[1], match[2]) if match else (str(error), "file")
        raise HandDescriptionError(
            file, place, "valid TOML", format_value(message), "correct the syntax there"
        ) from None


def read_description(name_or_path: str | os.PathLike[str], what: str, packaged: Sequence[str]) -> bytes:
    """The bytes of a file, at most one more than are allowed.

    Args:
        name_or_path: the file, which may be missing or mistyped.
        what: "hand" or "robot", for errors.
        packaged: the names that are no files, for errors.

    Raises:
        HandDescriptionError: no such file, no regular file, or not readable.
    """
    path, names = Path(name_or_path), ", ".join(packaged)
    whole = Field(format_path(os.fspath(name_or_path)))
    try:
        if not path.exists():
            whole.fail(f"a description file or a packaged {what}", "no such file", f"the packaged {what}s are {names}")
        if not path.is_file():  # a pipe or a device might never end
            whole.fail("a regular file", "something else", f"name a TOML file or a packaged {what} ({names})")
        with path.open("rb") as stream:
            return stream.read(MAX_FILE_BYTES + 1)
    except OSError as error:
        whole.fail("a readable file", error.strerror or type(error).__name__, "check its permissions and its name")


def _check_size(data: bytes, file: str) -> None:
    if len(data) > MAX_FILE_BYTES:
        Field(file).fail(f"at most {MAX_FILE_BYTES} bytes", "more", "is it a hand description?")
    for number, line in enumerate(data.split(b"\n"), start=1):
        if len(line) > MAX_LINE_BYTES:
            Field(file, f"line {number}").fail(f"at most {MAX_LINE_BYTES} bytes", str(len(line)), "break the line")
