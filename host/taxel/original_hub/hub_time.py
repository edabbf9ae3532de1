"""Time of the original hub: its timestamps, checked against the position of each message in the stream.

A damaged timestamp cannot be recognised by itself. The hub sends almost without pause, so that the position in the
stream predicts the time of a message. A timestamp far from this prediction is suspect, and the prediction replaces it;
the next message decides whether the timestamp was damaged, or whether the hub paused or restarted, or bytes were lost.
"""

from collections import deque
from statistics import median
from typing import Final, NamedTuple

_WRAP: Final = 1 << 32
_US_PER_MS: Final = 1000

TOLERANCE_SHARE: Final = 0.6
"""Largest deviation of a timestamp from its prediction that is accepted at once, as a share of a poll cycle. It must
exceed the pause of the hub (a third of a cycle) and remain below one cycle, whose loss has to be noticed."""

TOLERANCE_UNKNOWN_MS: Final = 1000.0
"""Largest accepted deviation before the duration of a cycle is known, ms (chosen)."""

RESTART_MS: Final = 1000.0
"""Smallest decrease of confirmed timestamps that is treated as a restart of the hub, ms. A race condition in the hub's
firmware produces decreases of at most one cycle."""

CYCLES_KEPT: Final = 15
"""Number of latest cycles whose median duration is used."""


class Tick(NamedTuple):
    """Time of a message.

    time_us: microseconds since the start of the hub. is_restart: the hub has restarted before this message. lost_ms:
    duration of an interruption of the stream, in which bytes were lost; 0 without an interruption.
    """

    time_us: int
    is_restart: bool = False
    lost_ms: float = 0.0


class HubTime:
    """Computes the times of successive messages.

    For a format without timestamps, the time is that which all bytes since the start of the stream take on the wire.
    cycle_ms: median duration of a poll cycle; None before it is known.
    """

    def __init__(self, byte_ms: float) -> None:
        """Create the clock of one stream. byte_ms: time of one byte on the wire, ms."""
        self.cycle_ms: float | None = None
        self._byte_ms = byte_ms
        self._mean_byte_ms = byte_ms
        self._now_ms = 0.0  # unwrapped
        self._position: int | None = None
        # Suspect message: its timestamp, its position in the stream, and whether bytes were discarded before it.
        self._suspect: tuple[int, int, bool] | None = None
        self._cycle_times: deque[float] = deque(maxlen=CYCLES_KEPT)
        self._cycle_start: tuple[int, float] | None = None

    def take(self, timestamp_ms: int | None, position: int, has_discarded: bool) -> Tick:
        """Compute the time of the next message, and detect a restart of the hub or an interruption before it.

        The position in the stream predicts the time. A timestamp far from this prediction is suspect: the prediction
        replaces it. If the next timestamp agrees with the suspect timestamp, the clock is set to the next timestamp:
        the hub has paused or restarted, or bytes were lost. Otherwise the suspect timestamp is treated as damaged.

        timestamp_ms: modulo 2^32; None for a format without timestamps. position: position of its first byte in the
        stream. has_discarded: directly before the message there are bytes that belong to no message.
        """
        if timestamp_ms is None:
            self._now_ms = position * self._byte_ms
            return Tick(round(self._now_ms * _US_PER_MS))
        if self._position is None:
            self._set(float(timestamp_ms), position)
            return Tick(timestamp_ms * _US_PER_MS)
        expected_ms = self._now_ms + (position - self._position) * self._mean_byte_ms
        deviation_ms = (timestamp_ms - expected_ms + _WRAP / 2) % _WRAP - _WRAP / 2
        if abs(deviation_ms) <= self._tolerance_ms:
            self._suspect = None
            self._set(expected_ms + deviation_ms, position)
            return Tick(round(self._now_ms * _US_PER_MS))
        if self._suspect is None or not self._agrees_with_suspect(timestamp_ms, position):
            was_discarded = has_discarded or (self._suspect is not None and self._suspect[2])
            self._suspect = (timestamp_ms, position, was_discarded)
            return Tick(round(expected_ms * _US_PER_MS))
        was_discarded = self._suspect[2]
        self._suspect = None
        self._cycle_start = None
        if deviation_ms < -RESTART_MS:
            self._set(float(timestamp_ms), position)
            return Tick(timestamp_ms * _US_PER_MS, is_restart=True)
        self._set(expected_ms + deviation_ms, position)
        return Tick(round(self._now_ms * _US_PER_MS), lost_ms=max(deviation_ms, 0.0) if was_discarded else 0.0)

    def begin_cycle(self, cycle: int, size: int) -> None:
        """Update the duration of a poll cycle; call this after `take` for the first received message of each cycle.

        cycle: number of the cycle. size: bytes of a complete cycle.
        """
        if self._cycle_start is not None and cycle == self._cycle_start[0] + 1:
            self._cycle_times.append(self._now_ms - self._cycle_start[1])
            # A cycle takes at least about the time of its bytes on the wire. A damaged timestamp could give a smaller
            # value.
            self.cycle_ms = max(median(self._cycle_times), 0.9 * size * self._byte_ms)
            self._mean_byte_ms = self.cycle_ms / size
        self._cycle_start = (cycle, self._now_ms)

    @property
    def _tolerance_ms(self) -> float:
        """Largest deviation of a timestamp from its prediction that is accepted at once, ms."""
        return TOLERANCE_UNKNOWN_MS if self.cycle_ms is None else TOLERANCE_SHARE * self.cycle_ms

    def _agrees_with_suspect(self, timestamp_ms: int, position: int) -> bool:
        """Return whether a timestamp follows the suspect timestamp as the positions of the two messages predict."""
        suspect_ms, suspect_position, _ = self._suspect or (0, 0, False)
        expected = suspect_ms + (position - suspect_position) * self._mean_byte_ms
        return abs((timestamp_ms - expected + _WRAP / 2) % _WRAP - _WRAP / 2) <= self._tolerance_ms

    def _set(self, now_ms: float, position: int) -> None:
        """Store the time of the message at `position`, ms, as the basis of the next prediction."""
        self._now_ms, self._position = now_ms, position
