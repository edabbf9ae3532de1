"""Check that a simulated dataset is of the hand of a report."""

from __future__ import annotations

from typing import Final

import numpy as np

from taxel.gap.errors import GapInputError
from taxel.gap.report.reading import ReportedGap
from taxel.hand.errors import format_path
from taxel.recording.grasp_dataset import GraspDataset
from taxel.recording.grasp_format import SIM

SAME_HAND: Final = "give the simulation of the hand that was diagnosed: same taxels in the same order"


def check_hand(found: ReportedGap, data: GraspDataset, path: str) -> None:
    """Raise GapInputError for a dataset that is no simulation, or that has other taxels than the report.

    path: of the dataset, as the message states it.
    """
    if data.source != SIM:
        remedy = "give the simulation, because effects are never added to a recording"
        raise GapInputError(f"{path}: /source", f'"{SIM}"', f'"{data.source}"', remedy)
    report = format_path(found.path)
    if data.taxels.n != len(found.sensor):
        expected = f"{len(found.sensor)} taxels as in {report}"
        raise GapInputError(f"{path}: /taxels", expected, str(data.taxels.n), SAME_HAND)
    for name in ("sensor", "tx", "rx"):
        ours, theirs = getattr(found, name), getattr(data.taxels, name)
        if (ours != theirs).any():
            k = int(np.flatnonzero(ours != theirs)[0])
            expected = f"{int(ours[k])} as in {report}"
            raise GapInputError(f"{path}: /taxels/{name}[{k}]", expected, str(int(theirs[k])), SAME_HAND)
