"""Linear algebra on one thread while a shard is made: sums of another number of threads may differ in the last bit.

The number of threads is the process's own, and a cluster's worker may make several shards in one process. So the first
that begins sets it and the last that ends gives it back; by itself each would give it back beneath the others.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from threading import Lock

from threadpoolctl import threadpool_limits


class OneThread:
    """Shared by all that need it; see `one_thread`."""

    def __init__(self) -> None:
        self._lock, self._inside = Lock(), 0
        self._limit: threadpool_limits | None = None

    @contextmanager
    def held(self) -> Iterator[None]:
        """One thread from the first that enters until the last has left."""
        with self._lock:
            self._inside += 1
            if self._limit is None:
                self._limit = threadpool_limits(limits=1)
        try:
            yield
        finally:
            with self._lock:
                self._inside -= 1
                if not self._inside and self._limit is not None:
                    self._limit.restore_original_limits()
                    self._limit = None


one_thread = OneThread().held
"""For a `with`: the process's linear algebra works on one thread meanwhile."""
