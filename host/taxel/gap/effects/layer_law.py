"""Force over depth of a taxel's layer: what the simulator's own data tell of it, and presses by that law."""

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

NEAR_M: Final = 0.006
"""A piece that is farther from contact than this stays out of it."""

FAR_M: Final = 1.0
"""Beyond the deepest press that a simulator has made: no layer is so thick."""

COARSE: Final = 16
MOST_STEPS: Final = 40
CLOSE: Final = 1e-11
"""Relative error of a board's net force."""

TOGETHER: Final = 32
"""Boards that are pressed in one go: what they need stays in a core's cache."""

LEAST_STEP_N: Final = 1e-4
"""From one point of a law to the next: it rises."""

KNOTS: Final = 12
"""Depths at which a law of pieces bends."""

REFINED: Final = 4
"""Rounds of presses and fits, after which a law of pieces changes little."""

HELD: Final = 0.1
"""Weight of the law that single taxels tell, beside what all of them say in the middle: it settles depths at which no
piece is pressed."""


@dataclass(frozen=True, eq=False)
class Law:
    """Force over depth of a taxel's layer, as the simulator's own data tell: both f64[k], rising from 0."""

    depth_m: FloatArray
    force_n: FloatArray

    @cached_property
    def _longer(self) -> tuple[FloatArray, FloatArray]:
        """Depth and force with one more point, far along the last tangent."""
        slope = (self.force_n[-1] - self.force_n[-2]) / (self.depth_m[-1] - self.depth_m[-2])
        return np.append(self.depth_m, self.depth_m[-1] + FAR_M), np.append(
            self.force_n, self.force_n[-1] + slope * FAR_M
        )

    def force(self, depth: FloatArray) -> FloatArray:
        """Newtons; none where nothing is pressed, beyond the last point along its tangent."""
        return np.asarray(np.interp(depth, *self._longer))

    def depth(self, force: FloatArray) -> FloatArray:
        """Metres; the same read the other way."""
        return np.asarray(np.interp(force, *self._longer[::-1]))


def law_of(state: State) -> Law:
    """The layer's law: medians of force over depth, made rising; a straight line where too few taxels are pressed, or
    hardly, as by a rigid contact.
    """
    force, separation = state.base.force, state.base.separation
    assert force is not None
    assert separation is not None
    pressed = (separation < 0) & (force > 0.02)
    depth, newtons = -separation[pressed], force[pressed]
    stated = state.model.contact_stiffness_n_per_m
    stiffness = stated or (float(np.median(newtons / depth)) if len(depth) else 1000.0)
    line = Law(np.array([0.0, 1e-3]), np.array([0.0, 1e-3 * stiffness]))
    if len(depth) < 200:
        return line
    edges = np.quantile(depth, np.linspace(0.0, 0.995, 25))
    middle, level = [0.0], [0.0]
    for low, high in pairwise(edges.tolist()):
        own = (depth >= low) & (depth <= high)
        if own.sum() >= 5 and np.median(depth[own]) > middle[-1] + 1e-6:
            middle.append(float(np.median(depth[own])))
            level.append(max(float(np.median(newtons[own])), level[-1] + LEAST_STEP_N))
    return Law(np.array(middle), np.array(level)) if len(middle) > 1 else line


def law_of_pieces(law: Law, contacts: Sequence[tuple[FloatArray, FloatArray]]) -> Law:
    """The law by which pieces have to bear for the taxels' forces to be what the simulator says; `law`, of whole
    taxels, where none does better. presses: depths f64[m, 9] and forces f64[m] of each board's taxels.

    A taxel whose middle is pressed in by so much bears more at a ridge and less at a rim than one that is pressed all
    over. Presses by a law tell how deep each piece is; slopes of a piecewise linear law, none negative, are then fitted
    to the forces (least squares), in turn.
    """
    if not contacts:
        return law
    best, least = law, _error(law, contacts)
    wanted = np.concatenate([force for _, force in contacts])
    for _ in range(REFINED):
        depths = [law.depth(pressure) for pressure in _as_pressed(law, contacts)]
        knots = np.linspace(0.0, max(float(depth.max()) for depth in depths), KNOTS)
        if knots[-1] <= 0.0:
            return best
        width = np.diff(knots)
        rows = np.concatenate([np.clip(depth[..., None] - knots[:-1], 0.0, width).mean(axis=1) for depth in depths])
        known = np.diff(law.force(knots)) / width
        weight = HELD * np.sqrt((rows**2).sum(axis=0).mean())
        slope = nnls(np.vstack([rows, weight * np.eye(len(width))]), np.append(wanted, weight * known))[0]
        steps = np.maximum(slope * width, LEAST_STEP_N)
        law = Law(knots, np.concatenate([[0.0], np.cumsum(steps)]))
        error = _error(law, contacts)
        if error < least:
            best, least = law, error
    return best


