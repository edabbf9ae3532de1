"""Incremental least-squares line through the latest readings of one board's clock."""

from collections import deque

import numpy as np

SYNC_WINDOW = 32
"""Number of clock readings in a fit; about half a minute for one skin of 17 boards."""

SYNC_TOLERANCE_US = 300.0
"""Largest residual, microseconds, of an undamaged clock reading from the fitted line."""


class BoardLine:
    """Latest readings of a board's clock, and a least-squares line from board time to hub time.

    A reading is (board time, hub time), unwrapped integer microseconds. A hub with one board sends 60 readings per
    second, so the sums of the fit are updated instead of recomputed. The sums are exact integers and accumulate no
    rounding error in a long stream.
    """

    def __init__(self) -> None:
        """Create a line fit without clock readings."""
        self._readings: deque[tuple[int, int]] = deque()
        self._x = self._y = self._xx = self._xy = self._yy = 0

    def __len__(self) -> int:
        return len(self._readings)

    @property
    def last(self) -> tuple[int, int]:
        """The latest clock reading, (board time, hub time), microseconds."""
        return self._readings[-1]

    def add(self, board_us: int, hub_us: int) -> None:
        """Add a reading of the board's clock with its hub time, microseconds; only `SYNC_WINDOW` readings are kept."""
        self._readings.append((board_us, hub_us))
        self._update_sums(board_us, hub_us, 1)
        if len(self._readings) > SYNC_WINDOW:
            self._update_sums(*self._readings.popleft(), -1)

    def _update_sums(self, x: int, y: int, sign: int) -> None:
        """Add a clock reading to the sums of the line fit (sign 1), or remove it (sign -1).

        x: board time, microseconds. y: hub time, microseconds.
        """
        self._x += sign * x
        self._y += sign * y
        self._xx += sign * x * x
        self._xy += sign * x * y
        self._yy += sign * y * y

    def fit(self) -> tuple[float, float] | None:
        """Return (offset, slope) of the line, or None if all readings have the same board time.

        offset: fitted hub time at the last board reading, minus the last hub reading, microseconds. slope: hub
        microseconds per board microsecond.
        """
        n = len(self._readings)
        variance = n * self._xx - self._x * self._x
        if not variance:
            return None
        covariance = n * self._xy - self._x * self._y
        # The root of the sum of squared residuals bounds every residual; usually this bound is within the tolerance.
        squares = ((n * self._yy - self._y * self._y) * variance - covariance * covariance) / (n * variance)
        slope = covariance / variance
        x, y = self.last
        offset = ((self._y - n * y) + slope * (n * x - self._x)) / n
        return (offset, slope) if squares <= SYNC_TOLERANCE_US**2 else self._fit_without_outliers(offset, slope)

    def _fit_without_outliers(self, offset: float, slope: float) -> tuple[float, float]:
        """Return the given line if all clock readings are within the tolerance of it, else the Theil-Sen line.

        The Theil-Sen line has the median of the slopes between all pairs of readings, so a damaged reading hardly
        changes it. offset, slope: as `fit` returns them.
        """
        x, y = self.last
        board = np.array([board_us - x for board_us, _ in self._readings], dtype=float)
        hub = np.array([hub_us - y for _, hub_us in self._readings], dtype=float)
        if np.abs(hub - offset - slope * board).max() <= SYNC_TOLERANCE_US:
            return offset, slope
        from scipy.stats import theilslopes  # the import takes half a second and is rarely needed

        slope, offset, _, _ = theilslopes(hub, board)
        return float(offset), float(slope)
