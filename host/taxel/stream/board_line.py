"""The line through the last readings of one board's clock, kept up as they come."""

from collections import deque

import numpy as np

SYNC_WINDOW = 32
"""Clock readings of one board that a fit uses: about half a minute."""

SYNC_TOLERANCE_US = 300.0
"""Clock readings of one board lie this close to a line, or one of them was damaged."""


class BoardLine:
    """Readings (board, hub) in whole microseconds, not wrapped, and the sums of which least squares are made.

    A hub with one board sends 60 readings a second. The sums are whole numbers, so that nothing is lost in them
    however long a stream lasts.
    """

    def __init__(self) -> None:
        self._readings: deque[tuple[int, int]] = deque()
        self._x = self._y = self._xx = self._xy = self._yy = 0

    def __len__(self) -> int:
        return len(self._readings)

    @property
    def last(self) -> tuple[int, int]:
        """The latest reading."""
        return self._readings[-1]

    def add(self, board_us: int, hub_us: int) -> None:
        """A reading; beyond `SYNC_WINDOW` the oldest goes."""
        self._readings.append((board_us, hub_us))
        self._count(board_us, hub_us, 1)
        if len(self._readings) > SYNC_WINDOW:
            self._count(*self._readings.popleft(), -1)

    def _count(self, x: int, y: int, sign: int) -> None:
        self._x += sign * x
        self._y += sign * y
        self._xx += sign * x * x
        self._xy += sign * x * y
        self._yy += sign * y * y

    def fit(self) -> tuple[float, float] | None:
        """(microseconds of the hub after its last reading at the board's last reading, hub's per board's microsecond).

        None if all readings are of one microsecond.
        """
        n = len(self._readings)
        spread = n * self._xx - self._x * self._x
        if not spread:
            return None
        common = n * self._xy - self._x * self._y
        # No reading is farther from the line than the root of all squares together: most often that is near enough.
        squares = ((n * self._yy - self._y * self._y) * spread - common * common) / (n * spread)
        slope = common / spread
        x, y = self.last
        offset = ((self._y - n * y) + slope * (n * x - self._x)) / n
        return (offset, slope) if squares <= SYNC_TOLERANCE_US**2 else self._checked(offset, slope)

    def _checked(self, offset: float, slope: float) -> tuple[float, float]:
        """The same, unless a reading is off: then the line for which most readings speak."""
        x, y = self.last
        board = np.array([one - x for one, _ in self._readings], dtype=float)
        hub = np.array([one - y for _, one in self._readings], dtype=float)
        if np.abs(hub - offset - slope * board).max() <= SYNC_TOLERANCE_US:
            return offset, slope
        from scipy.stats import theilslopes  # takes half a second to import, and is hardly ever needed

        slope, offset, _, _ = theilslopes(hub, board)
        return float(offset), float(slope)
