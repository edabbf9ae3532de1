"""What chance adds to a simulated grasp: noise, drifts that differ from grasp to grasp, lost frames.

Draws are balanced among the repeats of an approach: two (the last three of an odd number) are made together so that
their sum is zero, while each alone is as it was drawn. So the mean of a few repeats stays where it was.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Final

import numpy as np
from numpy.typing import NDArray

from taxel.gap.data.reading import LEAST_BASELINE, Groups, Phases
from taxel.recording.grasp_format import Phase
from taxel.types import FloatArray

NOISE: Final = 1
DRIFT: Final = 2
LOST: Final = 3
"""Purposes: each draws from its own stream, so that one effect does not change another's draws."""


@dataclass(frozen=True)
class Chance:
    """The draws of one grasp. cell: number of its (object, approach). repeat: which of `repeats` grasps of that."""

    seed: int
    condition: int
    repeat: int
    repeats: int

    def stream(self, *purpose: int) -> np.random.Generator:
        """Of this grasp alone."""
        return self._stream(self.repeat, *purpose)

    def balanced(self, draw: Callable[[np.random.Generator], FloatArray], *purpose: int) -> FloatArray:
        """What `draw` makes of a stream, balanced with the repeats that it is drawn with."""
        group = min(self.repeat // 2, max(self.repeats // 2, 1) - 1)
        first = 2 * group
        last = first + 2 if first + 4 <= self.repeats else self.repeats
        together = [draw(self._stream(number, *purpose)) for number in range(first, last)]
        own = together[self.repeat - first]
        count = len(together)
        if count == 1:
            return own
        return np.asarray(np.sqrt(count / (count - 1.0)) * (own - np.mean(together, axis=0)))

    def _stream(self, repeat: int, *purpose: int) -> np.random.Generator:
        return np.random.default_rng([self.seed, self.condition, repeat, *purpose])


def noise(parts: FloatArray, groups: Groups, frames: int, chance: Chance) -> FloatArray:
    """Counts, f64[T, n]. parts: f64[4, n], standard deviations of each taxel's own noise and of what its TX line, RX
    line and board have in common.
    """
    result = np.zeros((frames, parts.shape[1]))
    own = np.arange(parts.shape[1])
    for number, (deviation, member) in enumerate(zip(parts, (own, groups.tx, groups.rx, groups.sensor), strict=True)):
        if deviation.any():
            shape = (frames, int(member.max()) + 1)
            result += deviation * chance.balanced(partial(_normal, shape), NOISE, number)[:, member]
    return result


def _normal(shape: tuple[int, ...], rng: np.random.Generator) -> FloatArray:
    return rng.normal(size=shape)


def drifts(values: FloatArray, late: float, lasts: float, chance: Chance) -> FloatArray:
    """Slope and scatter of a baseline drift f64[2, G] as one grasp has them: a slope of its own, and no scatter.

    late: share of the slope that is reached, in the mean, where the scatter was measured. lasts: the grasp's time over
    that in which the slope was fitted.
    """
    drawn = chance.balanced(partial(_normal, values.shape[1:]), DRIFT)
    return np.stack([values[0] * lasts + values[1] * drawn / late, np.zeros(values.shape[1])])


def lost(grasp: Phases, valid: NDArray[np.bool_], missing: FloatArray, chance: Chance) -> NDArray[np.bool_]:
    """Frames that still arrive, bool[T, s]. valid: those that did. missing: f64[s], share of all that are lost besides.

    A board that is not silent throughout keeps the baseline frames without which nothing of it could be measured.
    """
    result = valid.copy()
    frames = len(valid)
    for board in np.flatnonzero(missing > 0.0):
        rng = chance.stream(LOST, int(board))
        there = np.flatnonzero(valid[:, board])
        count = int(missing[board] * frames + rng.random())
        if count < len(there):
            rest = there[grasp.phase[there] == Phase.BASELINE][:LEAST_BASELINE]
            there = rng.permutation(np.setdiff1d(there, rest))
        result[there[:count], board] = False
    return result


def repeated(raw: NDArray[np.uint16], valid: NDArray[np.bool_], sensor: NDArray[np.intp]) -> NDArray[np.uint16]:
    """Counts u16[T, n] where a frame that did not arrive repeats the last one, or is 0 before the first."""
    row = np.where(valid, np.arange(len(valid))[:, None], -1)
    last = np.maximum.accumulate(row, axis=0)[:, sensor]
    return np.where(last >= 0, np.take_along_axis(raw, np.maximum(last, 0), axis=0), 0).astype(np.uint16)
