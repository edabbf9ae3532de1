"""A twin session: tests, naming of causes, and the latest frame, from one source of poll cycles."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from taxel.hand.errors import format_address
from taxel.twin.comparison import StepResult, Twin
from taxel.twin.contact_records import ContactRecorder
from taxel.twin.events import Event, InputFault, Repaired
from taxel.twin.naming import CauseNaming
from taxel.twin.prediction import TwinFrame, predict_frame
from taxel.twin.self_repair import SelfRepair, plan_repair
from taxel.twin.sources import Block, Source

SILENCE_S = 1.0
"""Interval between two poll cycles above which a fault of the input is reported, seconds."""


@dataclass(frozen=True, eq=False)
class Update:
    """Results of a block of poll cycles, or of the end of the stream.

    results: steps that ended in the block. frame: the newest frame beside its prediction; None at the end of the
    stream. frames: number of poll cycles in the block. repair: corrections of the signals; None if corrections are off.
    skipped: number of poll cycles of a live skin that are in no view, because processing was behind.
    """

    results: tuple[StepResult, ...]
    events: tuple[Event, ...]
    frame: TwinFrame | None
    frames: int
    repair: SelfRepair | None = None
    skipped: int = 0


class TwinSession:
    """Runs a twin on a source of poll cycles.

    naming: names the causes of alarms; None: causes are not named. repairs: whether corrections of the signals are
    derived from the active alarms. skipped: number of poll cycles so far that are in no view (`Update.skipped`).
    """

    def __init__(self, twin: Twin, source: Source, naming: CauseNaming | None, repairs: bool = False) -> None:
        """Create a session that compares the poll cycles of `source` with the twin; arguments as for the class."""
        self.twin = twin
        self._repair = plan_repair(twin.reference, ()) if repairs else None
        self._source = source
        self._naming = naming
        poses = naming.reference.poses if naming is not None else {}
        self._recorder = ContactRecorder(twin.schedule, poses)
        self._last_s = -np.inf
        self._sessions = 0
        self._unique_ids: dict[int, bytes] = {}
        self.skipped = 0
        self._faults: list[tuple[str, str]] = []

    def report_fault(self, kind: str, message: str) -> None:
        """Report a fault of an input with the next update; may be called by another thread. kind: as `InputFault`."""
        self._faults.append((kind, message))

    def updates(self) -> Iterator[Update]:
        """Yield the results of each block of the source, and of the end of the stream."""
        for block in self._source.blocks():
            yield self.take(block)
        results = self.twin.finish()
        events = [event for result in results for event in result.events]
        if self._naming is not None:
            self._naming.set_alarms([test.alarm for test in self.twin.active.values()])
            events += self._naming.finish()
        if results:
            events += self._plan_repair(results[-1].step.end_s)
        yield Update(tuple(results), tuple(events), None, 0, self._repair)

    def take(self, block: Block) -> Update:
        """Process one block of poll cycles; return its results.

        The twin compares all poll cycles of the block with its reference, but a frame is predicted for display only for
        the newest one. `skipped` counts the other poll cycles of a live source, which are not displayed because the
        processing is behind. A recording is read in large blocks on purpose, so none of its poll cycles counts as
        skipped.
        """
        events: list[Event] = [*self._find_gaps(block), *self._find_exchanged_boards(float(block.time_s[0]))]
        results = [*self._begin_session(float(block.time_s[0])), *self.twin.take(*block)]
        faults, self._faults = self._faults, []
        events += [InputFault(float(block.time_s[-1]), kind, message) for kind, message in faults]
        events += [event for result in results for event in result.events]
        if self._naming is not None:
            self._naming.set_alarms([test.alarm for test in self.twin.active.values()])
            events += self._naming.add(self._recorder.take(*block))
        skipped = len(block.time_s) - 1 if self._source.is_live else 0
        self.skipped += skipped
        frame = predict_frame(self.twin, float(block.time_s[-1]), block.raw_counts[-1], block.valid[-1])
        if results:
            events += self._plan_repair(results[-1].step.end_s)
        return Update(tuple(results), tuple(events), frame, len(block.time_s), self._repair, skipped)

    def _begin_session(self, time_s: float) -> list[StepResult]:
        """Begin a session of the source if one has begun by the start of a block; return the results of older steps."""
        starts = self._source.session_starts_s
        if self._sessions == len(starts) or time_s < starts[self._sessions]:
            return []
        self._sessions += 1
        return self.twin.begin_session(time_s)

    def _plan_repair(self, time_s: float) -> Iterator[Repaired]:
        """Derive the corrections from the active alarms; yield an event if they have changed."""
        if self._repair is None:
            return
        planned = plan_repair(self.twin.reference, [test.alarm for test in self.twin.active.values()])
        if planned.corrections != self._repair.corrections:
            self._repair = planned
            yield Repaired(time_s, planned.corrections)

    def _find_exchanged_boards(self, time_s: float) -> Iterator[InputFault]:
        """Yield a fault for each board whose processor has another unique id than before; the twin learns it again."""
        sensors = self.twin.reference.sensors
        for address, unique_id in self._source.get_unique_ids().items():
            known_id = self._unique_ids.setdefault(address, unique_id)
            if unique_id == known_id or address not in sensors.address:
                continue
            self._unique_ids[address] = unique_id
            board = int(np.flatnonzero(sensors.address == address)[0])
            self.twin.exchange_board(board)
            yield InputFault(
                time_s,
                "board",
                f"board {format_address(address)} ({sensors.name[board].replace('_', ' ')}) was exchanged: unique id "
                f"{unique_id.hex()}, before {known_id.hex()}; its changes are compared with its own contacts from now "
                "on; record a new reference",
            )

    def _find_gaps(self, block: Block) -> Iterator[InputFault]:
        """Yield a fault for each interval of more than `SILENCE_S` without frames; nothing for a source that may
        pause.
        """
        if not self._source.is_continuous:
            return
        times = np.concatenate([[self._last_s], block.time_s])
        for row in np.flatnonzero(np.diff(times) > SILENCE_S).tolist():
            if np.isfinite(times[row]):
                length = times[row + 1] - times[row]
                yield InputFault(float(times[row + 1]), "gap", f"no frame arrived for {length:.1f} s")
        self._last_s = float(times[-1])
