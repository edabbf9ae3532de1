"""The colour scale of the unrolled hand.

Both ramps have uniform steps of OKLab lightness (Ottosson 2020), so that they are readable without hue, by colour-blind
readers and in a grey print. A taxel without excess is pale on a light page and dark on a dark page.
"""

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

# The scale ends at this multiple of the floor or above, so that noise does not fill the scale if there is no gap.
MIN_TOP_FLOORS = 3.0


def compute_top(excess: tuple[list[float], list[float]], floor: float) -> float:
    """Upper end of the scale, counts: the root of the largest excess before or after [n] (counts squared).

    floor: of the gap, counts; the scale ends at `MIN_TOP_FLOORS` times the floor or above.
    """
    largest = max((value for values in excess for value in values if not math.isnan(value)), default=0.0)
    return max(math.sqrt(max(largest, 0.0)), MIN_TOP_FLOORS * floor, math.ulp(1.0))


def select_step(excess: float, top: float) -> int:
    """Step of the ramp, 0 to STEPS - 1, of an excess (counts squared): linear in its root; 0 for an excess up to 0."""
    return min(STEPS - 1, int(STEPS * math.sqrt(max(excess, 0.0)) / top))


def format_ramp_css(colours: tuple[str, ...]) -> str:
    """The ramp as CSS custom properties."""
    return "".join(f"--q{step}:{colour};" for step, colour in enumerate(colours))


def format_step_css() -> str:
    """A CSS class for each step."""
    return "".join(f".q{step}{{fill:var(--q{step})}}" for step in range(STEPS))
