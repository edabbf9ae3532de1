"""A press draws the layer down around it: a dielectric of pillars gives way beside a press, with a limited slope."""

from __future__ import annotations

from typing import Final

import numpy as np

from taxel.gap.boards import BoardLayout
from taxel.gap.effects.contact_propagation import ContactPropagation
from taxel.gap.effects.effect import Array, Parameter

STEPS: Final = 3
"""Places along a taxel at which its depth is asked for."""

HERTZ: Final = 1.5
"""Force grows with this power of depth where a round body meets an elastic half-space (Hertz 1881)."""

ROWS: Final = 512
"""Moments that are worked out at a time."""


class PillarPropagation(ContactPropagation):
    """A taxel's depth is at least what any other's leaves over the way between them; its own force stays.

    spread_mm: how far a press of 1 N on a taxel reaches: force^(1 / HERTZ), which is as depth, falls by 1 over it.
    strength: share of what that adds to the others.
    """

    def __init__(self, scope: str = "hand") -> None:
        super().__init__("pillars", scope)

    def own_parameters(self) -> tuple[Parameter, ...]:
        """Spread and strength."""
        return Parameter("spread_mm", "mm", 0.3, 15.0, 2.0, 3.0), Parameter("strength", "1", 0.0, 1.5, 0.0, 0.8)

    def spread(self, board: BoardLayout, force: Array, spread_m: float, strength: float) -> Array:
        """See `ContactPropagation`."""
        depth = np.maximum(force, 0.0) ** (1.0 / HERTZ)
        drawn = np.zeros_like(depth)
        for fall in _falls(board, 1.0 / spread_m):
            drawn += _drawn_down(depth, fall) ** HERTZ / STEPS
        return np.asarray(force + strength * np.maximum(drawn - force, 0.0))


def _falls(board: BoardLayout, slope: float) -> list[Array]:
    """What is lost from each taxel (row) on the way to a near, a middle and a far place of another (column)."""
    apart, side = board.apart_m, board.pitch_m
    steps = (np.arange(STEPS) + 0.5) / STEPS * side
    return [slope * np.where(apart > 0.0, np.maximum(apart - side + step, 0.0), 0.0) for step in steps]


def _drawn_down(depth: Array, fall: Array) -> Array:
    """The deepest that any taxel of f64[r, m] leaves of itself at each, f64[r, m]; its own depth at least."""
    result = depth.copy()
    deepest = depth.max()
    for first in range(0, len(depth), ROWS):
        part = depth[first : first + ROWS]
        for source in np.flatnonzero(part.any(axis=0)):
            reached = np.flatnonzero(fall[source] < deepest)
            left = part[:, source, None] - fall[source, reached]
            rows = result[first : first + ROWS]
            rows[:, reached] = np.maximum(rows[:, reached], left)
    return result
