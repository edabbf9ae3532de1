"""Colour scale of the signal: viridis, with a step in lightness at the activation threshold.

The lightness of viridis (van der Walt and Smith, 2015) increases uniformly, so that colour-blind people can read the
scale. Inactive taxels use its darkest part, active taxels its upper half.
"""

import numpy as np

from taxel.types import ByteArray, FloatArray, IndexArray

VIRIDIS = ("440154", "482878", "3e4989", "31688e", "26828e", "1f9e89", "35b779", "6ece58", "b5de2b", "fde725")
"""Ten equidistant colours of the map."""

STEPS = 48
"""Number of colours of the scale. The table has one more for unknown signals."""

UNKNOWN = STEPS
_GREY = (150, 150, 150)
INACTIVE_STEPS = 12
"""Number of colours below the threshold."""

_INACTIVE_END = 0.28  # position on the map of the largest inactive signal
_ACTIVE_START = 0.5

SMALLEST_TOP = 2.0
"""Smallest end of the scale, in thresholds. With a smaller value the noise of an untouched skin gets bright colours."""


def _build_table() -> ByteArray:
    """Build the colour table u8[STEPS + 1, 3], sRGB: inactive steps, active steps, grey for an unknown signal."""
    anchors = np.array([[int(code[i : i + 2], 16) for i in (0, 2, 4)] for code in VIRIDIS], dtype=float)
    # Positions on the map from 0 (dark) to 1 (bright); the gap between the two ranges makes active taxels distinct.
    position = np.concatenate(
        [np.linspace(0.0, _INACTIVE_END, INACTIVE_STEPS), np.linspace(_ACTIVE_START, 1.0, STEPS - INACTIVE_STEPS)]
    )
    anchor_position = np.linspace(0.0, 1.0, len(anchors))
    rows = np.column_stack([np.interp(position, anchor_position, anchors[:, channel]) for channel in range(3)])
    return np.vstack([np.rint(rows), _GREY]).astype(np.uint8)


TABLE = _build_table()
"""Colours u8[STEPS + 1, 3]: from signal 0 to the end of the scale, then grey for an unknown signal."""


def colour_steps(signal: FloatArray, threshold: float, top: float) -> IndexArray:
    """Return the row of the colour table `TABLE` for each signal.

    signal: f64[n], counts below the baseline, NaN where unknown. threshold: counts above which a taxel is active. top:
    end of the colour scale, counts, above `threshold`.
    """
    finite = np.nan_to_num(signal, nan=0.0)
    inactive = np.clip(INACTIVE_STEPS * finite / threshold, 0, INACTIVE_STEPS - 1)
    active = INACTIVE_STEPS + np.clip((STEPS - INACTIVE_STEPS) * (finite - threshold) / (top - threshold), 0, None)
    steps = np.minimum(np.where(finite > threshold, active, inactive), STEPS - 1).astype(np.intp)
    return np.where(np.isnan(signal), UNKNOWN, steps)


class ColourScale:
    """Colour scale for signals, whose end is a round number of counts.

    The end follows a larger signal at once and a smaller signal after `hold_s` seconds.
    """

    def __init__(self, threshold: float, hold_s: float = 10.0) -> None:
        """Create a colour scale with its smallest end.

        threshold: activation threshold in counts; the smallest end of the scale is `SMALLEST_TOP` times the threshold.
        hold_s: seconds for which the end of the scale stays after the last large signal.
        """
        self.threshold = threshold
        self._hold_s = hold_s
        self._smallest = SMALLEST_TOP * threshold
        self._reached_s = -np.inf
        self.top = _round_up(self._smallest)

    def update(self, largest_signal: float, now_s: float) -> float:
        """Return the end of the colour scale, counts, for the largest signal (NaN: unknown) at `now_s` seconds."""
        target = _round_up(max(self._smallest, 0.0 if np.isnan(largest_signal) else largest_signal))
        if target >= self.top or now_s - self._reached_s > self._hold_s:
            self.top, self._reached_s = target, now_s
        return self.top


def _round_up(value: float) -> float:
    """Return the next larger number of the form 1, 1.5, 2, 3, 5 or 7 times a power of ten."""
    power = 10.0 ** np.floor(np.log10(value))
    return float(next(step * power for step in (1.0, 1.5, 2.0, 3.0, 5.0, 7.0, 10.0) if step * power >= 0.999 * value))
