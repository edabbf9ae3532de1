"""Work of a diagnosis on both cores, where there is enough of it.

Threads share one interpreter, and small steps of many arrays keep it busy: two threads do a third more than one. A copy
of this process has an interpreter of its own, and everything that was read is there without being sent.
"""

from __future__ import annotations

import io
import os
import pickle
import signal
import struct
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager, suppress
from typing import Any, BinaryIO, Final, TypeVar

from taxel.gap.fitting.state import State

Item = TypeVar("Item")
Result = TypeVar("Result")

THREADS: Final = 2
WORTH: Final = 200_000
"""Values of the simulator's signal, [Q, K, n], below which others wait for each other longer than they work."""

MOST_ITEMS: Final = 255

_HEAD: Final = struct.Struct("<BQ")
"""Before each result that a copy sends: its place, and its bytes."""


def in_threads(state: State, work: Callable[[Item], Result], items: Iterable[Item]) -> list[Result]:
    """What `work` gives for each item, in their order. For results that are larger than what was done for them."""
    if state.signal_counts.size < WORTH:
        return [work(item) for item in items]
    with ThreadPoolExecutor(THREADS) as pool:
        return list(pool.map(work, items))


def in_copies(state: State, work: Callable[[Item], Result], items: Iterable[Item]) -> list[Result]:
    """The same, half of it in a copy of this process; what `work` leaves behind there is lost.

    What a copy cannot do or send, or where none can be made, is done here; so is what is asked for within such work,
    where both cores are busy.
    """
    every = list(items)
    if state.signal_counts.size < WORTH or not 1 < len(every) <= MOST_ITEMS or _Busy.shared:
        return [work(item) for item in every]
    _Busy.shared = True
    try:
        done = _shared(work, every) if hasattr(os, "fork") else None
    finally:
        _Busy.shared = False
    if done is None:
        return in_threads(state, work, every)
    return [done[place] if place in done else work(item) for place, item in enumerate(every)]


class _Busy:
    """Whether work is being shared, here or where this copy comes from."""

    shared = False


def _shared(work: Callable[[Item], Result], items: list[Item]) -> dict[int, Result] | None:
    """Results by place, None without a copy; both processes take the next place from one pipe until it is empty."""
    with _interrupts_later():
        try:
            pid, places, sent = _forked(work, items)
        except OSError:
            return None
    done: dict[int, Result] = {}
    try:
        while place := places.read(1):
            done[place[0]] = work(items[place[0]])
        while len(head := sent.read(_HEAD.size)) == _HEAD.size:
            number, size = _HEAD.unpack(head)
            data = sent.read(size)
            if len(data) == size:
                done[number] = pickle.loads(data)
    finally:
        places.close()
        sent.close()
        with suppress(ProcessLookupError, ChildProcessError):  # nobody waits for it any more, or it has ended
            os.kill(pid, signal.SIGKILL)
            os.waitpid(pid, 0)
    return done


def _forked(work: Callable[[Any], Any], items: list[Any]) -> tuple[int, BinaryIO, BinaryIO]:
    """A copy of this process that helps: its number, what is left to be done, and what it sends."""
    with ExitStack() as opened:
        ends: list[Any] = []
        for _ in range(2):
            pair = os.pipe()
            ends += [opened.enter_context(os.fdopen(pair[0], "rb", 0)), opened.enter_context(os.fdopen(pair[1], "wb"))]
        places, filled, sent, results = ends
        filled.write(bytes(range(len(items))))
        filled.close()
        parent = os.getpid()
        pid = os.fork()
        if pid == 0:
            _help(work, items, parent, places, sent, results)
        results.close()
        opened.pop_all()
    return pid, places, io.BufferedReader(sent)


def _help(
    work: Callable[[Any], Any], items: list[Any], parent: int, places: BinaryIO, sent: BinaryIO, results: BinaryIO
) -> None:
    """In the copy: all that it can do, sent when nothing is left to be done. Nothing of it may return to the caller."""
    try:
        sent.close()  # so that writing fails once nobody reads
        told = []
        while os.getppid() == parent and (place := places.read(1)):
            with suppress(Exception):  # an error, or what cannot be sent: done again where somebody can be told
                told.append((place[0], pickle.dumps(work(items[place[0]]), protocol=5)))
        for number, data in told:
            results.write(_HEAD.pack(number, len(data)) + data)
        results.flush()
    finally:
        os._exit(0)


@contextmanager
def _interrupts_later() -> Iterator[None]:
    """An interrupt between a copy's birth and its first own line would unwind into the caller's code in the copy."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
