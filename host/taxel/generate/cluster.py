"""Generation of shards on a cluster with Dask.

The workers need the package taxel but no shared folder: the shards are returned as bytes.
"""

from collections.abc import Iterable, Iterator, Mapping
from importlib import import_module
from itertools import islice
from typing import Any, Final

from taxel.generate.errors import ClusterError
from taxel.generate.recipe import Recipe
from taxel.generate.shard import generate_shard
from taxel.generate.versions import list_package_versions
from taxel.generate.workers import SHARDS_PER_WORKER
from taxel.optional import optional_import

CONNECT_TIMEOUT_S: Final = 30.0
"""Time within which the scheduler must respond and a worker must be available, seconds."""


class Cluster:
    """The workers of a Dask scheduler, such as "tcp://127.0.0.1:8786".

    Raises ClusterError if there is no scheduler, no worker, or a worker with another release of taxel or of a library
    that affects the result; MissingPackageError if Dask is not installed.
    """

    def __init__(self, scheduler: str, timeout_s: float = CONNECT_TIMEOUT_S) -> None:
        """Create a cluster that generates shards.

        scheduler: address of its Dask scheduler. timeout_s: limit for the connection and for the first worker.
        """
        self._scheduler, self._timeout_s = scheduler, timeout_s

    def generate_shards(self, recipe: Recipe, shards: Iterable[int]) -> Iterator[tuple[int, bytes]]:
        """Compute shards on the cluster; yield the number and the file content of each one in order of completion.

        Implements the protocol `taxel.generate.workers.Workers`. shards: numbers of the shards. Raises ClusterError if
        the cluster cannot be used.
        """
        distributed = _import_distributed()
        try:
            client = distributed.Client(self._scheduler, timeout=self._timeout_s, set_as_default=False)
        except (OSError, TimeoutError, ValueError) as error:
            found = f"no Dask scheduler answers ({type(error).__name__})"
            raise ClusterError(f"--scheduler {self._scheduler}", found, "start one with dask scheduler") from None
        with client:
            pending = SHARDS_PER_WORKER * self._count_workers(client)
            remote_recipe = client.scatter(recipe, broadcast=True, hash=False)
            try:
                yield from _submit_and_collect(distributed, client, remote_recipe, iter(shards), pending)
            except (distributed.KilledWorker, distributed.client.FutureCancelledError, OSError) as error:
                found = f"the connection was lost ({type(error).__name__})"
                remedy = "completed shards are kept; run the same command again to continue"
                raise ClusterError(f"--scheduler {self._scheduler}", found, remedy) from None

    def _count_workers(self, client: Any) -> int:
        """Wait for at least one worker of the cluster, check the releases of all workers, and return their number.

        client: connection to the Dask scheduler. Raises ClusterError.
        """
        where = f"--scheduler {self._scheduler}"
        try:
            client.wait_for_workers(1, timeout=self._timeout_s)
        except TimeoutError:
            remedy = "start them with dask worker"
            raise ClusterError(where, f"no worker within {self._timeout_s:g} s", remedy) from None
        try:
            worker_versions = client.run(list_package_versions)
        except Exception as error:  # a worker without taxel, or with another release, may raise any exception
            remedy = "install the same taxel on every worker"
            raise ClusterError(where, f"a worker cannot run taxel.generate ({type(error).__name__})", remedy) from None
        check_releases(where, list_package_versions(), worker_versions)
        return len(worker_versions)


def check_releases(where: str, local: Mapping[str, str], worker_versions: Mapping[str, Mapping[str, str]]) -> None:
    """Raise ClusterError if a worker has other package releases than this computer: its shards might differ.

    where: the scheduler, for the message. local: releases of this computer by package. worker_versions: releases by
    worker and package.
    """
    for worker, versions in worker_versions.items():
        differing = [name for name, release in local.items() if versions.get(name) != release]
        texts = [f"{name} {versions.get(name)} instead of {local[name]}" for name in differing]
        if texts:
            raise ClusterError(where, f"worker {worker} has {', '.join(texts)}", "install the same on every worker")


def _submit_and_collect(
    distributed: Any, client: Any, recipe: Any, shards: Iterator[int], pending: int
) -> Iterator[tuple[int, bytes]]:
    """Submit shards to the cluster; yield the number and the file content of each one in order of completion.

    distributed: the Dask package of this name. client: connection to the scheduler. recipe: handle of the recipe, which
    the workers already have. shards: numbers of the shards. pending: largest number of shards on the cluster.
    """

    def submit(shard: int) -> Any:
        """Start the generation of one shard on the cluster."""
        return client.submit(_generate_numbered_shard, recipe, shard, pure=False)

    first = [submit(shard) for shard in islice(shards, pending)]
    with client.as_current():
        running = distributed.as_completed(first, with_results=True)
    for future, result in running:
        future.release()  # otherwise the cluster keeps every shard in memory
        yield result
        for shard in islice(shards, 1):
            running.add(submit(shard))


def _generate_numbered_shard(recipe: Recipe, shard: int) -> tuple[int, bytes]:
    """Generate a shard on a worker of the cluster; return its number and its file content."""
    return shard, generate_shard(recipe, shard)


def _import_distributed() -> Any:
    """Import the Dask package `distributed`. Raises MissingPackageError if it is not installed."""
    with optional_import("distributed", "--scheduler"):
        return import_module("distributed")
