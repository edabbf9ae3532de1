"""The error of a TOML or JSON text that cannot be parsed."""

from typing import Final

_LONGEST_VALUE: Final = 80
"""Largest number of characters of the file that an error message repeats."""


class TextError(ValueError):
    """A text is not valid, or exceeds a limit. The reader of the file adds the name of the file.

    position: "file", or the line, such as "line 3". expected, found: texts for one line of an error message.
    """

    def __init__(self, position: str, expected: str, found: str) -> None:
        """Create the error of an invalid text.

        position: "file" or the line, such as "line 3". expected: what would be valid. found: what the text contains.
        """
        super().__init__(position, expected, found)
        self.position = position
        self.expected = expected
        self.found = found

    def __str__(self) -> str:
        return f"{self.position}: expected {self.expected}, found {self.found}"


def decode_utf8(data: bytes) -> str:
    """Decode UTF-8 bytes. Raises TextError, which names the line, for other bytes."""
    try:
        return data.decode("utf-8")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise TextError(f"line {line}", "UTF-8 text", f"byte 0x{data[error.start]:02X}") from None


def format_reason(reason: object) -> str:
    """Return the first line of a parser's message, printable and shortened, for one line of an error message."""
    line = (str(reason).splitlines() or [""])[0]
    printable = "".join(letter if letter.isprintable() else "?" for letter in line)
    return printable if len(printable) <= _LONGEST_VALUE else printable[:_LONGEST_VALUE] + "..."
