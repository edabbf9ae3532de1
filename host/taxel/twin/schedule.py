"""Announced contacts: when a contact begins and ends, and which condition it repeats."""

from __future__ import annotations

import csv
import math
from bisect import bisect_right
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Final

from taxel.recording.grasp_format import Phase
from taxel.twin.errors import TwinInputError

Condition = tuple[str, str]
"""Names of object and approach, as in a grasp dataset."""

TIME_COLUMNS: Final = ("closing_s", "hold_s", "release_s", "recovery_s", "end_s")
COLUMNS: Final = (*TIME_COLUMNS, "object", "approach")

MAX_ROWS: Final = 1_000_000
"""Largest number of contacts of a file: 4 contacts a second for three days."""

MAX_BYTES: Final = 200_000_000


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
    name = str(path)
    if not Path(path).is_file():
        raise TwinInputError(name, "a CSV file of contacts", "no such file", "correct the name")
    if Path(path).stat().st_size > MAX_BYTES:
        raise TwinInputError(name, f"at most {MAX_BYTES} bytes", "a larger file", "divide the file")
    try:
        with Path(path).open(encoding="utf-8", newline="") as file:
            return ContactSchedule(_read_rows(csv.DictReader(file), name), name)
    except UnicodeDecodeError as error:
        raise TwinInputError(name, "UTF-8 text", f"byte {error.start}", "save the file as UTF-8") from None
    except csv.Error as error:
        raise TwinInputError(name, "CSV", str(error), "correct the file") from None


def _read_rows(rows: csv.DictReader[str], name: str) -> Iterator[Contact]:
    """Yield the contacts of a CSV file. name: path in messages. Raises TwinInputError with file and line."""
    missing = [column for column in COLUMNS if column not in (rows.fieldnames or ())]
    if missing:
        found = ", ".join(rows.fieldnames or ()) or "no header"
        raise TwinInputError(f"{name}: line 1", f"the columns {', '.join(COLUMNS)}", found, "add the header")
    for number, row in enumerate(rows):
        if number >= MAX_ROWS:
            raise TwinInputError(name, f"at most {MAX_ROWS} contacts", "more", "divide the file")
        yield _parse_row(row, f"{name}: line {rows.line_num}")


def _parse_row(row: dict[str, str | None], place: str) -> Contact:
    """Parse one row of a CSV file. place: file and line in messages. Raises TwinInputError for an invalid value."""
    times = []
    for column in TIME_COLUMNS:
        try:
            times.append(float(row[column] or ""))
        except ValueError:
            times.append(math.nan)
        if not math.isfinite(times[-1]):
            raise TwinInputError(f"{place}: {column}", "seconds", repr(row[column]), "correct the value")
    if sorted(times) != times or times[0] == times[-1]:
        found = " ".join(f"{time:g}" for time in times)
        raise TwinInputError(place, f"increasing times {', '.join(TIME_COLUMNS)}", found, "correct the times")
    names = (row["object"] or "", row["approach"] or "")
    if not all(names):
        raise TwinInputError(place, "an object and an approach", repr(names), "add both names")
    first, second, third, fourth, last = times
    return Contact((first, second, third, fourth, last), names)
