"""Parser of untrusted TOML files with limits on size and line length."""

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from taxel.hand.errors import Field, HandDescriptionError, format_path, format_value
from taxel.input_files import TextError, is_regular_file, read_regular_file
from taxel.input_files import parse_toml as parse_bounded_toml

MAX_FILE_BYTES = 1 << 20
"""Largest file size, bytes."""
MAX_LINE_BYTES = 200
"""Largest line length, bytes. A description is written by hand; a longer line is a sign of another kind of file."""


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
        return parse_bounded_toml(data, MAX_FILE_BYTES)
    except TextError as error:
        found = format_value(error.found)
        raise HandDescriptionError(file, error.position, error.expected, found, "correct the syntax there") from None


def read_description(name_or_path: str | os.PathLike[str], kind: str, packaged: Sequence[str]) -> bytes:
    """Read a description file of at most `MAX_FILE_BYTES`.

    Args:
        name_or_path: path of the file, or a mistyped packaged name.
        kind: "hand" or "robot", for errors.
        packaged: packaged names, for errors.

    Raises:
        HandDescriptionError: missing file, not a regular file, too large, or not readable.
    """
    path, names = Path(name_or_path), ", ".join(packaged)
    field = Field(format_path(os.fspath(name_or_path)))
    try:
        if not path.exists():
            field.fail(f"a description file or a packaged {kind}", "no such file", f"the packaged {kind}s are {names}")
        if not is_regular_file(path):
            field.fail("a regular file", "another file type", f"name a TOML file or a packaged {kind} ({names})")
        return read_regular_file(path, MAX_FILE_BYTES)
    except OSError as error:
        field.fail("a readable file", error.strerror or type(error).__name__, "check the permissions and the name")


def _check_size(data: bytes, file: str) -> None:
    """Raise HandDescriptionError for a file above `MAX_FILE_BYTES` or a line above `MAX_LINE_BYTES`."""
    if len(data) > MAX_FILE_BYTES:
        Field(file).fail(
            f"at most {MAX_FILE_BYTES} bytes", f"more than {MAX_FILE_BYTES} bytes", "use a hand description"
        )
    for number, line in enumerate(data.split(b"\n"), start=1):
        if len(line) > MAX_LINE_BYTES:
            Field(file, f"line {number}").fail(f"at most {MAX_LINE_BYTES} bytes", str(len(line)), "break the line")
