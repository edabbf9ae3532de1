"""The rest position of many rigid boards, each on springs that only push: a small convex problem for each board.

Board g moves by x_g = (approach, tilt, tilt), f64[3]. Spring i of it is pressed by a_i . x_g - gap_i where that is
above 0, with a stiffness k_i. At rest its energy

    E(x) = sum of k_i / 2 max(0, a_i . x - gap_i)^2  -  load . x

is smallest, within bounds on the tilts. E is convex and piecewise quadratic, so damped Newton steps whose active set is
that of the last position end at the minimum after finitely many (Levenberg-Marquardt damping).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from taxel.types import FloatArray, IndexArray

__all__ = ["Springs", "rest_positions"]


MAX_STEPS = 60
ROUND = 4
"""Steps between two looks at which boards still move; the others are left out from then on."""

TOLERANCE = 1e-12
"""Largest unbalanced share of the load."""

FIRST_DAMPING = 1e-6
LEAST_DAMPING = 1e-13
"""Of one spring's stiffness."""


@dataclass(frozen=True, eq=False)
class Springs:
    """Springs of G boards, one board after the other, m in all.

    group: [m], rising, the board; every board has a spring. rows: f64[m, 3], a. gap: f64[m], metres. stiffness: f64[m],
    N/m. load: f64[G, 3], newtons; the first, along the approach, above 0. low, high: f64[G, 2], bounds of the tilts.
    """

    group: IndexArray
    rows: FloatArray
    gap: FloatArray
    stiffness: FloatArray
    load: FloatArray
    low: FloatArray
    high: FloatArray

    @property
    def starts(self) -> IndexArray:
        """First spring of each board, [G]."""
        return np.searchsorted(self.group, np.arange(len(self.load)))

    def take(self, wanted: npt.NDArray[np.bool_]) -> Springs:
        """The springs of some of the boards, bool[G]."""
        own = wanted[self.group]
        group = (np.cumsum(wanted) - 1)[self.group[own]]
        parts = (self.rows[own], self.gap[own], self.stiffness[own])
        return Springs(group, *parts, self.load[wanted], self.low[wanted], self.high[wanted])

    def pressing(self, x: FloatArray) -> FloatArray:
        """How far each spring is pressed, metres, f64[m], at positions x, f64[G, 3]."""
        reach = np.einsum("mi,mi->m", self.rows, x[self.group])
        return np.asarray(np.maximum(reach - self.gap, 0.0))


def rest_positions(springs: Springs) -> FloatArray:
    """Positions of least energy, f64[G, 3].

    A tilt that no spring opposes stays as it is. A board whose load no tilt within the bounds can balance stops at the
    bound; along the approach its load is balanced all the same.
    """
    x = _touching(springs)
    damping = FIRST_DAMPING * np.maximum.reduceat(springs.stiffness, springs.starts)
    left = np.arange(len(x))
    for _ in range(0, MAX_STEPS, ROUND):
        now = springs if len(left) == len(x) else springs.take(_mask(left, len(x)))
        x[left], damping[left], moving = _steps(now, x[left], damping[left])
        left = left[moving]
        if not len(left):
            break
    return x


def _touching(springs: Springs) -> FloatArray:
    """Positions without tilt at which the first spring of every board bears about the whole load."""
    reach = np.maximum(springs.rows[:, 0], 1e-3)
    needed = springs.gap / reach + springs.load[springs.group, 0] / (springs.stiffness * reach**2)
    x = np.zeros((len(springs.load), 3))
    x[:, 0] = np.minimum.reduceat(needed, springs.starts)
    return x


def _steps(
    springs: Springs, x: FloatArray, damping: FloatArray
) -> tuple[FloatArray, FloatArray, npt.NDArray[np.bool_]]:
    """Positions and damping after `ROUND` steps, and which boards are not at rest yet."""
    starts, floor = springs.starts, LEAST_DAMPING * np.maximum.reduceat(springs.stiffness, springs.starts)
    energy, slope, bend = _energy(springs, starts, x)
    for _ in range(ROUND):
        step = _newton_step(springs, x, slope, bend, damping)
        energy_new, slope_new, bend_new = _energy(springs, starts, x + step)
        # Rounding hides the last gains in energy, not whether they are gains.
        better = energy_new <= energy + 1e-14 * np.abs(energy)
        keep = better[:, None]
        x, slope = np.where(keep, x + step, x), np.where(keep, slope_new, slope)
        bend, energy = np.where(keep[:, :, None], bend_new, bend), np.where(better, energy_new, energy)
        damping = np.where(better, np.maximum(damping * 0.01, floor), damping * 10.0)
    unbalanced = np.where(_stopped(springs, x, slope), 0.0, np.abs(slope)).max(axis=1)
    return x, damping, unbalanced > TOLERANCE * springs.load[:, 0]


def _energy(springs: Springs, starts: IndexArray, x: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """E f64[G], its gradient f64[G, 3] and its second derivative f64[G, 3, 3]."""
    pressing = springs.pressing(x)
    force = springs.stiffness * pressing
    slope = np.add.reduceat(force[:, None] * springs.rows, starts) - springs.load
    stored = np.add.reduceat(0.5 * force * pressing, starts)
    active = np.where(pressing > 0, springs.stiffness, 0.0)
    bend = np.empty((len(x), 3, 3))
    for i in range(3):
        for j in range(i + 1):
            bend[:, i, j] = bend[:, j, i] = np.add.reduceat(active * springs.rows[:, i] * springs.rows[:, j], starts)
    return stored - np.sum(springs.load * x, axis=1), slope, bend


def _newton_step(
    springs: Springs, x: FloatArray, slope: FloatArray, bend: FloatArray, damping: FloatArray
) -> FloatArray:
    """Damped Newton step of each board, f64[G, 3], that ends within the bounds of its tilts."""
    free = ~_stopped(springs, x, slope)
    system = np.where(free[:, :, None] & free[:, None, :], bend, 0.0) + damping[:, None, None] * np.eye(3)
    step = np.linalg.solve(system, -np.where(free, slope, 0.0)[:, :, None])[:, :, 0]
    tilt = np.clip(x[:, 1:] + step[:, 1:], springs.low, springs.high) - x[:, 1:]
    # What was cut off the tilts changes the approach that belongs to them.
    approach = -(slope[:, 0] + np.sum(bend[:, 0, 1:] * tilt, axis=1)) / system[:, 0, 0]
    return np.column_stack([approach, tilt])


def _stopped(springs: Springs, x: FloatArray, slope: FloatArray) -> npt.NDArray[np.bool_]:
    """Which coordinates are held by a bound, bool[G, 3]; the approach has none."""
    tilt, push = x[:, 1:], -slope[:, 1:]
    held = ((tilt <= springs.low) & (push < 0)) | ((tilt >= springs.high) & (push > 0))
    return np.column_stack([np.zeros(len(x), dtype=bool), held])


def _mask(indices: IndexArray, length: int) -> npt.NDArray[np.bool_]:
    mask = np.zeros(length, dtype=bool)
    mask[indices] = True
    return mask
