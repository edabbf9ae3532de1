"""Progress bars on a terminal: one bar for each stage of a long job."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    ProgressColumn,
    SpinnerColumn,
    TaskID,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

ShowStage = Callable[[str, int, int], None]
"""Called with the name of a stage, the number of completed steps, and the number of all steps."""
ShowCount = Callable[[int, int], None]
"""Called with the number of completed items and the number of all items."""


@contextmanager
def stage_bars(console: Console | None = None, *, hidden: bool = False) -> Iterator[ShowStage]:
    """Show one progress bar for each stage of a task, with its elapsed time. Yields the progress callback.

    console: None: standard error, and the bars disappear at the end, so that a script can read standard output. hidden:
    show no bars.
    """
    columns = (
        TextColumn("{task.description:<14}", markup=False),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
    )
    is_transient = console is None
    with Progress(*columns, console=console or _stderr_console(), transient=is_transient, disable=hidden) as progress:
        tasks: dict[str, TaskID] = {}

        def show(stage: str, done: int, total: int) -> None:
            """Show the progress of a stage; a bar is added at the first call."""
            if stage not in tasks:
                tasks[stage] = progress.add_task(stage, total=total)
            progress.update(tasks[stage], completed=done, total=total)

        yield show


@contextmanager
def count_bar(console: Console, title: str, unit: str) -> Iterator[ShowCount]:
    """Show one bar with the number of completed items, the elapsed and the remaining time. Yields the callback.

    unit: name of the items in the plural, such as "grasps".
    """
    columns: tuple[ProgressColumn, ...] = (
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn(unit),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=console) as progress:
        task = progress.add_task(title, total=None)
        yield lambda done, total: progress.update(task, completed=done, total=total)


@contextmanager
def time_bar(title: str, seconds: float) -> Iterator[Callable[[float, str], None]]:
    """Show one bar on standard error for work that lasts `seconds`; the bar is erased at the end.

    Yields the callback, whose arguments are the elapsed seconds and the text before the bar.
    """
    columns = (
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        TextColumn("{task.completed:.1f} of {task.total:g} s"),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=_stderr_console(), transient=True) as progress:
        task = progress.add_task(title, total=seconds)
        yield lambda elapsed_s, text: progress.update(task, completed=min(elapsed_s, seconds), description=text)


@contextmanager
def spinner(title: str) -> Iterator[Callable[[str], None]]:
    """Show a spinner on standard error for work of unknown length; the spinner is erased at the end.

    Yields a function that sets its title.
    """
    columns = (SpinnerColumn(), TextColumn("{task.description}", markup=False), TimeElapsedColumn())
    with Progress(*columns, console=_stderr_console(), transient=True) as progress:
        task = progress.add_task(title)
        yield lambda text: progress.update(task, description=text)


def _stderr_console() -> Console:
    """Create a console that prints to standard error without markup."""
    return Console(stderr=True, markup=False)
