"""Parallel map over threads or processes, one for each core, for data sets that are large enough to gain from it.

Threads share the lock of the Python interpreter, and many short array operations hold this lock: two threads are only
about a third faster than one. A forked process has an interpreter of its own and shares the memory of all data
that were read before the fork, so that no input has to be serialised.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from multiprocessing import get_context
from typing import Final, TypeVar

from taxel.gap.fitting.forked_workers import MAX_ITEMS, run_in_processes
from taxel.gap.fitting.state import State

Item = TypeVar("Item")
Result = TypeVar("Result")

MAX_PROCESSES: Final = 8
"""Largest number of threads or processes (chosen): the longest of a few dozen items determines the time of more
processes, and every process has its own temporary arrays."""

MIN_PARALLEL_VALUES: Final = 200_000
"""Number of values of the simulated signal [Q, K, n] from which work is distributed (chosen): for smaller data the
overhead of threads and processes exceeds the gain."""


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
    return min(_count_cores(), MAX_PROCESSES)


def _count_cores() -> int:
    """Return the number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


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
        results_by_index = run_in_processes(work, all_items, order, workers) if hasattr(os, "fork") else None
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
    count = max(min(jobs or _count_cores(), diagnoses), 1)
    initializer = use_one_process if count > 1 else None
    return ProcessPoolExecutor(count, mp_context=get_context("spawn"), initializer=initializer)


class _Distribution:
    """Flag, inherited by a forked process: work is distributed at present, and all cores are busy."""

    is_active = False
