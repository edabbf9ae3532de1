"""Progress callback of the campaigns."""

from collections.abc import Callable

Progress = Callable[[int, int], object]
"""Called with the number of finished grasps and the total number of grasps."""


def no_progress(finished: int, total: int) -> None:
    """Do nothing: the default progress callback of the campaigns."""
