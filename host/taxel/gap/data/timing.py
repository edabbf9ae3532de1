"""Time nodes of a pair of recordings, from the durations of the phases and the frame rate of the slower recording."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain
from typing import Final

import numpy as np
from numpy.typing import NDArray

from taxel.gap.data.losses import list_lost_phases
from taxel.gap.data.readable import ReadableDataset, ReadableGrasp
from taxel.gap.data.reading import require_hold
from taxel.gap.data.time_grid import TimeGrid, choose_duration
from taxel.gap.errors import GapInputError
from taxel.recording.grasp_format import Phase

SHARED_PHASES: Final = (Phase.CLOSING, Phase.HOLD, Phase.RELEASE, Phase.RECOVERY)
"""Phases that are compared."""

MIN_DISTINCT_TIME_SHARE: Final = 0.25
"""Smallest share of the frames of a grasp whose time differs from the time of the frame before (chosen). A file with a
smaller share in a grasp is refused, because its times do not resolve the contact."""

MIN_CHECKED_FRAMES: Final = 20
"""Smallest number of frame intervals of a grasp for which the share of distinct times is checked (chosen).
Fewer intervals do not show the resolution of the clock."""


@dataclass(frozen=True, eq=False)
class Timing:
    """Time nodes and durations of a pair of recordings.

    Attributes:
        time_grid: the time nodes.
        frame_s: frame period of the slower recording, seconds.
        lost_phases: sentences for the report on phases that some grasps lack.
        durations: for each phase, the shortest duration among the grasps of each condition, f64[C] (C conditions),
            seconds; 0 if a grasp lacks the phase.
    """

    time_grid: TimeGrid
    frame_s: float
    lost_phases: list[str]
    durations: dict[Phase, NDArray[np.float64]]


def measure_timing(
    sides: Sequence[tuple[ReadableDataset, Sequence[ReadableGrasp]]], conditions: Sequence[tuple[str, str]]
) -> Timing:
    """Return the time nodes and durations of two recordings.

    sides: dataset and grasps of the hand, then of the simulator. Raises GapInputError for a grasp without hold, for
    constant time in hold, and for a file in which most frames share their time with the previous frame.
    """
    durations: dict[Phase, list[list[float]]] = {shared: [[] for _ in sides] for shared in SHARED_PHASES}
    rate = np.inf
    for side, (data, grasps) in enumerate(sides):
        for grasp in grasps:
            require_hold(grasp, str(data.path))
            time, phase = grasp.timestamp, grasp.phase
            step = _compute_frame_period(grasp, str(data.path))
            if step > 0:
                rate = min(rate, 1.0 / step)
            for shared in SHARED_PHASES:
                phase_times = time[phase == shared]
                duration_s = float(phase_times[-1] - phase_times[0] + step) if len(phase_times) else 0.0
                durations[shared][side].append(duration_s)
            if durations[Phase.HOLD][side][-1] <= 0:
                where = f"{data.path}: /grasps/{grasp.id}/timestamp"
                raise GapInputError(where, "increasing time in hold", "constant time", "correct the file")
    number = {key: index for index, key in enumerate(conditions)}
    condition = [number[grasp.object, grasp.approach] for _, grasps in sides for grasp in grasps]
    shortest = {
        shared: _compute_shortest(len(conditions), condition, [*chain.from_iterable(both)])
        for shared, both in durations.items()
    }
    evaluated = {shared: choose_duration(seconds) for shared, seconds in shortest.items() if seconds.min() > 0}
    rate = rate if np.isfinite(rate) else 1.0
    names = [(str(data.path), [grasp.id for grasp in grasps]) for data, grasps in sides]
    return Timing(TimeGrid.from_durations(evaluated, rate), 1.0 / rate, list_lost_phases(names, durations), shortest)


def _compute_shortest(conditions: int, condition: Sequence[int], seconds: Sequence[float]) -> NDArray[np.float64]:
    """Return the shortest duration of each of C conditions, f64[C], seconds.

    conditions: C. condition: index of the condition of each grasp. seconds: duration of each grasp.
    """
    shortest = np.full(conditions, np.inf)
    np.minimum.at(shortest, np.asarray(condition, np.intp), seconds)
    return shortest


def _compute_frame_period(grasp: ReadableGrasp, path: str) -> float:
    """Return the median frame period of a grasp, seconds; 0 for a single frame.

    Raises GapInputError if most frames have the same time as the previous frame. path: path of the file, for the
    message.
    """
    steps = np.diff(grasp.timestamp)
    if len(steps) >= MIN_CHECKED_FRAMES and np.count_nonzero(steps) < MIN_DISTINCT_TIME_SHARE * len(steps):
        where = f"{path}: /grasps/{grasp.id}/timestamp"
        found = f"{np.count_nonzero(steps) + 1} times for {len(steps) + 1} frames"
        raise GapInputError(where, "a different time for each frame", found, "record with a finer clock")
    return float(np.median(steps)) if len(steps) else 0.0
