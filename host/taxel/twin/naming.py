"""Naming of causes while a stream runs: in the background for a live stream, at fixed numbers of contacts otherwise."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from dataclasses import dataclass, field, replace
from multiprocessing import get_context
from pathlib import Path
from typing import Final

from taxel.errors import TaxelError
from taxel.recording.grasp_record import GraspRecord
from taxel.twin.causes import ReferenceFile, name_cause
from taxel.twin.events import Alarm, CauseEvent, Event, InputFault
from taxel.twin.schedule import Condition, Contact

NAMED_AFTER: Final = (3, 10, 30, 100, 300, 1000)
"""Contacts since the first alarm's onset after which a recording's cause is named: a factor of three apart, because a
naming takes seconds and a recording may contain thousands of contacts."""

MOST_CONTACTS: Final = 300
"""Contacts that a naming uses, the latest ones: the probabilities hardly change with more."""


@dataclass(eq=False)
class CauseNaming:
    """Collects contacts and names the cause of the active alarms.

    reference: the reference dataset. is_live: name the newest state whenever the last naming has ended.
    """

    reference: ReferenceFile
    is_live: bool = False
    counts: tuple[int, ...] = NAMED_AFTER
    show: Callable[[str], None] = lambda text: None
    _contacts: list[tuple[Contact, GraspRecord]] = field(default_factory=list)
    _alarms: list[Alarm] = field(default_factory=list)
    _named: int = 0
    _pool: ProcessPoolExecutor | None = None
    _pending: Future[CauseEvent] | None = None

    def set_alarms(self, alarms: Sequence[Alarm]) -> None:
        """Set the active alarms. Contacts from the earliest onset on are compared with the reference."""
        if not alarms:
            self._named = 0
        self._alarms = list(alarms)

    def add(self, contacts: Sequence[tuple[Contact, GraspRecord]]) -> list[Event]:
        """Add complete contacts; return the namings that have ended."""
        self._contacts += contacts
        del self._contacts[:-MOST_CONTACTS]
        events = self._collect()
        if not self._alarms:
            return events
        chosen = self._select()
        if self.is_live:
            if self._pending is None and contacts and chosen:
                self._pending = self._start(chosen)
            return events
        due = [count for count in self.counts if self._named < count <= len(chosen)]
        for count in due:
            events.append(self._name_now(chosen[:count]))
            self._named = count
        return events

    def finish(self) -> list[Event]:
        """Name the cause with all contacts since the onset, if alarms are active; end the background process."""
        events = self._collect(wait=True)
        if self._alarms and (chosen := self._select()) and len(chosen) != self._named:
            events.append(self._name_now(chosen))
        if self._pool is not None:
            self._pool.shutdown()
            self._pool = None
        return events

    def _select(self) -> list[GraspRecord]:
        """Records of the contacts since the earliest onset; the n-th contact of a condition belongs to session n."""
        onset = min(alarm.onset_s for alarm in self._alarms)
        numbers: dict[Condition, int] = {}
        found = []
        for contact, record in self._contacts:
            if contact.start_s >= onset:
                number = numbers[contact.condition] = numbers.get(contact.condition, -1) + 1
                found.append(replace(record, iteration=number, session=number))
        return found

    def _start(self, records: list[GraspRecord]) -> Future[CauseEvent]:
        """Start a naming in the background."""
        if self._pool is None:
            self._pool = ProcessPoolExecutor(1, get_context("spawn"))
        return self._pool.submit(_name, self.reference, records, self._contacts[-1][0].end_s, self._numbers())

    def _name_now(self, records: list[GraspRecord]) -> Event:
        """Name the cause of these contacts."""
        time_s = self._contacts[-1][0].end_s
        self.show(f"naming the cause of {len(records)} contacts")
        try:
            return _name(self.reference, records, time_s, self._numbers())
        except TaxelError as error:
            return InputFault(time_s, "cause", str(error))

    def _collect(self, wait: bool = False) -> list[Event]:
        """Return the event of a naming that has ended."""
        if self._pending is None or not (wait or self._pending.done()):
            return []
        pending, self._pending = self._pending, None
        try:
            return [pending.result()]
        except TaxelError as error:
            return [InputFault(self._contacts[-1][0].end_s, "cause", str(error))]

    def _numbers(self) -> tuple[int, ...]:
        return tuple(alarm.number for alarm in self._alarms)


def _name(
    reference: ReferenceFile, records: Sequence[GraspRecord], time_s: float, alarms: tuple[int, ...]
) -> CauseEvent:
    """Name a cause with a temporary dataset of the contacts."""
    with tempfile.TemporaryDirectory(prefix="taxel-twin-") as folder:
        return name_cause(reference, Path(folder) / "live.h5", records, time_s, alarms)
