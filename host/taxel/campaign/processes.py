"""The parts of a campaign on several processes, in order."""

from __future__ import annotations

import os
import pickle
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from functools import lru_cache, partial
from multiprocessing import get_context
from typing import TypeVar

from taxel.campaign.setup import Setup
from taxel.errors import TaxelError

_Part = TypeVar("_Part")
_Settings = TypeVar("_Settings")
_Result = TypeVar("_Result")


class ProcessLostError(TaxelError):
    """A process of a campaign has ended before its work was done."""

    def __init__(self) -> None:
        super().__init__()

    def __str__(self) -> str:
        return (
            "campaign: one of its processes was ended from outside (memory?); what was finished is in the file, "
            "go on with resume, or with fewer jobs"
        )


def in_processes(
    make: Callable[[Setup, _Part, _Settings], _Result],
    setup: Setup,
    parts: Sequence[_Part],
    settings: _Settings,
    jobs: int | None,
    chunk: int = 1,
) -> Iterator[_Result]:
    """`make(setup, part, settings)` for each part, in order. jobs: processes; None: one a core; 1: this one.

    Raises what `make` raises, and `ProcessLostError`.
    """
    jobs = min(jobs or os.cpu_count() or 1, len(parts))
    if jobs <= 1:
        yield from (make(setup, part, settings) for part in parts)
        return
    # Not an initializer's argument: a process must start at once, or one that is lost meanwhile blocks the pool.
    work = partial(_make, make, pickle.dumps(setup), settings)
    pool = ProcessPoolExecutor(jobs, mp_context=get_context("spawn"))
    try:
        yield from pool.map(work, parts, chunksize=chunk)
    except BrokenProcessPool:
        raise ProcessLostError from None
    finally:
        pool.shutdown(cancel_futures=True)


def _make(
    make: Callable[[Setup, _Part, _Settings], _Result], setup: bytes, settings: _Settings, part: _Part
) -> _Result:
    return make(_setup_of(setup), part, settings)


@lru_cache(maxsize=1)
def _setup_of(pickled: bytes) -> Setup:
    """The setup, with what it has worked out, for all parts of this process."""
    setup: Setup = pickle.loads(pickled)
    return setup
