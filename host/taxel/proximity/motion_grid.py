"""Grid of distances and approach speeds, and the motion between two frames."""

from functools import lru_cache

import numpy as np

from taxel.types import FloatArray

EDGES_M = np.concatenate([np.arange(0.0, 6e-3, 2.5e-4), np.arange(6e-3, 18.5e-3, 1e-3)])
"""Limits of the bins of distance: a quarter of a millimetre where a distance is resolved, a millimetre beyond."""

CENTRES_M = 0.5 * (EDGES_M[1:] + EDGES_M[:-1])
WIDTHS_M = np.diff(EDGES_M)

SPEEDS_M_S = 1e-3 * np.array([-150, -80, -40, -15, 0, 10, 20, 32, 46, 62, 82, 110, 150, 210], dtype=np.float64)
"""Approach speeds; positive: the distance decreases. A hand closes with at most some 200 mm/s at its fingertips."""

ACCELERATION_M_S2 = 0.2
"""Standard deviation of the acceleration, independent between frames (chosen: a target that brakes from 50 mm/s on 12
mm has 0.1 m/s^2). A larger value makes the speed follow faster, and its interval wider."""

ARRIVAL_SPEED_M_S = 0.1
"""Mean speed of an arriving target (chosen: speeds of hands and objects in a grasp, 10 to 200 mm/s)."""

JUMP_RATE_HZ = 0.2
"""Rate at which the speed takes any other value, such as at a collision."""

ARRIVAL_TIME_S = 10.0
"""Mean time until a target arrives in front of a board without one (chosen; detection needs evidence of a factor of a
few hundred against the absence of a target)."""

SIDE_ARRIVAL_SHARE = 0.1
"""Share of the arrivals from the side, at any distance and speed."""

SHAPE_TIME_S = 0.5
"""Memory of the shape of a target. No template equals the target: with an unlimited memory, small differences between
templates would add up over the frames until one of them excludes the others, and the interval would be too narrow."""

LEAVING_TIME_S = 3.0
"""Mean time until a target disappears sideways."""

DT_STEP_S = 0.002
MAX_DT_S = 0.5
"""Intervals between frames are rounded to `DT_STEP_S` for the tables of transitions; a longer interval counts as
`MAX_DT_S`."""


class Transition:
    """Motion within an interval `dt` by the mass that each bin receives.

    shift: f32[V, G, G], from bin to bin at each speed. contact: f32[V, G], share that reaches the skin. far: f32[V,
    G], share that leaves the grid. speed: f32[V, V], change of the speed. arrival: f32[V, G], distribution of an
    arriving target. arrival_share: probability of an arrival.
    """

    def __init__(self, dt_s: float) -> None:
        """Compute the tables of an interval, seconds."""
        travel = SPEEDS_M_S * dt_s
        low, high = EDGES_M[:-1] - travel[:, None], EDGES_M[1:] - travel[:, None]
        overlap = np.minimum(high[:, :, None], EDGES_M[1:]) - np.maximum(low[:, :, None], EDGES_M[:-1])
        self.shift = (np.maximum(overlap, 0.0) / WIDTHS_M[:, None]).astype(np.float32)
        self.contact = (np.clip(-low, 0.0, WIDTHS_M) / WIDTHS_M).astype(np.float32)
        self.far = (np.clip(high - EDGES_M[-1], 0.0, WIDTHS_M) / WIDTHS_M).astype(np.float32)
        self.speed = _compute_speed_change(dt_s).astype(np.float32)
        self.arrival = _compute_arrival(travel).astype(np.float32)
        self.arrival_share = float(-np.expm1(-dt_s / ARRIVAL_TIME_S))
        self.shape_share = float(-np.expm1(-dt_s / SHAPE_TIME_S))
        self.leaving_share = float(-np.expm1(-dt_s / LEAVING_TIME_S))


@lru_cache(maxsize=64)
def _get_rounded_transition(steps: int) -> Transition:
    return Transition(steps * DT_STEP_S)


def get_transition(dt_s: float) -> Transition:
    """Return the transition of an interval, seconds, from a cache."""
    return _get_rounded_transition(max(1, round(min(dt_s, MAX_DT_S) / DT_STEP_S)))


def compute_speed_widths() -> FloatArray:
    """Widths of the bins of speed, f64[V], metres per second."""
    return np.gradient(SPEEDS_M_S)


def _compute_speed_change(dt_s: float) -> FloatArray:
    """Probabilities f64[V, V] of each speed after an interval, by the speed before it."""
    widths = compute_speed_widths()
    # The variance of a bin's own width is added, so that a coarse grid diffuses rather than holds its speed.
    spread = np.sqrt((ACCELERATION_M_S2 * dt_s) ** 2 + (0.25 * widths) ** 2)
    difference = (SPEEDS_M_S[None, :] - SPEEDS_M_S[:, None]) / spread[:, None]
    drift = np.exp(-0.5 * difference**2) * widths
    drift /= drift.sum(axis=1, keepdims=True)
    jump = -np.expm1(-dt_s * JUMP_RATE_HZ)
    return np.asarray((1.0 - jump) * drift + jump * widths / widths.sum())


def _compute_arrival(travel: FloatArray) -> FloatArray:
    """Distribution f64[V, G] of a target that has just arrived: from beyond the grid, or from the side."""
    widths = compute_speed_widths()
    entered = np.clip(
        np.minimum(EDGES_M[1:], EDGES_M[-1]) - np.maximum(EDGES_M[:-1], EDGES_M[-1] - travel[:, None]), 0, 1
    )
    frequency = widths * np.exp(-np.abs(SPEEDS_M_S) / ARRIVAL_SPEED_M_S)
    from_front = entered * (frequency * (SPEEDS_M_S > 0))[:, None]
    from_side = frequency[:, None] * WIDTHS_M
    return np.asarray(
        (1.0 - SIDE_ARRIVAL_SHARE) * from_front / from_front.sum() + SIDE_ARRIVAL_SHARE * from_side / from_side.sum()
    )
