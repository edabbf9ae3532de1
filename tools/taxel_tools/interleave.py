"""Many talks over one wire: while one board writes its flash, the others have the bus."""

from __future__ import annotations

import heapq
from collections import deque
from collections.abc import Hashable, Mapping
from dataclasses import dataclass
from typing import Final, Generic, TypeVar

from taxel.errors import TaxelError
from taxel_tools.errors import TransferError, WireError
from taxel_tools.steps import Burst, Pause, Steps
from taxel_tools.wires import BoardWire

K = TypeVar("K", bound=Hashable)
T = TypeVar("T")

PATIENCE_S: Final = 5.0
"""A wire on which nothing ends for so long has failed; a transfer ends within a second."""


def run(wire: BoardWire, steps: Steps[T]) -> T:
    """Run one talk to its end. Raises what it raises."""
    result = run_all(wire, {0: steps})[0]
    if isinstance(result, TaxelError):
        raise result
    return result


def run_all(wire: BoardWire, talks: Mapping[K, Steps[T]]) -> dict[K, T | TaxelError]:
    """Run all talks at once; each ends in its result, or in its `TaxelError` while the others go on.

    Raises `WireError` or `LinkError` if the wire fails: then every talk is ended.
    """
    loop = _Loop(wire, talks)
    try:
        loop.run()
    finally:
        for talk in talks.values():
            talk.close()
    return {key: loop.results[key] for key in talks}


@dataclass(frozen=True, slots=True)
class _UnderWay(Generic[K]):
    """Whose a submitted transfer is, and the burst that it belongs to."""

    key: K
    burst: Burst | None = None


class _Loop(Generic[K, T]):
    def __init__(self, wire: BoardWire, talks: Mapping[K, Steps[T]]) -> None:
        self.results: dict[K, T | TaxelError] = {}
        self._wire = wire
        self._talks = talks
        self._ready: deque[tuple[K, bytes | TransferError | None]] = deque((key, None) for key in talks)
        self._waiting: dict[int, _UnderWay[K]] = {}
        self._pauses: list[tuple[float, int, K]] = []
        self._count = 0

    def run(self) -> None:
        while self._ready or self._waiting or self._pauses:
            while self._ready:
                self._step(*self._ready.popleft())
            now = self._wire.now_s()
            patience = max(self._pauses[0][0] - now, 0.0) if self._pauses else PATIENCE_S
            if not (self._waiting or self._pauses):
                return
            ended = self._wire.collect(patience)
            if not (ended or self._pauses):
                raise WireError(self._wire.name, f"nothing has come for {PATIENCE_S:g} s; check the connection")
            for number, outcome in ended:
                self._take(self._waiting.pop(number), outcome)
            while self._pauses and self._pauses[0][0] <= self._wire.now_s():
                self._ready.append((heapq.heappop(self._pauses)[2], b""))

    def _take(self, sent: _UnderWay[K], outcome: bytes | TransferError) -> None:
        burst = sent.burst
        if burst is None:
            self._ready.append((sent.key, outcome))
            return
        burst.outcomes.append(outcome)  # a wire ends transfers in their order
        failed = isinstance(outcome, TransferError)
        if not self._wire.is_queued and not failed and len(burst.outcomes) < len(burst.transfers):
            self._submit(sent.key, burst, len(burst.outcomes))
        elif len(burst.outcomes) == len(burst.transfers) or not self._wire.is_queued:
            self._ready.append((sent.key, b""))

    def _submit(self, key: K, burst: Burst, place: int) -> None:
        self._waiting[self._wire.submit(burst.transfers[place])] = _UnderWay(key, burst)

    def _step(self, key: K, outcome: bytes | TransferError | None) -> None:
        talk = self._talks[key]
        try:
            if isinstance(outcome, TransferError):
                request = talk.throw(outcome)
            else:
                request = next(talk) if outcome is None else talk.send(outcome)
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
            for place in range(len(request.transfers) if self._wire.is_queued else 1):
                self._submit(key, request, place)
        else:
            self._waiting[self._wire.submit(request)] = _UnderWay(key)
