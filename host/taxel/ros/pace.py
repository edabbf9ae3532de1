"""Frames of a recording at the speed at which they were made, or another."""

from __future__ import annotations

import time


class Pace:
    """Waits until a recorded moment is due. `speed`: times real time; None: never waits."""

    def __init__(self, speed: float | None) -> None:
        self._speed = speed
        self._origin: tuple[float, float] | None = None

    def wait(self, time_s: float) -> None:
        """Return when the recording's `time_s` has come; the first one is now."""
        if self._speed is None:
            return
        if self._origin is None:
            self._origin = (time_s, time.monotonic())
        due_s = self._origin[1] + (time_s - self._origin[0]) / self._speed
        left_s = due_s - time.monotonic()
        if left_s > 0.0:
            time.sleep(left_s)
