"""When two recordings are looked at: as long as their presses last, as finely as the slower one was recorded."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain
from typing import Final

import numpy as np
from numpy.typing import NDArray

from taxel.gap.data.clock import Clock, usual_duration
from taxel.gap.data.losses import lost_phases
from taxel.gap.data.readable import ReadableDataset, ReadableGrasp
from taxel.gap.data.reading import require_hold
from taxel.gap.errors import GapInputError
from taxel.recording.grasp_format import Phase

SHARED_PHASES: Final = (Phase.CLOSING, Phase.HOLD, Phase.RELEASE, Phase.RECOVERY)

LEAST_TIMES: Final = 0.25
"""Share of frames with a time of their own, below which nobody knows when anything happened."""

FEW_FRAMES: Final = 20
"""Fewer say nothing of a clock."""


@dataclass(frozen=True, eq=False)
class Timing:
    """clock: nodes of time. frame_s: frame period of the slower recording. lost: phases that some grasps lack, in
    words. lasts: seconds of each phase that all grasps of a cell have, f64[C].
    """

    clock: Clock
    frame_s: float
    lost: list[str]
    lasts: dict[Phase, NDArray[np.float64]]


def timing_of(
    sides: Sequence[tuple[ReadableDataset, Sequence[ReadableGrasp]]], conditions: Sequence[tuple[str, str]]
) -> Timing:
    """Of both recordings' grasps. Raises GapInputError where a file's times say nothing, or a grasp has no hold."""
    durations: dict[Phase, list[list[float]]] = {wanted: [[] for _ in sides] for wanted in SHARED_PHASES}
    rate = np.inf
    for side, (data, grasps) in enumerate(sides):
        for grasp in grasps:
            require_hold(grasp, str(data.path))
            time, phase = grasp.timestamp, grasp.phase
            step = _frame_s(grasp, str(data.path))
            if step > 0:
                rate = min(rate, 1.0 / step)
            for wanted in SHARED_PHASES:
                own = time[phase == wanted]
                durations[wanted][side].append(float(own[-1] - own[0] + step) if len(own) else 0.0)
            if durations[Phase.HOLD][side][-1] <= 0:
                where = f"{data.path}: /grasps/{grasp.id}/timestamp"
                raise GapInputError(where, "increasing time in hold", "constant time", "correct the file")
    number = {key: index for index, key in enumerate(conditions)}
    condition = [number[grasp.object, grasp.approach] for _, grasps in sides for grasp in grasps]
    lasts = {
        wanted: _least(len(conditions), condition, [*chain.from_iterable(both)]) for wanted, both in durations.items()
    }
    usable = {wanted: usual_duration(own) for wanted, own in lasts.items() if own.min() > 0}
    rate = rate if np.isfinite(rate) else 1.0
    names = [(str(data.path), [grasp.id for grasp in grasps]) for data, grasps in sides]
    return Timing(Clock.of(usable, rate), 1.0 / rate, lost_phases(names, durations), lasts)


def _least(conditions: int, condition: Sequence[int], seconds: Sequence[float]) -> NDArray[np.float64]:
    """The shortest of each cell's, f64[C]."""
    found = np.full(conditions, np.inf)
    np.minimum.at(found, np.asarray(condition, np.intp), seconds)
    return found


def _frame_s(grasp: ReadableGrasp, path: str) -> float:
    """Median frame period, seconds. Raises GapInputError where most frames share their time with others."""
    steps = np.diff(grasp.timestamp)
    if len(steps) >= FEW_FRAMES and np.count_nonzero(steps) < LEAST_TIMES * len(steps):
        where = f"{path}: /grasps/{grasp.id}/timestamp"
        found = f"{np.count_nonzero(steps) + 1} times for {len(steps) + 1} frames"
        raise GapInputError(where, "a different time for each frame", found, "record with a finer clock")
    return float(np.median(steps)) if len(steps) else 0.0
