"""Who makes the shards: this process, several of this machine, or a cluster (`taxel.generate.cluster`)."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from functools import cache, partial
from itertools import islice
from multiprocessing import get_context, parent_process
from threading import Thread
from typing import Final, Protocol

from taxel.errors import TaxelError
from taxel.generate.recipe import Recipe
from taxel.generate.shard import make_shard

AHEAD: Final = 2
"""Shards in hand for each worker: enough that none waits, few enough that memory does not grow with their number."""


class WorkerLostError(TaxelError):
    """A process has ended before its shard was done."""

    def __init__(self) -> None:
        super().__init__()

    def __str__(self) -> str:
        return (
            "generate: one of its processes was ended from outside (memory?); finished shards are kept, "
            "run the same command again to go on, or with fewer --workers"
        )


class Workers(Protocol):
    """Makes shards."""

    def made(self, recipe: Recipe, shards: Iterable[int]) -> Iterator[tuple[int, bytes]]:
        """Number and bytes of each shard, as they are finished, in any order."""
        ...


class Processes:
    """Processes of this machine. count: 1: this process alone. Raises what `make_shard` does, and WorkerLostError."""

    def __init__(self, count: int) -> None:
        self._count = count

    def made(self, recipe: Recipe, shards: Iterable[int]) -> Iterator[tuple[int, bytes]]:
        """See `Workers`."""
        wanted = list(shards)
        count = min(self._count, len(wanted))
        if count <= 1:
            yield from ((shard, make_shard(recipe, shard)) for shard in wanted)
            return
        pool = ProcessPoolExecutor(count, mp_context=get_context("spawn"))
        try:
            yield from _in_pool(pool, partial(_numbered, recipe), wanted, AHEAD * count)
        except BrokenProcessPool:
            raise WorkerLostError from None
        finally:
            pool.shutdown(cancel_futures=True)


def _numbered(recipe: Recipe, shard: int) -> tuple[int, bytes]:
    _leave_with_parent()
    return shard, make_shard(recipe, shard)


@cache
def _leave_with_parent() -> None:
    """A parent that is killed cannot end its processes; they would wait for ever for what to do next."""
    parent = parent_process()
    if parent is not None:

        def watch() -> None:
            parent.join()
            os._exit(1)

        Thread(target=watch, daemon=True).start()


def _in_pool(
    pool: ProcessPoolExecutor, work: partial[tuple[int, bytes]], shards: list[int], ahead: int
) -> Iterator[tuple[int, bytes]]:
    left = iter(shards)
    running: set[Future[tuple[int, bytes]]] = {pool.submit(work, shard) for shard in islice(left, ahead)}
    while running:
        done, running = wait(running, return_when=FIRST_COMPLETED)
        for one in done:
            yield one.result()
        running |= {pool.submit(work, shard) for shard in islice(left, len(done))}
