"""Rest positions of many rigid boards on unilateral springs: one small convex problem for each board.

The coordinates of board g are x_g = (approach, tilt, tilt), f64[3]. Its spring i has the stiffness k_i and the
compression max(0, a_i . x_g - gap_i). The rest position minimises the energy

    E(x) = sum of k_i / 2 max(0, a_i . x - gap_i)^2  -  load . x

within bounds on the tilts. E is convex and piecewise quadratic. Damped Newton steps (Levenberg-Marquardt damping) with
the active set of the previous position therefore reach the minimum after finitely many steps.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from taxel.types import BoolArray, FloatArray, IndexArray

__all__ = ["Springs", "solve_rest_positions"]


MAX_STEPS = 60
"""Upper limit of Newton steps for each board; prevents an endless loop, boards at rest stop earlier."""

STEPS_PER_CHECK = 4
"""Newton steps between two checks for convergence; boards at rest are then removed from the arrays."""

TOLERANCE = 1e-12
"""Largest gradient of E at rest, as a fraction of the load."""

INITIAL_DAMPING = 1e-6
"""First damping, as a fraction of the largest spring stiffness of the board."""

MIN_DAMPING = 1e-13
"""Smallest damping, as a fraction of the largest spring stiffness of the board; keeps the system regular."""

ENERGY_ROUNDING = 1e-14
"""Relative rounding error of E: a step that raises E by less is accepted."""


@dataclass(frozen=True, eq=False)
class Springs:
    """Unilateral springs of G rigid boards, m springs in all, sorted by board.

    group: int[m], ascending, index of each spring's board; every board has at least one spring. rows: f64[m, 3],
    compression of a spring per unit of the board's coordinates (approach and two tilts). gap: f64[m], distance that the
    spring moves before it bears load, metres. stiffness: f64[m], N/m. load: f64[G, 3], newtons; the first component,
    along the approach, is above 0. low, high: f64[G, 2], bounds of the tilts, metres.
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
        """Index of the first spring of each board, [G]."""
        return np.searchsorted(self.group, np.arange(len(self.load)))

    def select_boards(self, selection: BoolArray) -> Springs:
        """Return the springs of the boards for which `selection` bool[G] is true."""
        in_selection = selection[self.group]
        group = (np.cumsum(selection) - 1)[self.group[in_selection]]
        per_spring = (self.rows[in_selection], self.gap[in_selection], self.stiffness[in_selection])
        return Springs(group, *per_spring, self.load[selection], self.low[selection], self.high[selection])

    def compute_compression(self, x: FloatArray) -> FloatArray:
        """Compute the compression of each spring, f64[m], metres, for board coordinates x, f64[G, 3]."""
        reach = np.einsum("mi,mi->m", self.rows, x[self.group])
        return np.asarray(np.maximum(reach - self.gap, 0.0))


def solve_rest_positions(springs: Springs) -> FloatArray:
    """Find for each of G boards the position of minimal energy on its springs, f64[G, 3], metres.

    The coordinates are the travel along the approach and two tilts. A tilt without any opposing spring stays 0. If no
    tilt within the bounds balances the moments of a board, the tilt is at its bound; the force along the approach is
    balanced in every case.
    """
    x = _estimate_first_contact(springs)
    damping = INITIAL_DAMPING * np.maximum.reduceat(springs.stiffness, springs.starts)
    moving_boards = np.arange(len(x))
    for _ in range(0, MAX_STEPS, STEPS_PER_CHECK):
        subset = springs if len(moving_boards) == len(x) else springs.select_boards(_make_mask(moving_boards, len(x)))
        x[moving_boards], damping[moving_boards], is_moving = _iterate(subset, x[moving_boards], damping[moving_boards])
        moving_boards = moving_boards[is_moving]
        if not len(moving_boards):
            break
    return x


def _estimate_first_contact(springs: Springs) -> FloatArray:
    """Estimate board coordinates f64[G, 3] without tilt at which each board's first touching spring bears its load."""
    reach = np.maximum(springs.rows[:, 0], 1e-3)  # compression per metre of approach, limited against division by 0
    approach = springs.gap / reach + springs.load[springs.group, 0] / (springs.stiffness * reach**2)
    x = np.zeros((len(springs.load), 3))
    x[:, 0] = np.minimum.reduceat(approach, springs.starts)
    return x


