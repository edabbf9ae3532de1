"""Numbers of failed grasps and of repeated attempts per object in a dataset."""

import os
from collections import Counter
from dataclasses import dataclass, field

from taxel.recording.grasp_dataset import GraspDataset


@dataclass(frozen=True)
class OutcomeCount:
    """Outcomes of the grasps of one object.

    grasps: number of grasps whose outcome the dataset states. failures: number of failed grasps by kind of failure
    (`taxel.campaign.failure`). repeated: number of attempts beyond the first, over all grasps.
    """

    grasps: int
    repeated: int
    failures: dict[str, int] = field(default_factory=dict)

    @property
    def failed(self) -> int:
        """Number of failed grasps."""
        return sum(self.failures.values())

    def __str__(self) -> str:
        """Format the numbers as one phrase, such as "10 of 54 grasps failed (10 turned), 0 attempts repeated"."""
        kinds = ", ".join(f"{count} {kind}" for kind, count in self.failures.items())
        return (
            f"{self.failed} of {self.grasps} grasps failed{f' ({kinds})' if kinds else ''}, "
            f"{self.repeated} attempts repeated"
        )


def count_outcomes(path: str | os.PathLike[str]) -> dict[str, OutcomeCount]:
    """Count the grasps, the failed grasps and the repeated attempts of a dataset, by name of the object.

    Only grasps with a stated outcome are counted; an object without such a grasp is not in the result. Recordings of a
    physical hand state no outcome.
    """
    grasps: Counter[str] = Counter()
    repeated: Counter[str] = Counter()
    failures: dict[str, Counter[str]] = {}
    with GraspDataset(path) as data:
        for grasp in data:
            if grasp.failure is None:
                continue
            grasps[grasp.object] += 1
            repeated[grasp.object] += (grasp.attempts or 1) - 1
            failures.setdefault(grasp.object, Counter()).update([grasp.failure] if grasp.has_failed else [])
    return {
        name: OutcomeCount(grasps[name], repeated[name], dict(sorted(failures[name].items())))
        for name in sorted(grasps)
    }
