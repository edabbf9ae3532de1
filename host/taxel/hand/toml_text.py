"""Parser of untrusted TOML files with limits on size and line length."""

import os
import re
import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from taxel.hand.errors import Field, HandDescriptionError, format_path, format_value

MAX_FILE_BYTES = 1 << 20
"""Largest file size, bytes."""
MAX_LINE_BYTES = 200
"""Largest line length, bytes: memory of tomllib grows with the square of the parts of a dotted key."""

_TOML_POSITION = re.compile(r"^(.*?) \(at (.*)\)$", re.DOTALL)


def parse_toml(data: bytes, file: str) -> dict[str, Any]:
    """Parse a TOML file.

    Args:
        data: content of the file, at most 1 MiB of UTF-8 in lines of at most 200 bytes.
        file: file name, for errors.

    Raises:
        HandDescriptionError: too large, not UTF-8, or not TOML; its field is the line and column.
    """
    _check_size(data, file)
    try:
        return tomllib.loads(data.decode("utf-8"))
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        Field(file, f"line {line}").fail("UTF-8 text", f"byte 0x{data[error.start]:02X}", "save the file as UTF-8")
    except RecursionError:
        Field(file).fail("a few nested lists", "hundreds of nested lists", "use a hand description")
    except ValueError as error:
        # TOMLDecodeError, or a ValueError of Python for a number or a date.
        match = _TOML_POSITION.match(str(error))
        message, position = (match[1], match[2]) if match else (str(error), "file")
        raise HandDescriptionError(
            file, position, "valid TOML", format_value(message), "correct the syntax there"
        ) from None


def read_description(name_or_path: str | os.PathLike[str], kind: str, packaged: Sequence[str]) -> bytes:
    """Read a description file, at most one byte more than `MAX_FILE_BYTES`.

    Args:
        name_or_path: path of the file, or a mistyped packaged name.
        kind: "hand" or "robot", for errors.
        packaged: packaged names, for errors.

    Raises:
        HandDescriptionError: missing file, not a regular file, or not readable.
    """
    path, names = Path(name_or_path), ", ".join(packaged)
    field = Field(format_path(os.fspath(name_or_path)))
    try:
        if not path.exists():
            field.fail(f"a description file or a packaged {kind}", "no such file", f"the packaged {kind}s are {names}")
        if not path.is_file():  # reading a pipe or a device might never end
            field.fail("a regular file", "another file type", f"name a TOML file or a packaged {kind} ({names})")
        with path.open("rb") as stream:
            return stream.read(MAX_FILE_BYTES + 1)
    except OSError as error:
        field.fail("a readable file", error.strerror or type(error).__name__, "check the permissions and the name")


def _check_size(data: bytes, file: str) -> None:
    """Raise an error for a file or a line that is too long for a hand description."""
    if len(data) > MAX_FILE_BYTES:
        Field(file).fail(
            f"at most {MAX_FILE_BYTES} bytes", f"more than {MAX_FILE_BYTES} bytes", "use a hand description"
        )
    for number, line in enumerate(data.split(b"\n"), start=1):
        if len(line) > MAX_LINE_BYTES:
            Field(file, f"line {number}").fail(f"at most {MAX_LINE_BYTES} bytes", str(len(line)), "break the line")
