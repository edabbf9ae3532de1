"""Force over depth of a taxel's layer, estimated from the simulated data, and pressures that follow from this law.

Each taxel is divided into 9 pieces (`PIECES_PER_SIDE` squared). The pressure on a piece is stated in newtons: the force
of a taxel whose whole area has the pressure of the piece. The force of a taxel is the mean pressure of its pieces.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Final

import numpy as np
from scipy.optimize import nnls

from taxel.gap.fitting.state import State
from taxel.types import FloatArray

CONTACT_RANGE_M: Final = 0.006
"""Shift beyond the largest depth of a law up to which a board can approach, metres. Pieces that remain out of contact
at the largest shift are omitted, which saves time."""

EXTRAPOLATION_M: Final = 1.0
"""Length of the extrapolation beyond the last point of a law, metres. Chosen: no layer is so thick."""

COARSE_SHIFTS: Final = 16
"""Number of shifts on the grid that brackets the solution."""

MAX_ITERATIONS: Final = 40
"""Largest number of iterations of the root search."""

FORCE_TOLERANCE: Final = 1e-11
"""Relative error of a board's net force at which the root search ends."""

BOARDS_PER_BATCH: Final = 32
"""Number of boards that are solved together. Chosen: the arrays of a batch fit into the cache of a core."""

MIN_FORCE_STEP_N: Final = 1e-4
"""Smallest increase of force between successive points of a law, newtons. It makes the law invertible."""

PIECE_LAW_KNOTS: Final = 12
"""Number of knots of the piecewise linear law of the pieces."""

REFINEMENTS: Final = 4
"""Number of alternations between pressures and fit of the law of the pieces. Chosen: the law changes little
afterwards."""

PRIOR_WEIGHT: Final = 0.1
"""Weight of the present slopes of the law, relative to the root mean square column of the design matrix. It determines
the slopes at depths at which no piece is loaded. Selected on the simulated datasets of five worlds of the blind
check, which contain no hidden cause."""


@dataclass(frozen=True, eq=False)
class ForceDepthLaw:
    """Force over depth of a taxel's layer, both f64[k], increasing from 0. depth_m: metres. force_n: newtons."""

    depth_m: FloatArray
    force_n: FloatArray

    @cached_property
    def _extrapolated(self) -> tuple[FloatArray, FloatArray]:
        """Depth and force of the law with one more point far beyond the last one, on the line through the last two
        points, so that `np.interp` extrapolates linearly.
        """
        slope = (self.force_n[-1] - self.force_n[-2]) / (self.depth_m[-1] - self.depth_m[-2])
        return np.append(self.depth_m, self.depth_m[-1] + EXTRAPOLATION_M), np.append(
            self.force_n, self.force_n[-1] + slope * EXTRAPOLATION_M
        )

    def compute_force(self, depth: FloatArray) -> FloatArray:
        """Return the force, newtons, at depths in metres: 0 below depth 0, extrapolated linearly beyond the last
        point.
        """
        return np.asarray(np.interp(depth, *self._extrapolated))

    def compute_depth(self, force: FloatArray) -> FloatArray:
        """Return the depth, metres, at forces in newtons: the inverse of `compute_force`."""
        return np.asarray(np.interp(force, *self._extrapolated[::-1]))


def estimate_taxel_law(state: State) -> ForceDepthLaw:
    """Estimate the force-depth law of whole taxels: medians of force and depth in bins of depth, made increasing.

    With fewer than 200 loaded values, or without bins of different depth (rigid contact), the law is a straight line.
    Its slope is the contact stiffness of the simulator's sensor model; without this value, the median ratio of force to
    depth; without loaded values, 1000 N/m. A value is loaded if the taxel penetrates the object with more than 0.02 N.
    The state must contain force and separation.
    """
    force, separation = state.base.force, state.base.separation
    assert force is not None
    assert separation is not None
    loaded = (separation < 0) & (force > 0.02)
    depth, newtons = -separation[loaded], force[loaded]
    stated = state.sensor_model.contact_stiffness_n_per_m
    stiffness = stated or (float(np.median(newtons / depth)) if len(depth) else 1000.0)
    line = ForceDepthLaw(np.array([0.0, 1e-3]), np.array([0.0, 1e-3 * stiffness]))
    if len(depth) < 200:
        return line
    # 24 bins with equal numbers of values; the deepest 0.5 % of the values are omitted.
    edges = np.quantile(depth, np.linspace(0.0, 0.995, 25))
    depths, forces = [0.0], [0.0]
    for low, high in pairwise(edges.tolist()):
        in_bin = (depth >= low) & (depth <= high)
        if in_bin.sum() >= 5 and np.median(depth[in_bin]) > depths[-1] + 1e-6:
            depths.append(float(np.median(depth[in_bin])))
            forces.append(max(float(np.median(newtons[in_bin])), forces[-1] + MIN_FORCE_STEP_N))
    return ForceDepthLaw(np.array(depths), np.array(forces)) if len(depths) > 1 else line


