"""Lines of text of the bring-up image: a name and fields, `bus idle=3 acks=0`."""

from dataclasses import dataclass
from typing import Final

PRINTABLE: Final = frozenset(range(0x20, 0x7F)) | {0x0D, 0x0A}
MAX_WRONG_SHARE: Final = 0.2
"""Share of bytes that are no text above which a transmission counts as unreadable (random bytes: 0.62)."""


@dataclass(frozen=True)
class Line:
    """One line of text.

    time_s: arrival of its end, by the clock of the port. words: words without "=". fields: values by name.
    """

    time_s: float
    name: str
    words: tuple[str, ...]
    fields: dict[str, str]

    def get(self, field: str, base: int = 10) -> int | None:
        """Return the number in a field of the line; None if the field is missing or damaged.

        base: base of its digits.
        """
        try:
            return int(self.fields[field], base)
        except (KeyError, ValueError):
            return None


def parse_line(text: str, time_s: float) -> Line | None:
    """Parse a line such as "NAME WORD FIELD=VALUE"; None for an empty line. time_s: arrival time of the line's end."""
    words = text.split()
    if not words:
        return None
    fields = dict(word.split("=", 1) for word in words[1:] if "=" in word)
    return Line(time_s, words[0], tuple(word for word in words[1:] if "=" not in word), fields)


def is_text(data: bytes) -> bool:
    """Return whether bytes can be text of the image; at most `MAX_WRONG_SHARE` of them may be wrong."""
    return sum(byte not in PRINTABLE for byte in data) <= MAX_WRONG_SHARE * len(data)
