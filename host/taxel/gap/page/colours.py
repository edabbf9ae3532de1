"""The colour scale of the unrolled hand.

Both ramps have uniform steps of OKLab lightness (Ottosson 2020), so that they are readable without hue, by colour-blind
readers and in a grey print. Their hue is that of the accent colour of the page, 258 degrees.
A taxel without excess is pale on a light page and dark on a dark page.
"""

import math

LIGHT = (
    "#ebeff4",
    "#ccdcf3",
    "#adc9f1",
    "#90b5ed",
    "#73a2e7",
    "#588ede",
    "#3e7ad3",
    "#2467c5",
    "#0453b4",
    "#034495",
    "#023476",
    "#00265a",
)
DARK = (
    "#23272c",
    "#2a3648",
    "#314665",
    "#385783",
    "#4167a1",
    "#4a79be",
    "#558bda",
    "#639ef4",
    "#7eb2fe",
    "#a0c6fe",
    "#c0d9ff",
    "#e0ecff",
)
STEPS = len(LIGHT)

# The scale ends at this multiple of the floor or above, so that noise does not fill the scale if there is no gap.
MIN_TOP_FLOORS = 3.0


def compute_top(excess: tuple[list[float], list[float]], floor: float) -> float:
    """Return the upper end of the colour scale, counts: the root of the largest excess of a taxel, before or after.

    excess: before and after, counts squared, [n] (n taxels) each; NaN without data. floor: floor of the gap, counts;
    the scale ends at `MIN_TOP_FLOORS` times the floor or above, and above 0, because the end is a divisor.
    """
    largest = max((value for values in excess for value in values if not math.isnan(value)), default=0.0)
    return max(math.sqrt(max(largest, 0.0)), MIN_TOP_FLOORS * floor, math.ulp(1.0))


def select_step(excess: float, top: float) -> int:
    """Return the step of the colour ramp, 0 to STEPS - 1, for an excess in counts squared.

    The step is proportional to the root of the excess, and 0 for an excess of at most 0. top: upper end of the scale,
    counts.
    """
    return min(STEPS - 1, int(STEPS * math.sqrt(max(excess, 0.0)) / top))


def format_ramp_css(colours: tuple[str, ...]) -> str:
    """Return the colours of a ramp as CSS custom properties."""
    return "".join(f"--q{step}:{colour};" for step, colour in enumerate(colours))


def format_step_css() -> str:
    """Return a CSS class for each step of the ramp."""
    return "".join(f".q{step}{{fill:var(--q{step})}}" for step in range(STEPS))
