"""Parallel map over the parts of a campaign, with the results in the order of the parts."""

import os
import pickle
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from functools import lru_cache, partial
from multiprocessing import get_context
from types import TracebackType
from typing import Self, TypeVar

from taxel.campaign.setup import Setup
from taxel.errors import TaxelError

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
        self._pool = ProcessPoolExecutor(self.count, mp_context=get_context("spawn")) if self.count > 1 else None

    def __enter__(self) -> Self:
        """Return the processes themselves; they end with the `with` block."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End the processes; parts that have not started are not computed."""
        if self._pool:
            self._pool.shutdown(cancel_futures=True)

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
        # the pool.
        task = partial(_call_with_pickled_setup, function, pickle.dumps(self._setup), settings)
        try:
            yield from self._pool.map(task, parts, chunksize=chunk)
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


def _call_with_pickled_setup(
    function: Callable[[Setup, _Part, _Settings], _Result], setup: bytes, settings: _Settings, part: _Part
) -> _Result:
    """Call `function(setup, part, settings)` in a worker process. setup: pickled, so that it is loaded only once."""
    return function(_load_setup(setup), part, settings)


@lru_cache(maxsize=1)
def _load_setup(pickled: bytes) -> Setup:
    """Unpickle the campaign's setup once per process, so that all parts share the values that the setup caches."""
    setup: Setup = pickle.loads(pickled)
    return setup
