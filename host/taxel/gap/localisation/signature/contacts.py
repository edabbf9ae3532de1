"""What differs from session to session, and from press to press within a session: no part of the excess, which is what
sessions have in common, yet no mere scatter either.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from taxel.gap.data.pair import Pair
from taxel.gap.features.chances import compute_fisher_survival, compute_student_survival
from taxel.types import FloatArray

LEAST_ENERGY: Final = 0.1
"""Of a board's largest over cells: a cell that presses it less tells no factor."""


Found = tuple[float, float | None, bool, float]
"""Size, p-value, whether it goes one way all along, and the size's standard error where it is not taken off already."""

_NOTHING: Final[Found] = (0.0, None, False, 0.0)


@dataclass(frozen=True, eq=False)
class Change:
    """A change of sensitivity.

    size: relative, of the hand; by what a session's last press differs from its first, or the standard deviation
    between sessions. part: what it would add to the squared gap, counts^2. boards: columns of those that show it on
    their own, the largest first. trend: whether sessions go one way all along.
    """

    name: str
    size: float
    part: float
    p_value: float | None
    boards: tuple[int, ...]
    trend: bool = False


def changes(pair: Pair, hold: FloatArray, counts2: float) -> list[Change]:
    """Both kinds. hold: f64[C, n], predicted drops. counts2: mean square of predicted drops as the gap counts them."""
    factor, weight = _factors(pair, hold)
    whole = np.einsum("rb,rb->r", np.nan_to_num(factor), weight) / np.where(
        weight.any(axis=1), weight.sum(axis=1), np.nan
    )
    columns = np.column_stack([whole, factor])
    session = np.searchsorted(pair.sessions, pair.real.session)
    result = []
    for name, test, scale in (("session", _between, 1.0), ("presses", _within, 1.0 / 12.0)):
        found = [test(columns[:, k], pair.real.condition, session) for k in range(columns.shape[1])]
        tested = [one[1] for one in found if one[1] is not None]
        p_value = min(1.0, min(tested) * len(tested)) if tested else None
        boards = [k for k in range(len(found) - 1) if _small(found[k + 1][1], len(tested))]
        boards.sort(key=lambda k: -abs(found[k + 1][0]))
        size, _, trend, error = found[0]
        part = scale * max(size**2 - error**2, 0.0) * counts2
        result.append(Change(name, size, part, p_value, tuple(boards), trend))
    return result


def _small(p_value: float | None, tests: int) -> bool:
    return p_value is not None and p_value * tests < 0.05


def _factors(pair: Pair, hold: FloatArray) -> tuple[FloatArray, FloatArray]:
    """By how much each board of each press drops more than predicted, f64[R, s], NaN where it was hardly pressed; and
    the squared drops that tell it.
    """
    sensor, count = pair.groups.sensor, len(pair.sensors.address)
    belongs = (sensor[:, None] == np.arange(count)).astype(np.float64)
    predicted = np.nan_to_num(hold)[pair.real.condition]
    known = np.isfinite(pair.real.hold)
    squares = np.where(known, predicted**2, 0.0) @ belongs
    shared = np.where(known, predicted * np.nan_to_num(pair.real.hold), 0.0) @ belongs
    told = squares > LEAST_ENERGY * squares.max(axis=0, initial=0.0)
    return np.where(told, shared / np.where(told, squares, 1.0), np.nan), np.where(told, squares, 0.0)


def _dummies(condition: NDArray[np.intp]) -> FloatArray:
    return np.asarray(condition[:, None] == np.unique(condition)).astype(np.float64)


def _left(values: FloatArray, columns: FloatArray) -> FloatArray:
    """Values less their least squares fit by columns."""
    return np.asarray(values - columns @ np.linalg.lstsq(columns, values, rcond=None)[0])


def _between(factor: FloatArray, condition: NDArray[np.intp], session: NDArray[np.intp]) -> Found:
    """Standard deviation between sessions beyond what cells scatter, and the F test of it (two-way, additive)."""
    known = np.isfinite(factor)
    keys, number = np.unique(np.column_stack([condition, session])[known], axis=0, return_inverse=True)
    mean = np.bincount(number.ravel(), factor[known]) / np.bincount(number.ravel()) if len(keys) else np.zeros(0)
    sessions = len(np.unique(keys[:, 1])) if len(keys) else 0
    conditions = len(np.unique(keys[:, 0])) if len(keys) else 0
    degrees_of_freedom = len(keys) - conditions - sessions + 1
    if sessions < 2 or degrees_of_freedom < 1:
        return _NOTHING
    alone, both = _dummies(keys[:, 0]), np.hstack([_dummies(keys[:, 0]), _dummies(keys[:, 1])])
    coefficients = np.linalg.lstsq(both, mean, rcond=None)[0]
    error = float(np.sum((mean - both @ coefficients) ** 2)) / degrees_of_freedom
    between = (float(np.sum(_left(mean, alone) ** 2)) - degrees_of_freedom * error) / (sessions - 1)
    size = float(np.sqrt(max(between - error, 0.0) * sessions / len(keys)))
    level = np.diff(coefficients[conditions:])
    steady = sessions >= 4 and bool((level > 0).all() or (level < 0).all())
    trend = size * (1.0 if level.sum() > 0 else -1.0) if steady else size
    if error <= 0:
        return trend, 0.0 if between > 0 else 1.0, steady, 0.0
    return trend, compute_fisher_survival(between / error, sessions - 1, degrees_of_freedom), steady, 0.0


def _within(factor: FloatArray, condition: NDArray[np.intp], session: NDArray[np.intp]) -> Found:
    """Change from a session's first press to its last, with cells and sessions apart; the larger of two p-values, of
    ordinary least squares and of one that lets presses of a session go together (Liang and Zeger 1986).
    """
    known = np.isfinite(factor)
    place = np.zeros(len(factor))
    for number in np.unique(session):
        own = np.flatnonzero(session == number)  # grasps are in order of time
        place[own] = np.linspace(-0.5, 0.5, len(own)) if len(own) > 1 else 0.0
    columns = np.hstack([_dummies(condition[known]), _dummies(session[known])]) if known.any() else np.zeros((0, 1))
    sessions = len(np.unique(session[known]))
    degrees_of_freedom = int(known.sum()) - len(np.unique(condition[known])) - sessions
    if degrees_of_freedom < 2:
        return _NOTHING
    moved, value = _left(place[known], columns), _left(factor[known], columns)
    square = float(moved @ moved)
    if square < 1e-9:
        return _NOTHING
    slope = float(moved @ value) / square
    rest = value - slope * moved
    error = float(np.sqrt(rest @ rest / degrees_of_freedom / square))
    p = 2.0 * compute_student_survival(abs(slope) / error, degrees_of_freedom) if error > 0 else 0.0
    if sessions < 3:
        return slope, None, False, error
    scores = np.bincount(session[known], moved * rest)
    robust = float(np.sqrt(sessions / (sessions - 1) * scores @ scores)) / square
    other = 2.0 * compute_student_survival(abs(slope) / robust, sessions - 1) if robust > 0 else 0.0
    return slope, max(p, other), False, max(error, robust)
