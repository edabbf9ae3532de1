"""Readings as lines, for pipes, logs and scripts."""

import json
from collections.abc import Callable

from taxel.monitor.header import line
from taxel.monitor.reading import SkinReading


class LineView:
    """One line for each reading: words, or JSON; `out` takes it."""

    def __init__(self, out: Callable[[str], None], as_json: bool = False) -> None:
        self._out = out
        self._as_json = as_json

    def draw(self, reading: SkinReading) -> None:
        """Say a reading."""
        self._out(json.dumps(reading.as_dict()) if self._as_json else line(reading))

    def is_done(self, reading: SkinReading) -> bool:
        """Never: lines go on as long as the stream."""
        return False


class OnceView:
    """Shows nothing and is done when a reading can stand alone, or when nothing has come for `patience_s` seconds."""

    def __init__(self, patience_s: float = 10.0) -> None:
        self._patience_s = patience_s

    def draw(self, reading: SkinReading) -> None:
        """Show nothing."""

    def is_done(self, reading: SkinReading) -> bool:
        """Whether signals and rates are known, or nothing comes."""
        has_waited = reading.watched_s > self._patience_s and not reading.boards_streaming
        return has_waited or (reading.is_measuring and reading.scans_hz > 0.0)
