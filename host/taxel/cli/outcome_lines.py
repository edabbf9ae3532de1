"""Lines about failed grasps in the output of `taxel grasp` and `taxel show`."""

from collections.abc import Iterable
from pathlib import Path

from rich.console import Console

from taxel.campaign.outcomes import count_outcomes


def print_outcomes(console: Console, paths: Iterable[Path]) -> None:
    """Print one line for each dataset and object: failed grasps by kind of failure, and repeated attempts.

    A dataset that states no outcomes, such as a recording of a physical hand, gives no line.
    """
    for path in paths:
        for name, count in count_outcomes(path).items():
            console.print(f"{path}: {name}: {count}", soft_wrap=True)
