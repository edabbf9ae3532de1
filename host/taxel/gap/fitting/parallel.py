"""Parallel map over two threads or two processes, for data sets that are large enough to gain from it.

Two threads share the lock of the Python interpreter, and many short array operations hold this lock: two threads are
only about a third faster than one. A forked process has an interpreter of its own and shares the memory of all data
that were read before the fork, so that no input has to be serialised.
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

N_THREADS: Final = 2
MIN_PARALLEL_VALUES: Final = 200_000
"""Number of values of the simulated signal [Q, K, n] from which work is distributed (chosen): for smaller data the
overhead of threads and processes exceeds the gain."""

MAX_ITEMS: Final = 255
"""Largest number of items for two processes: the index of an item is transmitted as one byte."""

_HEADER: Final = struct.Struct("<BQ")
"""Header of each result from the forked process: index of the item (u8) and length of the pickled result (u64)."""


def map_in_threads(state: State, work: Callable[[Item], Result], items: Iterable[Item]) -> list[Result]:
    """Apply `work` to every item in two threads, and return the results in the order of the items.

    Preferable to `map_in_processes` if the results are large, because they need not be serialised. Data with fewer than
    `MIN_PARALLEL_VALUES` values are processed without further threads. Raises the exception of the first failed item.
    """
    if state.signal_counts.size < MIN_PARALLEL_VALUES:
        return [work(item) for item in items]
    with ThreadPoolExecutor(N_THREADS) as pool:
        return list(pool.map(work, items))


def map_in_processes(state: State, work: Callable[[Item], Result], items: Iterable[Item]) -> list[Result]:
    """Apply `work` to every item in this and a forked process, and return the results in the order of the items.

    Side effects of `work` in the forked process are lost. An item whose work fails or whose result cannot be pickled in
    the forked process is processed again in this process, which raises the exception. If the fork fails, two threads do
    the work. Nested calls, data with fewer than `MIN_PARALLEL_VALUES` values, a single item, and more than `MAX_ITEMS`
    items are processed in this process alone.
    """
    all_items = list(items)
    if state.signal_counts.size < MIN_PARALLEL_VALUES or not 1 < len(all_items) <= MAX_ITEMS or _Distribution.is_active:
        return [work(item) for item in all_items]
    _Distribution.is_active = True
    try:
        results_by_index = _run_in_two_processes(work, all_items) if hasattr(os, "fork") else None
    finally:
        _Distribution.is_active = False
    if results_by_index is None:
        return map_in_threads(state, work, all_items)
    return [
        results_by_index[index] if index in results_by_index else work(item) for index, item in enumerate(all_items)
    ]


class _Distribution:
    """Flag, inherited by a forked process: work is distributed at present, and both cores are busy."""

    is_active = False


def _run_in_two_processes(work: Callable[[Item], Result], items: list[Item]) -> dict[int, Result] | None:
    """Return the results by index of the item; None if the fork fails. Items whose work failed in the forked process,
    or whose result was not received, are missing.

    Both processes read the index of their next item from one pipe until the pipe is empty.
    """
    with _block_interrupts():
        try:
            pid, remaining, received = _fork_worker(work, items)
        except OSError:
            return None
    results_by_index: dict[int, Result] = {}
    try:
        while index_byte := remaining.read(1):
            results_by_index[index_byte[0]] = work(items[index_byte[0]])
        while len(header := received.read(_HEADER.size)) == _HEADER.size:
            index, size = _HEADER.unpack(header)
            data = received.read(size)
            if len(data) == size:
                results_by_index[index] = pickle.loads(data)
    finally:
        remaining.close()
        received.close()
        with suppress(ProcessLookupError, ChildProcessError):  # worker ended, or exit status collected
            os.kill(pid, signal.SIGKILL)
            os.waitpid(pid, 0)
    return results_by_index


def _fork_worker(work: Callable[[Any], Any], items: list[Any]) -> tuple[int, BinaryIO, BinaryIO]:
    """Fork a worker process; return its process id, the pipe with the indices of remaining items, and the pipe with its
    results.

    The worker processes items at once, see `_run_worker`. Raises OSError if a pipe or the process cannot be created.
    """
    with ExitStack() as opened:
        ends: list[Any] = []
        for _ in range(2):
            pair = os.pipe()
            ends += [opened.enter_context(os.fdopen(pair[0], "rb", 0)), opened.enter_context(os.fdopen(pair[1], "wb"))]
        remaining, queue, received, output = ends
        queue.write(bytes(range(len(items))))
        queue.close()
        parent = os.getpid()
        pid = os.fork()
        if pid == 0:
            _run_worker(work, items, parent, remaining, received, output)
        output.close()
        opened.pop_all()
    return pid, remaining, io.BufferedReader(received)


def _run_worker(
    work: Callable[[Any], Any], items: list[Any], parent: int, remaining: BinaryIO, received: BinaryIO, output: BinaryIO
) -> None:
    """Run the worker process: process items until none is left, send all results, and exit.

    parent: process id of the parent, without which the worker stops. remaining: pipe with the indices of remaining
    items. received: the parent's end of the pipe `output`, to which the results are written. Never returns: the code of
    the caller must not run in the forked process.
    """
    try:
        received.close()  # otherwise writing would not fail after the parent has closed its end
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
