"""The colours of the unrolled hand.

Both ramps are even steps of OKLab lightness (Ottosson 2020), so that they are read as more or less without hue: by
colour-blind people and on a grey print. Nothing is pale on a light page and dim on a dark one.
"""

from __future__ import annotations

import math

LIGHT = (
    "#efede7",
    "#e8d6b6",
    "#e3be8a",
    "#dfa461",
    "#de853d",
    "#d66730",
    "#c84a35",
    "#b3313e",
    "#991f45",
    "#7a144f",
    "#581450",
    "#381147",
)
DARK = (
    "#2f2d33",
    "#4a3253",
    "#6b3663",
    "#8d3b68",
    "#b14061",
    "#cd4f52",
    "#e06645",
    "#ef813e",
    "#f79d45",
    "#fcba5a",
    "#fcd681",
    "#fef0a9",
)
STEPS = len(LIGHT)

# The scale reaches at least this many floors, so that a hand without a gap looks as calm as it is.
LEAST_TOP_FLOORS = 3.0


def top_of(excess: tuple[list[float], list[float]], floor: float) -> float:
    """The end of the scale, counts: the root of the largest excess before or after [n] (counts squared).

    `floor`: of the gap, counts; the scale ends at three times that or above.
    """
    largest = max((value for values in excess for value in values if not math.isnan(value)), default=0.0)
    return max(math.sqrt(max(largest, 0.0)), LEAST_TOP_FLOORS * floor, math.ulp(1.0))


def step_of(excess: float, top: float) -> int:
    """The step of the ramp, 0 to STEPS - 1, of an excess (counts squared): even in its root, 0 at or below none."""
    return min(STEPS - 1, int(STEPS * math.sqrt(max(excess, 0.0)) / top))


def ramp_css(colours: tuple[str, ...]) -> str:
    """The ramp as custom properties."""
    return "".join(f"--q{step}:{colour};" for step, colour in enumerate(colours))


def step_css() -> str:
    """A class for each step."""
    return "".join(f".q{step}{{fill:var(--q{step})}}" for step in range(STEPS))
