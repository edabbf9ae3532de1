"""How a campaign tells how far it is."""

from __future__ import annotations

from collections.abc import Callable

Progress = Callable[[int, int], object]
"""Called with how many grasps are finished, and of how many."""


def silent(finished: int, of: int) -> None:
    """Say nothing."""