def _error(law: Law, contacts: Sequence[tuple[FloatArray, FloatArray]]) -> float:
    """Sum of squares [N^2] of what a law says otherwise than the simulator."""
    pressed = _as_pressed(law, contacts)
    off = [pressure.mean(axis=1) - force for pressure, (_, force) in zip(pressed, contacts, strict=True)]
    return float((np.concatenate(off) ** 2).sum())


def _as_pressed(law: Law, contacts: Sequence[tuple[FloatArray, FloatArray]]) -> list[FloatArray]:
    """Pressures f64[m, 9] of each press at its own net force."""
    nets = np.array([[force.sum()] for _, force in contacts])
    return [pressure[0] for pressure in pressed_together(law, [depth for depth, _ in contacts], nets)]


def pressed_together(law: Law, depths: Sequence[FloatArray], net_forces: FloatArray) -> list[FloatArray]:
    """Pressures f64[L, m, 9] of the pieces of N boards, as the force of a taxel that is pressed so all over, when each
    board approaches until they bear its net forces. depths: N times f64[m, 9], how far each piece is pressed in.
    net_forces: f64[N, L], newtons.
    """
    groups = [slice(first, first + TOGETHER) for first in range(0, len(depths), TOGETHER)]
    return [pressed for own in groups for pressed in _pressed(law, depths[own], net_forces[own])]


def _pressed(law: Law, depths: Sequence[FloatArray], net_forces: FloatArray) -> list[FloatArray]:
    deepest = np.array([depth.max() for depth in depths])
    most = -deepest + float(law.depth_m[-1]) + NEAR_M
    is_near = [depth + shift > 0.0 for depth, shift in zip(depths, most, strict=True)]
    near = np.concatenate([depth[own] for depth, own in zip(depths, is_near, strict=True)])
    count = np.array([np.count_nonzero(own) for own in is_near])
    first, board = np.cumsum(count) - count, np.repeat(np.arange(len(depths)), count)
    wanted = net_forces * np.array([depth.shape[1] for depth in depths])[:, None]

    def force(shift: FloatArray) -> FloatArray:
        return law.force(near[:, None] + shift[board])

    shift = _shifts(lambda shift: np.add.reduceat(force(shift), first, axis=0), -deepest, most, wanted)
    result = []
    for depth, own, pressed in zip(depths, is_near, np.split(force(shift), first[1:]), strict=True):
        every = np.zeros((wanted.shape[1], *depth.shape))
        every[:, own] = pressed.T
        result.append(every)
    return result


def _shifts(
    bears: Callable[[FloatArray], FloatArray], least: FloatArray, most: FloatArray, wanted: FloatArray
) -> FloatArray:
    """Of N boards those between `least` and `most`, f64[N], at which they bear what is wanted, f64[N, L]. bears: what
    they do at shifts f64[N, k], in the same shape.

    The force rises with the shift. Many shifts at once tell about where; then a false position that halves the end
    which stays (the Illinois rule).
    """
    coarse = np.linspace(least, most, COARSE, axis=1)
    known = bears(coarse)
    right = np.clip((known[:, None] <= wanted[..., None]).sum(axis=2), 1, COARSE - 1)
    row = np.arange(len(wanted))[:, None]
    low, high = coarse[row, right - 1], coarse[row, right]
    below, above = known[row, right - 1] - wanted, known[row, right] - wanted
    # What would bear more than at the deepest shift stays there.
    middle, missed, stays = high, above > 0.0, np.zeros(wanted.shape, int)
    for _ in range(MOST_STEPS if missed.any() else 0):
        slope = np.where(missed, above - below, 1.0)
        middle = np.where(missed, high - above * (high - low) / slope, middle)
        value = bears(middle) - wanted
        missed &= np.abs(value) > CLOSE * wanted
        if not missed.any():
            break
        raised, lowered = missed & (value < 0.0), missed & (value > 0.0)
        above = np.where(raised & (stays > 0), 0.5 * above, np.where(lowered, value, above))
        below = np.where(lowered & (stays < 0), 0.5 * below, np.where(raised, value, below))
        low, high = np.where(raised, middle, low), np.where(lowered, middle, high)
        stays = np.where(raised, 1, np.where(lowered, -1, stays))
    return np.asarray(middle)
