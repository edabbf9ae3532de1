"""Workers that generate shards: this process, or several processes of this computer."""

import os
from collections.abc import Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from functools import cache, partial
from itertools import islice
from multiprocessing import get_context, parent_process
from pathlib import Path
from threading import Thread
from typing import Final, Protocol

from taxel.errors import TaxelError
from taxel.generate.recipe import Recipe
from taxel.generate.shard import generate_shard
from taxel.output.handover import Handover, read_handover

SHARDS_PER_WORKER: Final = 2
"""Number of submitted shards per worker. With 1 a worker would wait for its next shard; a larger number uses more
memory.
"""


class WorkerLostError(TaxelError):
    """A worker process has ended before its shard was complete."""

    def __init__(self) -> None:
        """Create the error of a worker process that was ended from outside."""
        super().__init__()

    def _format_message(self) -> str:
        """Format the error as one line with the likely cause and the remedy."""
        return (
            "generate: a worker process was ended from outside (memory?); completed shards are kept, "
            "run the same command again to continue, or with fewer --jobs"
        )


class Workers(Protocol):
    """Something that generates shards: local processes or a cluster."""

    def generate_shards(self, recipe: Recipe, shards: Iterable[int]) -> Iterator[tuple[int, bytes]]:
        """Generate shards; yield the number and the file content of each one in order of completion.

        shards: numbers of the shards.
        """
        ...


class Processes:
    """Worker processes on this computer."""

    def __init__(self, count: int) -> None:
        """Create workers in local processes. count: number of processes; 1: the calling process only."""
        self._count = count

    def generate_shards(self, recipe: Recipe, shards: Iterable[int]) -> Iterator[tuple[int, bytes]]:
        """Compute shards in local processes; yield the number and the file content of each one in order of completion.

        Implements the protocol `Workers`. shards: numbers of the shards. Raises the errors of `generate_shard`, and
        WorkerLostError if a process is ended from outside.
        """
        numbers = list(shards)
        count = min(self._count, len(numbers))
        if count <= 1:
            yield from ((shard, generate_shard(recipe, shard)) for shard in numbers)
            return
        handover = Handover(recipe)  # a recipe with meshes is larger than the buffer of a pipe
        pool = ProcessPoolExecutor(count, mp_context=get_context("spawn"))
        try:
            task = partial(_generate_numbered_shard, handover.path)
            yield from _run_in_pool(pool, task, numbers, SHARDS_PER_WORKER * count)
        except BrokenProcessPool:
            raise WorkerLostError from None
        finally:
            pool.shutdown(cancel_futures=True)
            handover.close()


def _generate_numbered_shard(recipe_file: Path, shard: int) -> tuple[int, bytes]:
    """Generate a shard in a worker process, which ends with its parent; return its number and its file content.

    recipe_file: file of the `Handover` that contains the recipe.
    """
    _exit_with_parent()
    return shard, generate_shard(read_handover(recipe_file), shard)


@cache
def _exit_with_parent() -> None:
    """Start a thread, once per process, that ends this worker process when its parent process ends.

    A killed parent cannot end its workers, which would wait without limit.
    """
    parent = parent_process()
    if parent is not None:

        def watch() -> None:
            """Wait for the end of the parent process, then end this process at once."""
            parent.join()
            os._exit(1)

        Thread(target=watch, daemon=True).start()


def _run_in_pool(
    pool: ProcessPoolExecutor, task: partial[tuple[int, bytes]], shards: list[int], pending: int
) -> Iterator[tuple[int, bytes]]:
    """Submit shards to a process pool; yield the number and the file content of each one in order of completion.

    task: generates a shard. shards: numbers of the shards. pending: largest number of submitted, unfinished shards.
    """
    remaining = iter(shards)
    running: set[Future[tuple[int, bytes]]] = {pool.submit(task, shard) for shard in islice(remaining, pending)}
    while running:
        done, running = wait(running, return_when=FIRST_COMPLETED)
        for future in done:
            yield future.result()
        running |= {pool.submit(task, shard) for shard in islice(remaining, len(done))}
