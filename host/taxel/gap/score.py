"""The score of a model, and whether another's is surely better.

Few sessions tell little of what scatters from one to the next: with four, three degrees of freedom. The grasps in them
tell more. What the sessions scatter is therefore drawn towards what it would be if grasps scattered by themselves, as
variances of few samples are towards a common one (Smyth 2004, moderated t), after that was raised by as much as
sessions of these data scatter together (`Judge.together`).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from taxel.gap.chances import student_tail
from taxel.gap.metric import jackknife_error
from taxel.types import FloatArray

LEAST_FAMILY: Final = 1e-3
"""Share of the score below which a family of features says nothing."""

GRASPS_FREEDOM: Final = 6.0
"""Degrees of freedom that grasps add to those of sessions, at most: with more, the few cells that make most of a gain
would be taken for many."""


@dataclass(frozen=True, eq=False)
class Score:
    """value: of all sessions. left: f64[S, C], without each session, each cell's part. families: f64[5], of each family
    of features alone. together: how much more the sessions' sums over cells scatter than cells by themselves would.
    """

    value: float
    left: FloatArray
    families: FloatArray
    together: float = 1.0

    def share_of(self, start: Score, base: Score, least: FloatArray | float = 0.0) -> float:
        """The greatest share of what a family was at the start that has gone since `base`: noise must not hide what
        else is there by being so clear. least: f64[5], of a family at the start; what is smaller says nothing.
        """
        there = start.families > np.maximum(LEAST_FAMILY * max(start.value, 0.0), least)
        gone = base.families - self.families
        return float(np.max(gone[there] / start.families[there], initial=0.0))

    def gone_of(self, other: Score) -> float:
        """Share of what `other` has left that is gone with this one; 0 where it has left nothing."""
        return 1.0 - self.value / other.value if other.value > 0 else 0.0

    def better_than(self, other: Score) -> tuple[float, float]:
        """By how much this score is lower, and the p-value of that being chance."""
        gain = other.value - self.value
        steps = other.left - self.left
        if len(steps) < 3:
            return gain, 0.5 if gain > 0 else 1.0
        error, freedom = moderated_error(steps, max(self.together, other.together))
        if error <= 0:
            return gain, 0.0 if gain > 0 else 1.0
        return gain, student_tail(gain / error, freedom)


def moderated_error(left: FloatArray, together: float) -> tuple[float, float]:
    """Standard error of a sum over cells, and its degrees of freedom. left: f64[S, C], without each session."""
    own, apart, cells = scatter2(left)
    sessions = len(left) - 1.0
    grasps = min(GRASPS_FREEDOM, sessions * (cells - 1.0))
    freedom = sessions + grasps
    return float(np.sqrt((sessions * own + grasps * max(together, 1.0) * apart) / freedom)), freedom


def scatter2(left: FloatArray) -> tuple[float, float, float]:
    """Squared standard error of a sum over cells, from what the sessions' sums scatter; from what each cell scatters;
    and how many cells make the latter, as if all were alike. left: f64[S, C], without each session.
    """
    own = float(jackknife_error(left.sum(axis=1)) ** 2)
    each = jackknife_error(left) ** 2
    apart = float(each.sum())
    return own, apart, apart**2 / float((each**2).sum()) if apart > 0 else 1.0
