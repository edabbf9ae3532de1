"""Progress in a terminal: a bar for each stage of a long job."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TaskID, TextColumn, TimeElapsedColumn

Show = Callable[[str, int, int], None]
"""Told the name of a stage, how much of it is done, and of how much."""


@contextmanager
def stage_bars(console: Console | None = None, *, hidden: bool = False) -> Iterator[Show]:
    """Bars on `console`, a stage's own elapsed time beside it. None: on standard error, so that standard output stays
    what a script reads, and gone when all is done. hidden: no bars.
    """
    columns = (
        TextColumn("{task.description:<14}", markup=False),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
    )
    passing = console is None
    with Progress(
        *columns, console=console or Console(stderr=True, markup=False), transient=passing, disable=hidden
    ) as progress:
        tasks: dict[str, TaskID] = {}

        def show(stage: str, done: int, total: int) -> None:
            if stage not in tasks:
                tasks[stage] = progress.add_task(stage, total=total)
            progress.update(tasks[stage], completed=done, total=total)

        yield show
