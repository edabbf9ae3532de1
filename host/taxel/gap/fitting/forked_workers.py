"""Forked worker processes that process items together with their parent.

A forked process shares the memory of all data that were read before the fork, so that no input has to be serialised.
"""

from __future__ import annotations

import io
import os
import pickle
import signal
import struct
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from typing import Any, BinaryIO, Final, TypeVar

Item = TypeVar("Item")
Result = TypeVar("Result")

MAX_ITEMS: Final = 255
"""Largest number of items for several processes: the index of an item is transmitted as one byte."""

_HEADER: Final = struct.Struct("<BQ")
"""Header of each result from the forked process: index of the item (u8) and length of the pickled result (u64)."""


@dataclass(frozen=True)
class _Worker:
    """A forked process: its id, and the pipe with its results."""

    pid: int
    received: BinaryIO


def run_in_processes(
    work: Callable[[Item], Result], items: list[Item], order: Sequence[int], workers: int
) -> dict[int, Result] | None:
    """Return the results by index of the item; None if no process can be forked. Items whose work failed in a forked
    process, or whose result was not received, are missing.

    order: indices of the items in the order in which they are started. workers: number of forked processes. All
    processes read the index of their next item from one pipe until the pipe is empty.
    """
    try:
        remaining = _open_queue(order)
    except OSError:
        return None
    forked: list[_Worker] = []
    with _block_interrupts(), suppress(OSError):  # after a failure, the processes that were forked before do the work
        for _ in range(workers):
            forked.append(_fork_worker(work, items, remaining, forked))
    if not forked:
        remaining.close()
        return None
    results_by_index: dict[int, Result] = {}
    try:
        while index_byte := remaining.read(1):
            results_by_index[index_byte[0]] = work(items[index_byte[0]])
        for worker in forked:
            results_by_index |= _receive_results(worker.received)
    finally:
        remaining.close()
        for worker in forked:
            _end_worker(worker)
    return results_by_index


def _receive_results(received: BinaryIO) -> dict[int, Any]:
    """Return the results of a worker process by index of the item, until it closes its pipe or a result is cut off."""
    results = {}
    while len(header := received.read(_HEADER.size)) == _HEADER.size:
        index, size = _HEADER.unpack(header)
        data = received.read(size)
        if len(data) == size:
            results[index] = pickle.loads(data)
    return results


def _end_worker(worker: _Worker) -> None:
    """Close the pipe of a worker process and end the process."""
    worker.received.close()
    with suppress(ProcessLookupError, ChildProcessError):  # worker ended, or exit status collected
        os.kill(worker.pid, signal.SIGKILL)
        os.waitpid(worker.pid, 0)


def _open_queue(order: Sequence[int]) -> BinaryIO:
    """Return the pipe with the indices of the remaining items. Raises OSError if no pipe can be created."""
    reading, writing = os.pipe()
    with os.fdopen(writing, "wb") as queue:
        queue.write(bytes(order))
    return os.fdopen(reading, "rb", 0)


def _fork_worker(
    work: Callable[[Any], Any], items: list[Any], remaining: BinaryIO, others: Sequence[_Worker]
) -> _Worker:
    """Fork one worker process. remaining: pipe with the indices of the remaining items. others: workers that were
    forked before, whose pipes the new process closes.

    Raises OSError if the pipe or the process cannot be created.
    """
    with ExitStack() as opened:
        reading, writing = os.pipe()
        received = opened.enter_context(os.fdopen(reading, "rb", 0))
        output = opened.enter_context(os.fdopen(writing, "wb"))
        parent = os.getpid()
        pid = os.fork()
        if pid == 0:
            _run_worker(work, items, parent, remaining, [received, *(other.received for other in others)], output)
        output.close()
        opened.pop_all()
    return _Worker(pid, io.BufferedReader(received))


def _run_worker(
    work: Callable[[Any], Any],
    items: list[Any],
    parent: int,
    remaining: BinaryIO,
    inherited: Iterable[BinaryIO],
    output: BinaryIO,
) -> None:
    """Run the worker process: process items until none is left, send all results, and exit.

    parent: process id of the parent, without which the worker stops. remaining: pipe with the indices of remaining
    items. inherited: the parent's ends of pipes. output: pipe to which the results are written. Never returns: the code
    of the caller must not run in the forked process.
    """
    try:
        for pipe in inherited:
            pipe.close()  # otherwise writing would not fail after the parent has closed its end
        results = []
        while os.getppid() == parent and (index_byte := remaining.read(1)):
            with suppress(Exception):  # the parent repeats failed items and raises their errors
                results.append((index_byte[0], pickle.dumps(work(items[index_byte[0]]), protocol=5)))
        for index, data in results:
            output.write(_HEADER.pack(index, len(data)) + data)
        output.flush()
    finally:
        os._exit(0)


@contextmanager
def _block_interrupts() -> Iterator[None]:
    """Block SIGINT while the context is entered.

    It is used around the fork: a KeyboardInterrupt in the forked process before its first own statement would run
    exception handlers of the caller.
    """
    previous_mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, previous_mask)
