"""Check that a simulated dataset has the taxels of a report."""

from __future__ import annotations

from typing import Final

import numpy as np

from taxel.gap.errors import GapInputError
from taxel.gap.report.reading import ReportedGap
from taxel.hand.errors import format_path
from taxel.recording.grasp_dataset import GraspDataset
from taxel.recording.grasp_format import SIM

SAME_HAND_REMEDY: Final = "give the simulation of the hand that was diagnosed: same taxels in the same order"
"""Remedy of error messages about other taxels."""


def check_hand(gap: ReportedGap, data: GraspDataset, path: str) -> None:
    """Check that a dataset is simulated and has the taxels of a report, in the same order. Raises GapInputError
    otherwise.

    gap: content of the report. path: path of the dataset, for the error message.
    """
    if data.source != SIM:
        remedy = "give the simulation, because effects are never added to a recording"
        raise GapInputError(f"{path}: /source", f'"{SIM}"', f'"{data.source}"', remedy)
    report = format_path(gap.path)
    if data.taxels.n != len(gap.sensor):
        expected = f"{len(gap.sensor)} taxels as in {report}"
        raise GapInputError(f"{path}: /taxels", expected, str(data.taxels.n), SAME_HAND_REMEDY)
    for name in ("sensor", "tx", "rx"):
        expected_values, values = getattr(gap, name), getattr(data.taxels, name)
        if (expected_values != values).any():
            k = int(np.flatnonzero(expected_values != values)[0])
            expected = f"{int(expected_values[k])} as in {report}"
            raise GapInputError(f"{path}: /taxels/{name}[{k}]", expected, str(int(values[k])), SAME_HAND_REMEDY)
