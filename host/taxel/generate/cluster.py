"""Shards made on a cluster through Dask. Its workers need taxel, and no folder in common: shards come back as bytes."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from importlib import import_module
from itertools import islice
from typing import Any, Final

from taxel.generate.errors import ClusterError
from taxel.generate.recipe import Recipe
from taxel.generate.shard import make_shard
from taxel.generate.versions import versions
from taxel.generate.workers import AHEAD

PATIENCE_S: Final = 30.0
"""For the scheduler to answer, and for its first worker."""


class Cluster:
    """The workers of a Dask scheduler, such as "tcp://127.0.0.1:8786".

    Raises ClusterError of one line: no Dask, no scheduler, no worker, or one with another release of taxel or of what
    it computes with.
    """

    def __init__(self, scheduler: str, patience_s: float = PATIENCE_S) -> None:
        self._scheduler, self._patience_s = scheduler, patience_s

    def made(self, recipe: Recipe, shards: Iterable[int]) -> Iterator[tuple[int, bytes]]:
        """See `taxel.generate.workers.Workers`."""
        distributed = _distributed()
        try:
            client = distributed.Client(self._scheduler, timeout=self._patience_s, set_as_default=False)
        except (OSError, TimeoutError, ValueError) as error:
            found = f"no Dask scheduler answers ({type(error).__name__})"
            raise ClusterError(f"--scheduler {self._scheduler}", found, "start one with dask scheduler") from None
        with client:
            ahead = AHEAD * self._ready(client)
            work = client.scatter(recipe, broadcast=True, hash=False)
            try:
                yield from _in_order_of_finish(distributed, client, work, iter(shards), ahead)
            except (distributed.KilledWorker, distributed.client.FutureCancelledError, OSError) as error:
                found = f"it was lost meanwhile ({type(error).__name__})"
                remedy = "finished shards are kept; run the same command again to go on"
                raise ClusterError(f"--scheduler {self._scheduler}", found, remedy) from None

    def _ready(self, client: Any) -> int:
        """Number of workers, once there are any and all can make the same bytes."""
        where = f"--scheduler {self._scheduler}"
        try:
            client.wait_for_workers(1, timeout=self._patience_s)
        except TimeoutError:
            remedy = "start them with dask worker"
            raise ClusterError(where, f"no worker within {self._patience_s:g} s", remedy) from None
        try:
            theirs = client.run(versions)
        except Exception as error:  # whatever a foreign process raises: it has no taxel, or another one
            remedy = "install the same taxel on every worker"
            raise ClusterError(where, f"a worker cannot run taxel.generate ({type(error).__name__})", remedy) from None
        check_releases(where, versions(), theirs)
        return len(theirs)


def check_releases(where: str, ours: Mapping[str, str], theirs: Mapping[str, Mapping[str, str]]) -> None:
    """Refuse workers, by name, with other releases than ours: their bytes might differ. Raises ClusterError."""
    for worker, found in theirs.items():
        apart = [name for name, own in ours.items() if found.get(name) != own]
        other = [f"{name} {found.get(name)} instead of {ours[name]}" for name in apart]
        if other:
            raise ClusterError(where, f"worker {worker} has {', '.join(other)}", "install the same on every worker")


def _in_order_of_finish(
    distributed: Any, client: Any, recipe: Any, shards: Iterator[int], ahead: int
) -> Iterator[tuple[int, bytes]]:
    def submit(shard: int) -> Any:
        return client.submit(_numbered, recipe, shard, pure=False)

    first = [submit(shard) for shard in islice(shards, ahead)]
    with client.as_current():
        running = distributed.as_completed(first, with_results=True)
    for future, result in running:
        future.release()  # or the cluster keeps every shard that it made
        yield result
        for shard in islice(shards, 1):
            running.add(submit(shard))


def _numbered(recipe: Recipe, shard: int) -> tuple[int, bytes]:
    return shard, make_shard(recipe, shard)


def _distributed() -> Any:
    try:
        return import_module("distributed")
    except ImportError:
        raise ClusterError("--scheduler", "Dask is not installed", "pip install 'taxel[cluster]'") from None
