"""Parallel map over threads or processes, one for each core, for data sets that are large enough to gain from it.

Threads share the lock of the Python interpreter, and many short array operations hold this lock: two threads are only
about a third faster than one. A forked process has an interpreter of its own and shares the memory of all data
that were read before the fork, so that no input has to be serialised.
"""

from __future__ import annotations

import io
import os
import pickle
import signal
import struct
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from multiprocessing import get_context
from typing import Any, BinaryIO, Final, TypeVar

from taxel.gap.fitting.state import State

Item = TypeVar("Item")
Result = TypeVar("Result")

MAX_PROCESSES: Final = 8
"""Largest number of threads or processes (chosen): the longest of a few dozen items determines the time of more
processes, and every process has its own temporary arrays."""

MIN_PARALLEL_VALUES: Final = 200_000
"""Number of values of the simulated signal [Q, K, n] from which work is distributed (chosen): for smaller data the
overhead of threads and processes exceeds the gain."""

MAX_ITEMS: Final = 255
"""Largest number of items for several processes: the index of an item is transmitted as one byte."""

_HEADER: Final = struct.Struct("<BQ")
"""Header of each result from the forked process: index of the item (u8) and length of the pickled result (u64)."""


def map_in_threads(state: State, work: Callable[[Item], Result], items: Iterable[Item]) -> list[Result]:
    """Apply `work` to every item in one thread for each core, and return the results in the order of the items.

    Preferable to `map_in_processes` if the results are large, because they need not be serialised. Data with fewer than
    `MIN_PARALLEL_VALUES` values are processed without further threads. Raises the exception of the first failed item.
    """
    if state.signal_counts.size < MIN_PARALLEL_VALUES or _Distribution.is_active:
        return [work(item) for item in items]
    with ThreadPoolExecutor(count_processes()) as pool:
        return list(pool.map(work, items))


def count_processes() -> int:
    """Return the number of processes that share work: one for each core that this process may use, at most
    `MAX_PROCESSES`.
    """
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return min(cores, MAX_PROCESSES)


def map_in_processes(
    state: State, work: Callable[[Item], Result], items: Iterable[Item], costs: Sequence[float] = ()
) -> list[Result]:
    """Apply `work` to every item in this and in forked processes, and return the results in the order of the items.

    There is one process for each core (`count_processes`). costs: expected time of each item in any unit; the items
    with the largest costs are processed first, so that all processes end at about the same time. Empty: unknown.

    Side effects of `work` in a forked process are lost. An item whose work fails or whose result cannot be pickled in a
    forked process is processed again in this process, which raises the exception. If no process can be forked, threads
    do the work. Nested calls, data with fewer than `MIN_PARALLEL_VALUES` values, a single item, more than `MAX_ITEMS`
    items, and a single core are processed in this process alone.
    """
    all_items = list(items)
    workers = min(count_processes(), len(all_items)) - 1
    is_small = state.signal_counts.size < MIN_PARALLEL_VALUES
    if is_small or workers < 1 or len(all_items) > MAX_ITEMS or _Distribution.is_active:
        return [work(item) for item in all_items]
    order = sorted(range(len(all_items)), key=lambda index: -costs[index]) if costs else range(len(all_items))
    _Distribution.is_active = True
    try:
        results_by_index = _run_in_processes(work, all_items, order, workers) if hasattr(os, "fork") else None
    finally:
        _Distribution.is_active = False
    if results_by_index is None:
        return map_in_threads(state, work, all_items)
    return [
        results_by_index[index] if index in results_by_index else work(item) for index, item in enumerate(all_items)
    ]


def use_one_process() -> None:
    """Process all further work of this process in this process alone, because other processes use the other cores.

    A program that diagnoses several pairs of datasets in parallel calls this function in each of its processes.
    """
    _Distribution.is_active = True


def open_diagnosis_pool(jobs: int | None, diagnoses: int) -> ProcessPoolExecutor:
    """Return a pool of processes for a number of independent diagnoses. jobs: number of processes; None: one per core.

    Each diagnosis is computed by one process, unless the pool has a single process.
    """
    count = max(min(jobs or os.cpu_count() or 1, diagnoses), 1)
    initializer = use_one_process if count > 1 else None
    return ProcessPoolExecutor(count, mp_context=get_context("spawn"), initializer=initializer)


class _Distribution:
    """Flag, inherited by a forked process: work is distributed at present, and all cores are busy."""

    is_active = False


@dataclass(frozen=True)
class _Worker:
    """A forked process: its id, and the pipe with its results."""

    pid: int
    received: BinaryIO


def _run_in_processes(
    work: Callable[[Item], Result], items: list[Item], order: Sequence[int], workers: int
) -> dict[int, Result] | None:
    """Return the results by index of the item; None if no process can be forked. Items whose work failed in a forked
    process, or whose result was not received, are missing.

    order: indices of the items in the order in which they are started. workers: number of forked processes. All
    processes read the index of their next item from one pipe until the pipe is empty.
    """
    with _block_interrupts():
        try:
            remaining, forked = _fork_workers(work, items, order, workers)
        except OSError:
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


def _fork_workers(
    work: Callable[[Any], Any], items: list[Any], order: Sequence[int], workers: int
) -> tuple[BinaryIO, list[_Worker]]:
    """Fork worker processes; return the pipe with the indices of the remaining items, and the processes.

    The workers process items at once, see `_run_worker`. Raises OSError if the first pipe or process cannot be created;
    later failures only reduce the number of workers.
    """
    reading, writing = os.pipe()
    with os.fdopen(writing, "wb") as queue:
        queue.write(bytes(order))
    remaining = os.fdopen(reading, "rb", 0)
    forked: list[_Worker] = []
    for _ in range(workers):
        try:
            forked.append(_fork_worker(work, items, remaining, forked))
        except OSError:
            break
    if not forked:
        remaining.close()
        raise BlockingIOError("no process can be forked")
    return remaining, forked


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
