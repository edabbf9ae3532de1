"""Parallel map over the parts of a campaign, with the results in the order of the parts."""

import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from types import TracebackType
from typing import Any, NamedTuple, Self, TypeVar

from taxel.campaign.setup import Setup
from taxel.errors import TaxelError
from taxel.output.handover import Handover, read_handover

_Part = TypeVar("_Part")
_Settings = TypeVar("_Settings")
_Result = TypeVar("_Result")


class ProcessLostError(TaxelError):
    """A worker process of a campaign ended before its work was done."""

    def __init__(self) -> None:
        """Create the error of a campaign whose worker process was terminated from outside."""
        super().__init__()

    def _format_message(self) -> str:
        """Format the error as one line with the likely cause and the remedy."""
        return (
            "campaign: a worker process was terminated from outside (out of memory?); the finished grasps are in the "
            "file; continue with resume, or use fewer jobs"
        )


class _Pool(NamedTuple):
    """Started processes, and the file from which they read the setup."""

    executor: ProcessPoolExecutor
    setup: Handover

    @classmethod
    def start(cls, count: int, setup: Setup) -> Self:
        """Write the setup, and prepare `count` processes."""
        handover = Handover(setup)
        return cls(ProcessPoolExecutor(count, mp_context=get_context("spawn")), handover)


class Workers:
    """Processes that compute the parts of a campaign; use it as a context manager.

    Several maps share the processes, because a process takes about a second to start.
    """

    def __init__(self, setup: Setup, jobs: int | None, most_parts: int) -> None:
        """Prepare the processes; they start with the first map.

        setup: passed to every function. jobs: number of processes; None: one per core; 1: the calling process only.
        most_parts: largest number of parts of a map; more processes would be idle.
        """
        self._setup, self.count = setup, max(min(jobs or os.cpu_count() or 1, most_parts), 1)
        self._pool = _Pool.start(self.count, setup) if self.count > 1 else None

    def __enter__(self) -> Self:
        """Return the processes themselves; they end with the `with` block."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End the processes; parts that have not started are not computed."""
        if self._pool:
            self._pool.executor.shutdown(cancel_futures=True)
            self._pool.setup.close()

    def map(
        self,
        function: Callable[[Setup, _Part, _Settings], _Result],
        parts: Sequence[_Part],
        settings: _Settings,
        chunk: int = 1,
    ) -> Iterator[_Result]:
        """Yield `function(setup, part, settings)` for each part, in order.

        chunk: parts per task of a process. The calling process computes a single part, because a process takes longer
        to start. Raises the errors of `function`, and `ProcessLostError` if a process is terminated from outside.
        """
        if not self._pool or len(parts) == 1:
            yield from (function(self._setup, part, settings) for part in parts)
            return
        # The setup is not passed through the pool's initializer: a worker that is lost during a slow initializer blocks
        # the pool. Nor are setup and parts passed in the tasks: `Handover` gives the reason.
        with Handover((parts, settings)) as work:
            task = partial(_call_with_files, function, self._pool.setup.path, work.path)
            try:
                yield from self._pool.executor.map(task, range(len(parts)), chunksize=chunk)
            except BrokenProcessPool:
                raise ProcessLostError from None


def map_in_processes(
    function: Callable[[Setup, _Part, _Settings], _Result],
    setup: Setup,
    parts: Sequence[_Part],
    settings: _Settings,
    jobs: int | None,
    chunk: int = 1,
) -> Iterator[_Result]:
    """Yield `function(setup, part, settings)` for each part, in order, computed by several processes.

    jobs: number of processes; None: one per core; 1: the calling process only. chunk: parts per task of a process.
    Raises the errors of `function`, and `ProcessLostError` if a process is terminated from outside.
    """
    with Workers(setup, jobs, len(parts)) as workers:
        yield from workers.map(function, parts, settings, chunk)


def _call_with_files(
    function: Callable[[Setup, Any, Any], _Result], setup_file: Path, work_file: Path, number: int
) -> _Result:
    """Call `function(setup, part, settings)` in a worker process and return its result.

    setup_file: file of the `Handover` that contains the setup. work_file: file of the `Handover` that contains (parts,
    settings). number: index of the part in the parts. All calls in a process use the same setup object, so that they
    share the values that the setup caches.
    """
    parts, settings = read_handover(work_file)
    return function(read_handover(setup_file), parts[number], settings)