def fit_piece_law(law: ForceDepthLaw, contacts: Sequence[tuple[FloatArray, FloatArray]]) -> ForceDepthLaw:
    """Fit the force-depth law of the pieces of taxels to the forces of the taxels in the simulation.

    The result is `law` if no fitted law has a smaller error. law: law of whole taxels. contacts: for each loaded board,
    the depths of the pieces, f64[m, 9] (m taxels of the board, 9 pieces of each), metres, and the forces of the taxels,
    f64[m], newtons. Only the differences of the depths within a board are used.

    A taxel that is loaded unevenly, for example by a ridge or at a rim, has a different force at the depth of its
    centre than an evenly loaded taxel. Two steps alternate: each board is shifted towards the object until the present
    law gives its net force, which determines the depths of the pieces; then the slopes of a piecewise linear law are
    fitted to the forces of the taxels at these depths (non-negative least squares).
    """
    if not contacts:
        return law
    best, min_error = law, _compute_squared_force_error(law, contacts)
    taxel_forces = np.concatenate([force for _, force in contacts])
    for _ in range(REFINEMENTS):
        depths = [law.compute_depth(pressure) for pressure in _solve_simulated_pressures(law, contacts)]
        knots = np.linspace(0.0, max(float(depth.max()) for depth in depths), PIECE_LAW_KNOTS)
        if knots[-1] <= 0.0:
            return best
        width = np.diff(knots)
        # A row is the derivative of one taxel's force by the slope of each segment between two knots.
        rows = np.concatenate([np.clip(depth[..., None] - knots[:-1], 0.0, width).mean(axis=1) for depth in depths])
        prior_slope = np.diff(law.compute_force(knots)) / width
        weight = PRIOR_WEIGHT * np.sqrt((rows**2).sum(axis=0).mean())
        slope = nnls(np.vstack([rows, weight * np.eye(len(width))]), np.append(taxel_forces, weight * prior_slope))[0]
        steps = np.maximum(slope * width, MIN_FORCE_STEP_N)
        law = ForceDepthLaw(knots, np.concatenate([[0.0], np.cumsum(steps)]))
        error = _compute_squared_force_error(law, contacts)
        if error < min_error:
            best, min_error = law, error
    return best


def _compute_squared_force_error(law: ForceDepthLaw, contacts: Sequence[tuple[FloatArray, FloatArray]]) -> float:
    """Return the sum over all taxels of the squared difference between predicted and simulated force, newtons^2.

    law: law of the pieces. contacts: for each loaded board, depths of the pieces f64[m, 9] (m taxels of the board, 9
    pieces of each), metres, and simulated forces of the taxels f64[m], newtons. The predicted force of a taxel is the
    mean of the pressures on its pieces, which are stated in newtons (see the module's docstring).
    """
    pressures = _solve_simulated_pressures(law, contacts)
    errors = [pressure.mean(axis=1) - force for pressure, (_, force) in zip(pressures, contacts, strict=True)]
    return float((np.concatenate(errors) ** 2).sum())


def _solve_simulated_pressures(
    law: ForceDepthLaw, contacts: Sequence[tuple[FloatArray, FloatArray]]
) -> list[FloatArray]:
    """Return the pressures f64[m, 9] (m taxels of the board, 9 pieces of each), newtons, on the pieces of each contact
    at its simulated net force.

    law: law of the pieces. contacts: for each loaded board, depths of the pieces f64[m, 9], metres, and simulated
    forces of the taxels f64[m], newtons.
    """
    nets = np.array([[force.sum()] for _, force in contacts])
    return [pressure[0] for pressure in solve_board_pressures(law, [depth for depth, _ in contacts], nets)]


