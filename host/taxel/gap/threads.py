"""Work of a diagnosis on both cores, where there is enough of it."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from typing import Final, TypeVar

from taxel.gap.state import State

Item = TypeVar("Item")
Result = TypeVar("Result")

THREADS: Final = 2
WORTH_THREADS: Final = 200_000
"""Values of the simulator's signal, [Q, K, n], below which threads wait for each other longer than they work."""


def in_threads(state: State, work: Callable[[Item], Result], items: Iterable[Item]) -> list[Result]:
    """What `work` gives for each item, in their order."""
    if state.drop.size < WORTH_THREADS:
        return [work(item) for item in items]
    with ThreadPoolExecutor(THREADS) as pool:
        return list(pool.map(work, items))
