"""Scheduler that runs many procedures on one bus: while one board writes its flash, other boards use the bus."""

import heapq
from collections import deque
from collections.abc import Hashable, Mapping
from dataclasses import dataclass
from typing import Final, Generic, TypeVar

from taxel.errors import TaxelError
from taxel_tools.errors import TransferError, WireError
from taxel_tools.procedure import Burst, Pause, Procedure
from taxel_tools.wires import BoardWire

Key = TypeVar("Key", bound=Hashable)
Result = TypeVar("Result")

IDLE_TIMEOUT_S: Final = 5.0
"""A bus on which no transfer ends within this time has failed; a transfer takes less than a second."""


def run(wire: BoardWire, procedure: Procedure[Result]) -> Result:
    """Run one procedure, a generator of bus transfers, to its end. Returns its result; raises its errors."""
    result = run_all(wire, {0: procedure})[0]
    if isinstance(result, TaxelError):
        raise result
    return result


def run_all(wire: BoardWire, procedures: Mapping[Key, Procedure[Result]]) -> dict[Key, Result | TaxelError]:
    """Run several procedures, generators of bus transfers, concurrently. Returns the result or the `TaxelError` of
    each.

    Raises `WireError` or `LinkError` if the bus fails; every procedure is then closed.
    """
    scheduler = _Scheduler(wire, procedures)
    try:
        scheduler.run()
    finally:
        for procedure in procedures.values():
            procedure.close()
    return {key: scheduler.results[key] for key in procedures}


@dataclass(frozen=True, slots=True)
class _PendingTransfer(Generic[Key]):
    """A submitted transfer: key of its procedure, and the burst that contains it (None for a single transfer)."""

    key: Key
    burst: Burst | None = None


class _Scheduler(Generic[Key, Result]):
    """Execution of several procedures on one bus. `results`: return value or error of each ended procedure."""

    def __init__(self, wire: BoardWire, procedures: Mapping[Key, Procedure[Result]]) -> None:
        """Prepare to run procedures concurrently on one wire.

        procedures: generators of I2C transfers and pauses, by a key. `results`: return value or error of each
        procedure.
        """
        self.results: dict[Key, Result | TaxelError] = {}
        self._wire = wire
        self._procedures = procedures
        self._ready: deque[tuple[Key, bytes | TransferError | None]] = deque((key, None) for key in procedures)
        self._waiting: dict[int, _PendingTransfer[Key]] = {}
        self._pauses: list[tuple[float, int, Key]] = []
        self._count = 0

    def run(self) -> None:
        """Run all procedures on the wire until they have ended. Raises `WireError` if no transfer ends in time."""
        while self._ready or self._waiting or self._pauses:
            while self._ready:
                self._step(*self._ready.popleft())
            now = self._wire.now_s()
            timeout_s = max(self._pauses[0][0] - now, 0.0) if self._pauses else IDLE_TIMEOUT_S
            if not (self._waiting or self._pauses):
                return
            ended = self._wire.collect(timeout_s)
            if not (ended or self._pauses):
                raise WireError(self._wire.name, f"no transfer ended within {IDLE_TIMEOUT_S:g} s; check the connection")
            for number, outcome in ended:
                self._store_outcome(self._waiting.pop(number), outcome)
            while self._pauses and self._pauses[0][0] <= self._wire.now_s():
                self._ready.append((heapq.heappop(self._pauses)[2], b""))

    def _store_outcome(self, pending: _PendingTransfer[Key], outcome: bytes | TransferError) -> None:
        """Store the outcome of an ended transfer in its burst, or pass it to its procedure.

        A procedure whose request has ended becomes ready. On a bus without a queue, the next transfer of the burst
        starts.
        """
        burst = pending.burst
        if burst is None:
            self._ready.append((pending.key, outcome))
            return
        burst.outcomes.append(outcome)  # Transfers end in the order in which they were submitted.
        failed = isinstance(outcome, TransferError)
        if not self._wire.is_queued and not failed and len(burst.outcomes) < len(burst.transfers):
            self._submit(pending.key, burst, len(burst.outcomes))
        elif len(burst.outcomes) == len(burst.transfers) or not self._wire.is_queued:
            self._ready.append((pending.key, b""))

    def _submit(self, key: Key, burst: Burst, index: int) -> None:
        """Start transfer number `index` of a burst for the procedure `key`."""
        self._waiting[self._wire.submit(burst.transfers[index])] = _PendingTransfer(key, burst)

    def _step(self, key: Key, outcome: bytes | TransferError | None) -> None:
        """Resume the procedure `key` with the outcome of its last request, and start its next request."""
        procedure = self._procedures[key]
        try:
            if isinstance(outcome, TransferError):
                request = procedure.throw(outcome)
            else:
                request = next(procedure) if outcome is None else procedure.send(outcome)
        except StopIteration as end:
            self.results[key] = end.value
            return
        except WireError:
            raise
        except TaxelError as error:
            self.results[key] = error
            return
        if isinstance(request, Pause):
            self._count += 1
            heapq.heappush(self._pauses, (self._wire.now_s() + request.seconds, self._count, key))
        elif isinstance(request, Burst):
            for index in range(len(request.transfers) if self._wire.is_queued else 1):
                self._submit(key, request, index)
        else:
            self._waiting[self._wire.submit(request)] = _PendingTransfer(key)