def solve_board_pressures(law: ForceDepthLaw, depths: Sequence[FloatArray], net_forces: FloatArray) -> list[FloatArray]:
    """Return the pressures on the pieces of N boards, N times f64[L, m, 9] (L levels, m taxels of the board), newtons,
    at L net forces of each board.

    Each board is shifted towards the object until the sum of its forces equals the net force. law: law of the pieces.
    depths: N times f64[m, 9], metres, depth of each piece before the shift; negative outside the object. net_forces:
    f64[N, L], newtons.
    """
    batches = [slice(first, first + BOARDS_PER_BATCH) for first in range(0, len(depths), BOARDS_PER_BATCH)]
    return [pressure for batch in batches for pressure in _solve_batch(law, depths[batch], net_forces[batch])]


def _solve_batch(law: ForceDepthLaw, depths: Sequence[FloatArray], net_forces: FloatArray) -> list[FloatArray]:
    """Return the result of `solve_board_pressures` for the boards of one batch, which are solved together."""
    deepest = np.array([depth.max() for depth in depths])
    # At the largest shift the deepest piece lies `CONTACT_RANGE_M` beyond the last point of the law.
    max_shift = -deepest + float(law.depth_m[-1]) + CONTACT_RANGE_M
    is_near = [depth + shift > 0.0 for depth, shift in zip(depths, max_shift, strict=True)]
    near_depth = np.concatenate([depth[near] for depth, near in zip(depths, is_near, strict=True)])
    count = np.array([np.count_nonzero(near) for near in is_near])
    first, board = np.cumsum(count) - count, np.repeat(np.arange(len(depths)), count)
    # The force of a taxel is the mean over its 9 pieces, so the sum over the pieces is 9 times the net force.
    target = net_forces * np.array([depth.shape[1] for depth in depths])[:, None]

    def compute_pressure(shift: FloatArray) -> FloatArray:
        """Return the pressures on all pieces that can come into contact, newtons, at shifts f64[N, k] of the boards."""
        return law.compute_force(near_depth[:, None] + shift[board])

    shift = _solve_shifts(
        lambda shift: np.add.reduceat(compute_pressure(shift), first, axis=0), -deepest, max_shift, target
    )
    result = []
    for depth, near, pressure in zip(depths, is_near, np.split(compute_pressure(shift), first[1:]), strict=True):
        all_pieces = np.zeros((target.shape[1], *depth.shape))
        all_pieces[:, near] = pressure.T
        result.append(all_pieces)
    return result


def _solve_shifts(
    compute_sum: Callable[[FloatArray], FloatArray], min_shift: FloatArray, max_shift: FloatArray, target: FloatArray
) -> FloatArray:
    """Return the shifts f64[N, L] (L levels), metres, of N boards at which their sums of pressures equal `target`,
    f64[N, L].

    compute_sum: sums of pressures, f64[N, k], at shifts f64[N, k]; they increase with the shift. min_shift, max_shift:
    f64[N]. If the target exceeds the sum at the largest shift, the largest shift is returned. A coarse grid brackets
    each solution; the Illinois variant of the method of false position (Dowell and Jarratt 1971) refines it.
    """
    coarse = np.linspace(min_shift, max_shift, COARSE_SHIFTS, axis=1)
    coarse_sum = compute_sum(coarse)
    right = np.clip((coarse_sum[:, None] <= target[..., None]).sum(axis=2), 1, COARSE_SHIFTS - 1)
    row = np.arange(len(target))[:, None]
    low, high = coarse[row, right - 1], coarse[row, right]
    below, above = coarse_sum[row, right - 1] - target, coarse_sum[row, right] - target
    # Without a sign change the target exceeds the sum at the largest shift.
    shift, is_open, last_moved = high, above > 0.0, np.zeros(target.shape, int)
    for _ in range(MAX_ITERATIONS if is_open.any() else 0):
        slope = np.where(is_open, above - below, 1.0)
        shift = np.where(is_open, high - above * (high - low) / slope, shift)
        error = compute_sum(shift) - target
        is_open &= np.abs(error) > FORCE_TOLERANCE * target
        if not is_open.any():
            break
        moves_low, moves_high = is_open & (error < 0.0), is_open & (error > 0.0)
        above = np.where(moves_low & (last_moved > 0), 0.5 * above, np.where(moves_high, error, above))
        below = np.where(moves_high & (last_moved < 0), 0.5 * below, np.where(moves_low, error, below))
        low, high = np.where(moves_low, shift, low), np.where(moves_high, shift, high)
        last_moved = np.where(moves_low, 1, np.where(moves_high, -1, last_moved))
    return np.asarray(shift)
