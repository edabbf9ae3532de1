"""Naming of causes while a stream runs: in the background for a live stream, at fixed numbers of contacts otherwise."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass, field, replace
from multiprocessing import get_context
from pathlib import Path
from typing import Final

from taxel.errors import TaxelError
from taxel.output.handover import Handover, read_handover
from taxel.recording.grasp_record import GraspRecord
from taxel.twin.causes import ReferenceFile, name_cause
from taxel.twin.events import Alarm, CauseEvent, Event, InputFault
from taxel.twin.schedule import Condition, Contact

NAMED_AFTER: Final = (3, 10, 30, 100, 300, 1000)
"""Numbers of contacts since the first alarm's onset at which the cause in a recording is named. They are a factor of
about three apart, because naming a cause takes seconds and a recording may contain thousands of contacts."""

MOST_CONTACTS: Final = 300
"""Largest number of contacts from which a cause is named (the latest): the probabilities hardly change with more."""


@dataclass(eq=False)
class CauseNaming:
    """Collects contacts and names the cause of the active alarms (runs the diagnosis of `taxel.gap`).

    reference: the reference dataset. is_live: name the cause in a background process, again and again with the newest
    contacts; False: name it in the foreground when the number of contacts reaches each value of `counts`. show:
    receives progress messages.
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
    _handover: Handover | None = None

    def set_alarms(self, alarms: Sequence[Alarm]) -> None:
        """Set the active alarms. The cause is named from the contacts since their earliest onset."""
        if not alarms:
            self._named = 0
        self._alarms = list(alarms)

    def add(self, contacts: Sequence[tuple[Contact, GraspRecord]]) -> list[Event]:
        """Add complete contacts with their records; return the events of the diagnoses that have ended.

        Without an active alarm, no diagnosis is started. A live source starts a diagnosis in the background unless one
        is running. A recording is diagnosed here for each number of contacts in `counts` that is newly reached.
        """
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
        """Name the cause from all contacts since the onset, if alarms are active; end the background process.

        Returns the event of a diagnosis that was still running, and that of the last diagnosis.
        """
        events = self._collect(wait=True)
        if self._alarms and (chosen := self._select()) and len(chosen) != self._named:
            events.append(self._name_now(chosen))
        if self._pool is not None:
            self._pool.shutdown()
            self._pool = None
        self._close_handover()
        return events

    def _select(self) -> list[GraspRecord]:
        """Return the records of the contacts since the earliest onset.

        The n-th contact of each condition gets the session number and the iteration number n, counted from 0.
        """
        onset = min(alarm.onset_s for alarm in self._alarms)
        numbers: dict[Condition, int] = {}
        found = []
        for contact, record in self._contacts:
            if contact.start_s >= onset:
                number = numbers[contact.condition] = numbers.get(contact.condition, -1) + 1
                found.append(replace(record, iteration=number, session=number))
        return found

    def _start(self, records: list[GraspRecord]) -> Future[CauseEvent]:
        """Start a diagnosis of these contacts in the background process."""
        if self._pool is None:
            self._pool = ProcessPoolExecutor(1, get_context("spawn"))
        self._handover = Handover((self.reference, records, self._contacts[-1][0].end_s, self._list_alarm_numbers()))
        return self._pool.submit(_diagnose_handover, self._handover.path)

    def _name_now(self, records: list[GraspRecord]) -> Event:
        """Diagnose these contacts in the foreground; return the cause, or an input fault if the diagnosis fails."""
        time_s = self._contacts[-1][0].end_s
        self.show(f"naming the cause of {len(records)} contacts")
        try:
            return _diagnose_contacts(self.reference, records, time_s, self._list_alarm_numbers())
        except TaxelError as error:
            return InputFault(time_s, "cause", str(error))

    def _collect(self, wait: bool = False) -> list[Event]:
        """Return the event of the background diagnosis if it has ended: its cause, or an input fault if it failed.

        wait: wait for the end. The list is empty if no diagnosis has ended.
        """
        if self._pending is None or not (wait or self._pending.done()):
            return []
        pending, self._pending = self._pending, None
        try:
            return [pending.result()]
        except TaxelError as error:
            problem = str(error)
        except BrokenProcessPool:
            problem = (
                "the diagnosing process was terminated from outside (out of memory?); the next contact starts another"
            )
            self._pool = None
        finally:
            self._close_handover()
        return [InputFault(self._contacts[-1][0].end_s, "cause", problem)]

    def _close_handover(self) -> None:
        """Remove the file of the contacts of the background process, if there is one."""
        if self._handover is not None:
            self._handover.close()
            self._handover = None

    def _list_alarm_numbers(self) -> tuple[int, ...]:
        return tuple(alarm.number for alarm in self._alarms)


def _diagnose_handover(path: Path) -> CauseEvent:
    """Call `_diagnose_contacts` in the background process. path: of the `Handover` of its arguments."""
    return _diagnose_contacts(*read_handover(path))


def _diagnose_contacts(
    reference: ReferenceFile, records: Sequence[GraspRecord], time_s: float, alarms: tuple[int, ...]
) -> CauseEvent:
    """Write the contacts to a temporary dataset and diagnose it. time_s: time of the event. alarms: alarm numbers."""
    with tempfile.TemporaryDirectory(prefix="taxel-twin-") as folder:
        return name_cause(reference, Path(folder) / "live.h5", records, time_s, alarms)
