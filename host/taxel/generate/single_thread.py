"""Linear algebra on one thread while a shard is generated: another number of threads may change the last bit of sums.

The number of threads belongs to the process, and a worker of a cluster may generate several shards in one process.
Therefore the first shard sets the limit and the last one restores it. If each shard restored it, the limit would end
while other shards still need it.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from threading import Lock

from threadpoolctl import threadpool_limits


class SingleThreadLimit:
    """A limit of linear algebra to one thread that several shards share."""

    def __init__(self) -> None:
        """Create a limit on the threads of linear algebra that several threads of the program can use at once."""
        self._lock, self._users = Lock(), 0
        self._limit: threadpool_limits | None = None

    @contextmanager
    def apply(self) -> Iterator[None]:
        """Limit linear algebra to one thread inside the block; the limit ends with the last of overlapping blocks."""
        with self._lock:
            self._users += 1
            if self._limit is None:
                self._limit = threadpool_limits(limits=1)
        try:
            yield
        finally:
            with self._lock:
                self._users -= 1
                if not self._users and self._limit is not None:
                    self._limit.restore_original_limits()
                    self._limit = None


single_thread = SingleThreadLimit().apply
"""Context manager: the linear algebra of the process uses one thread inside."""
