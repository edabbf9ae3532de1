"""Grid of distances and approach speeds, and the motion between two frames."""

from functools import lru_cache

import numpy as np

from taxel.types import FloatArray

EDGES_M = np.concatenate([np.arange(0.0, 6e-3, 2.5e-4), np.arange(6e-3, 18.5e-3, 1e-3)])
"""Edges of the distance bins, metres: 0.25 mm wide up to 6 mm, where distances are resolved, 1 mm wide beyond."""

CENTRES_M = 0.5 * (EDGES_M[1:] + EDGES_M[:-1])
"""Centres of the G distance bins, f64[G], metres."""
WIDTHS_M = np.diff(EDGES_M)

SPEEDS_M_S = 1e-3 * np.array([-150, -80, -40, -15, 0, 10, 20, 32, 46, 62, 82, 110, 150, 210], dtype=np.float64)
"""The V approach speeds of the grid, f64[V], metres per second; at a positive speed the distance decreases. The
fingertips of a hand that closes reach at most some 200 mm/s."""

ACCELERATION_M_S2 = 0.2
"""Standard deviation of the acceleration, independent between frames (chosen: a target that brakes from 50 mm/s within
12 mm has 0.1 m/s^2). With a larger value, the estimated speed follows faster and its interval is wider."""

ARRIVAL_SPEED_M_S = 0.1
"""Mean speed of an arriving target (chosen: speeds of hands and objects in a grasp, 10 to 200 mm/s)."""

JUMP_RATE_HZ = 0.2
"""Rate at which the speed changes abruptly to any other value, for example in a collision, hertz."""

ARRIVAL_TIME_S = 10.0
"""Mean time until a target arrives in front of an idle board (chosen). Detecting a target then requires that it
explains the frames a few hundred times better than its absence does."""

SIDE_ARRIVAL_SHARE = 0.1
"""Share of targets that arrive from the side, at any distance and speed; the others arrive from the front."""

SHAPE_TIME_S = 0.5
"""Time constant with which the estimated shape of a target is forgotten, seconds. No template equals the target
exactly: with an unlimited memory, small differences between templates would accumulate over the frames until one
template excludes the others, and the interval would be too narrow."""

LEAVING_TIME_S = 3.0
"""Mean time until a target disappears sideways, seconds."""

DT_STEP_S = 0.002
MAX_DT_S = 0.5
"""Intervals between frames are rounded to multiples of `DT_STEP_S`, so that transitions can be cached, and limited to
`MAX_DT_S`."""


class Transition:
    """Transition probabilities between the states of a target within one time interval; V speeds, G distance bins.

    shift: f32[V, G, G], from bin to bin at each speed. contact, far: f32[V, G], probabilities of reaching the skin and
    of leaving the grid. speed: f32[V, V], from speed to speed. arrival: f32[V, G], distribution of a target that has
    arrived. arrival_share, leaving_share: probabilities that a target arrives, and disappears sideways. shape_share:
    probability that the estimated shape is forgotten.
    """

    def __init__(self, dt_s: float) -> None:
        """Compute the transition probabilities of the target's distance, speed and presence for an interval of `dt_s`
        seconds.
        """
        travel = SPEEDS_M_S * dt_s
        # Each bin moves by `travel` towards the skin; its share below 0 touches the skin, its share above the last edge
        # leaves the grid, and its overlap with the bins of the grid stays there.
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
    """Return the transition for an interval in seconds, rounded and limited as `DT_STEP_S` states, from a cache."""
    return _get_rounded_transition(max(1, round(min(dt_s, MAX_DT_S) / DT_STEP_S)))


def compute_speed_widths() -> FloatArray:
    """Compute the widths of the speed bins, f64[V], metres per second."""
    return np.gradient(SPEEDS_M_S)


def _compute_speed_change(dt_s: float) -> FloatArray:
    """Compute the transition probabilities of the speed in an interval, f64[V, V]: rows before, columns after it."""
    widths = compute_speed_widths()
    # A quarter of the bin's width is added in quadrature: on a coarse grid, the probability would otherwise never
    # leave a bin.
    spread = np.sqrt((ACCELERATION_M_S2 * dt_s) ** 2 + (0.25 * widths) ** 2)
    difference = (SPEEDS_M_S[None, :] - SPEEDS_M_S[:, None]) / spread[:, None]
    drift = np.exp(-0.5 * difference**2) * widths
    drift /= drift.sum(axis=1, keepdims=True)
    jump = -np.expm1(-dt_s * JUMP_RATE_HZ)
    return np.asarray((1.0 - jump) * drift + jump * widths / widths.sum())


def _compute_arrival(travel: FloatArray) -> FloatArray:
    """Compute the distribution of speed and distance of a target that arrived within the interval, f64[V, G].

    The target arrives from beyond the grid, or from the side. travel: f64[V], distance at each speed within the
    interval, metres.
    """
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
