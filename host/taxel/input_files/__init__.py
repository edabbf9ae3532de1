"""Files of unknown origin, opened and parsed with limits on size, nesting and number of values."""

from taxel.input_files.json_text import parse_json
from taxel.input_files.regular_file import (
    InputFileError,
    check_regular_file,
    is_regular_file,
    open_regular_file,
    read_regular_file,
)
from taxel.input_files.text_error import TextError
from taxel.input_files.toml_text import parse_toml

__all__ = [
    "InputFileError",
    "TextError",
    "check_regular_file",
    "is_regular_file",
    "open_regular_file",
    "parse_json",
    "parse_toml",
    "read_regular_file",
]