def _iterate(springs: Springs, x: FloatArray, damping: FloatArray) -> tuple[FloatArray, FloatArray, BoolArray]:
    """Make `STEPS_PER_CHECK` Newton steps towards the positions of minimal energy of G boards.

    x: f64[G, 3], coordinates of the boards: approach and two tilts, metres. damping: f64[G], of the Levenberg-Marquardt
    method. Returns new coordinates, new damping, and bool[G], true for a board that is not yet at rest.
    """
    starts = springs.starts
    min_damping = MIN_DAMPING * np.maximum.reduceat(springs.stiffness, starts)
    energy, gradient, hessian = _compute_energy(springs, starts, x)
    for _ in range(STEPS_PER_CHECK):
        step = _compute_newton_step(springs, x, gradient, hessian, damping)
        new_energy, new_gradient, new_hessian = _compute_energy(springs, starts, x + step)
        accepted = new_energy <= energy + ENERGY_ROUNDING * np.abs(energy)
        keep = accepted[:, None]
        x, gradient = np.where(keep, x + step, x), np.where(keep, new_gradient, gradient)
        hessian, energy = np.where(keep[:, :, None], new_hessian, hessian), np.where(accepted, new_energy, energy)
        damping = np.where(accepted, np.maximum(damping * 0.01, min_damping), damping * 10.0)
    unbalanced = np.where(_find_bounded(springs, x, gradient), 0.0, np.abs(gradient)).max(axis=1)
    return x, damping, unbalanced > TOLERANCE * springs.load[:, 0]


def _compute_energy(springs: Springs, starts: IndexArray, x: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Compute the energy of G boards on their springs, f64[G], its gradient f64[G, 3] and Hessian f64[G, 3, 3].

    starts: index of the first spring of each board. x: f64[G, 3], coordinates of the boards, metres.
    """
    compression = springs.compute_compression(x)
    force = springs.stiffness * compression
    gradient = np.add.reduceat(force[:, None] * springs.rows, starts) - springs.load
    stored = np.add.reduceat(0.5 * force * compression, starts)
    active = np.where(compression > 0, springs.stiffness, 0.0)
    hessian = np.empty((len(x), 3, 3))
    for i in range(3):
        for j in range(i + 1):
            entry = np.add.reduceat(active * springs.rows[:, i] * springs.rows[:, j], starts)
            hessian[:, i, j] = hessian[:, j, i] = entry
    return stored - np.sum(springs.load * x, axis=1), gradient, hessian


def _compute_newton_step(
    springs: Springs, x: FloatArray, gradient: FloatArray, hessian: FloatArray, damping: FloatArray
) -> FloatArray:
    """Compute the damped Newton step of the coordinates of each board, f64[G, 3], clipped to the bounds of the tilts.

    x: f64[G, 3], approach and two tilts, metres. gradient f64[G, 3] and hessian f64[G, 3, 3]: of the energy. damping:
    f64[G], added to the diagonal of the Hessian.
    """
    free = ~_find_bounded(springs, x, gradient)
    system = np.where(free[:, :, None] & free[:, None, :], hessian, 0.0) + damping[:, None, None] * np.eye(3)
    step = np.linalg.solve(system, -np.where(free, gradient, 0.0)[:, :, None])[:, :, 0]
    tilt = np.clip(x[:, 1:] + step[:, 1:], springs.low, springs.high) - x[:, 1:]
    # The approach is solved again for the clipped tilts.
    approach = -(gradient[:, 0] + np.sum(hessian[:, 0, 1:] * tilt, axis=1)) / system[:, 0, 0]
    return np.column_stack([approach, tilt])


def _find_bounded(springs: Springs, x: FloatArray, gradient: FloatArray) -> BoolArray:
    """Return the coordinates that are at a bound and would move beyond it, bool[G, 3]; the approach has no bounds.

    x: f64[G, 3], approach and two tilts, metres. gradient: f64[G, 3], of the energy.
    """
    tilt, push = x[:, 1:], -gradient[:, 1:]
    bounded = ((tilt <= springs.low) & (push < 0)) | ((tilt >= springs.high) & (push > 0))
    return np.column_stack([np.zeros(len(x), dtype=bool), bounded])


def _make_mask(indices: IndexArray, length: int) -> BoolArray:
    """Return bool[length], True at the given indices."""
    mask = np.zeros(length, dtype=bool)
    mask[indices] = True
    return mask
