"""Playback of a recording at its own speed or a multiple of it."""

import time


class Pace:
    """Timing of a playback: delays the reader of a recording until each recorded time is due.

    speed: factor on the recorded speed; None: no delay.
    """

    def __init__(self, speed: float | None) -> None:
        """Create the timing of a playback. speed: factor on the recorded speed; None: `wait` does not wait."""
        self._speed = speed
        self._origin: tuple[float, float] | None = None

    def wait(self, time_s: float) -> None:
        """Wait until the recorded time `time_s`, seconds, is due in the playback.

        The time of the first call is the start of the playback, and is due immediately.
        """
        if self._speed is None:
            return
        if self._origin is None:
            self._origin = (time_s, time.monotonic())
        due_s = self._origin[1] + (time_s - self._origin[0]) / self._speed
        remaining_s = due_s - time.monotonic()
        if remaining_s > 0.0:
            time.sleep(remaining_s)
