"""Readings as lines of text or JSON, for pipes, logs and scripts."""

import json
from collections.abc import Callable

from taxel.monitor.reading import SkinReading
from taxel.monitor.summary_text import format_line


class LineView:
    """View of the monitor that outputs one line for each reading, as text or JSON."""

    def __init__(self, out: Callable[[str], None], as_json: bool = False) -> None:
        """Create a view. out: called with each line. as_json: the lines are JSON objects instead of text."""
        self._out = out
        self._as_json = as_json

    def draw(self, reading: SkinReading) -> None:
        """Pass the line of text (or JSON) of a reading to `out`."""
        self._out(json.dumps(reading.as_dict()) if self._as_json else format_line(reading))

    def is_done(self, reading: SkinReading) -> bool:
        """Return False: the lines continue until the stream ends."""
        return False


class OnceView:
    """View of the monitor that displays nothing and ends the loop at the first complete reading.

    A reading is complete if the baseline is complete and the rates are known. The view also ends the loop if no board
    is streaming `timeout_s` seconds after the start.
    """

    def __init__(self, timeout_s: float = 10.0) -> None:
        """Create a view. timeout_s: time limit for the first streaming board, seconds."""
        self._timeout_s = timeout_s

    def draw(self, reading: SkinReading) -> None:
        """Show nothing."""

    def is_done(self, reading: SkinReading) -> bool:
        """Return whether baseline and rates are known, or no board is streaming after the time limit."""
        is_timed_out = reading.watched_s > self._timeout_s and not reading.boards_streaming
        return is_timed_out or (reading.is_measuring and reading.scans_hz > 0.0)
