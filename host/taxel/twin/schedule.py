"""Announced contacts: when a contact begins and ends, and which condition it repeats."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from os import PathLike, fspath
from typing import Final

from taxel.hand.errors import format_path, format_value
from taxel.input_files import TextError
from taxel.input_files.csv_rows import parse_float, read_csv_table
from taxel.recording.grasp_format import Phase
from taxel.twin.errors import TwinInputError

Condition = tuple[str, str]
"""Names of object and approach, as in a grasp dataset."""

TIME_COLUMNS: Final = ("closing_s", "hold_s", "release_s", "recovery_s", "end_s")
COLUMNS: Final = (*TIME_COLUMNS, "object", "approach")

MAX_ROWS: Final = 1_000_000
"""Largest number of contacts of a file: 4 contacts a second for three days."""


@dataclass(frozen=True, order=True)
class Contact:
    """One announced contact.

    times_s: start of closing, hold, release and recovery, and end of the recovery, seconds on the clock of the stream,
    not decreasing. condition: object and approach.
    """

    times_s: tuple[float, float, float, float, float]
    condition: Condition

    @property
    def start_s(self) -> float:
        """Start of the closing phase, seconds."""
        return self.times_s[0]

    @property
    def end_s(self) -> float:
        """End of the recovery phase, seconds."""
        return self.times_s[-1]

    def find_phase(self, time_s: float) -> Phase:
        """Return the phase at a time; before the contact and after its end: the baseline phase."""
        if not self.start_s <= time_s < self.end_s:
            return Phase.BASELINE
        # The number of phases that have started is the number of the present phase: closing is 1, recovery is 4.
        return Phase(bisect_right(self.times_s, time_s))


class ContactSchedule:
    """Announced contacts in order of time; a further contact may be announced until it begins.

    The constructor and `announce` raise TwinInputError for contacts that overlap.
    """

    def __init__(self, contacts: Iterable[Contact] = (), name: str = "contacts") -> None:
        """Create a schedule. name: name of the source in error messages."""
        self.name = name
        self._contacts: list[Contact] = []
        for contact in sorted(contacts):
            self.announce(contact)

    def announce(self, contact: Contact) -> None:
        """Append a contact. Raises TwinInputError if it begins before the end of the last contact."""
        if self._contacts and contact.start_s < self._contacts[-1].end_s:
            raise TwinInputError(
                f"{self.name}: contact at {contact.start_s:g} s",
                f"a start at or after {self._contacts[-1].end_s:g} s, the end of the contact before",
                f"{contact.start_s:g} s",
                "correct the times or leave the contact out",
            )
        self._contacts.append(contact)

    def __len__(self) -> int:
        return len(self._contacts)

    def __iter__(self) -> Iterator[Contact]:
        return iter(self._contacts)

    def __getitem__(self, number: int) -> Contact:
        return self._contacts[number]


def read_schedule(path: str | PathLike[str]) -> ContactSchedule:
    """Read a CSV file of contacts with the columns of `COLUMNS`. Raises TwinInputError with file and line."""
    name = format_path(fspath(path))
    try:
        rows = read_csv_table(path, COLUMNS, MAX_ROWS)
        return ContactSchedule((_parse_row(row, f"{name}: line {number}") for number, row in rows), name)
    except OSError as error:
        raise TwinInputError(name, "a CSV file of contacts", error.strerror or "an error", "correct the path") from None
    except TextError as error:
        raise TwinInputError(f"{name}: {error.position}", error.expected, error.found, "correct the line") from None


def _parse_row(row: list[str], place: str) -> Contact:
    """Parse the entries of one row in the order of `COLUMNS`.

    place: file and line in messages. Raises TwinInputError for an invalid value.
    """
    times = []
    for column, text in zip(TIME_COLUMNS, row[: len(TIME_COLUMNS)], strict=True):
        try:
            times.append(parse_float(text))
        except ValueError:
            times.append(math.nan)
        if not math.isfinite(times[-1]):
            raise TwinInputError(f"{place}: {column}", "seconds", format_value(text), "correct the value")
    if sorted(times) != times or times[0] == times[-1]:
        found = " ".join(f"{time:g}" for time in times)
        raise TwinInputError(place, f"increasing times {', '.join(TIME_COLUMNS)}", found, "correct the times")
    for column, text in zip(COLUMNS[len(TIME_COLUMNS) :], row[len(TIME_COLUMNS) :], strict=True):
        if not text or not text.isprintable() or text != text.strip():
            raise TwinInputError(
                f"{place}: {column}", "a name without surrounding spaces", format_value(text), "correct the name"
            )
    first, second, third, fourth, last = times
    return Contact((first, second, third, fourth, last), (row[-2], row[-1]))
