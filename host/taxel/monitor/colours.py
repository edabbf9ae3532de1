"""The colours of signals: viridis, with a step at the threshold so that an active taxel is seen at once.

Viridis (van der Walt and Smith, 2015) rises evenly in lightness, so that colour-blind people read it too. Inactive
taxels use its darkest part, active ones its upper half.
"""

import numpy as np
from numpy.typing import NDArray

VIRIDIS = ("440154", "482878", "3e4989", "31688e", "26828e", "1f9e89", "35b779", "6ece58", "b5de2b", "fde725")
"""Ten even steps of the map."""

STEPS = 48
"""Colours of the scale; the table has one more, for what is not known."""

UNKNOWN = STEPS
_GREY = (150, 150, 150)
QUIET_STEPS = 12
"""Steps below the threshold."""

_QUIET_TOP = 0.28  # place on the map that an inactive taxel reaches
_ACTIVE_BOTTOM = 0.5

LEAST_TOP = 2.0
"""The scale ends at so many thresholds or above: a calm skin looks calm."""


def _table() -> NDArray[np.uint8]:
    anchors = np.array([[int(code[i : i + 2], 16) for i in (0, 2, 4)] for code in VIRIDIS], dtype=float)
    place = np.concatenate(
        [np.linspace(0.0, _QUIET_TOP, QUIET_STEPS), np.linspace(_ACTIVE_BOTTOM, 1.0, STEPS - QUIET_STEPS)]
    )
    even = np.linspace(0.0, 1.0, len(anchors))
    rows = np.column_stack([np.interp(place, even, anchors[:, channel]) for channel in range(3)])
    return np.vstack([np.rint(rows), _GREY]).astype(np.uint8)


TABLE = _table()
"""Colours u8[STEPS + 1, 3]: from no signal to the top of the scale, then grey for what is not known."""


def steps_of(signal: NDArray[np.float64], threshold: float, top: float) -> NDArray[np.intp]:
    """Row of `TABLE` for each signal [n] in counts; `top`: counts at the end of the scale, above `threshold`."""
    known = np.nan_to_num(signal, nan=0.0)
    quiet = np.clip(QUIET_STEPS * known / threshold, 0, QUIET_STEPS - 1)
    loud = QUIET_STEPS + np.clip((STEPS - QUIET_STEPS) * (known - threshold) / (top - threshold), 0, None)
    steps = np.minimum(np.where(known > threshold, loud, quiet), STEPS - 1).astype(np.intp)
    return np.where(np.isnan(signal), UNKNOWN, steps)


def linear_light(colour: NDArray[np.float64]) -> NDArray[np.float64]:
    """Amount of light of sRGB values, each 0 to 1 (IEC 61966-2-1)."""
    return np.where(colour <= 0.04045, colour / 12.92, ((colour + 0.055) / 1.055) ** 2.4)


class Scale:
    """The end of the scale: follows the largest signal up at once and down after `hold_s`, in round numbers."""

    def __init__(self, threshold: float, hold_s: float = 10.0) -> None:
        self.threshold = threshold
        self._hold_s = hold_s
        self._least = LEAST_TOP * threshold
        self._reached_s = -np.inf
        self.top = _round_up(self._least)

    def update(self, largest_signal: float, now_s: float) -> float:
        """The end of the scale, counts, given the largest signal (NaN: not known) at `now_s` seconds."""
        wanted = _round_up(max(self._least, 0.0 if np.isnan(largest_signal) else largest_signal))
        if wanted >= self.top or now_s - self._reached_s > self._hold_s:
            self.top, self._reached_s = wanted, now_s
        return self.top


def _round_up(value: float) -> float:
    """The next number of the form 1, 1.5, 2, 3, 5 or 7 times a power of ten."""
    power = 10.0 ** np.floor(np.log10(value))
    return float(next(step * power for step in (1.0, 1.5, 2.0, 3.0, 5.0, 7.0, 10.0) if step * power >= 0.999 * value))
