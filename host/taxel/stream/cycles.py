"""Frames of single boards sorted into poll cycles."""

from taxel.stream.frames import TaxelFrame

CYCLES_IN_FLIGHT = 2
"""Poll cycles that may be incomplete at one time: one is handed out when a frame of the next but one arrives."""


class CycleSorter:
    """Collects the frames of each poll cycle; `boards`: how many a complete cycle has."""

    def __init__(self, boards: int) -> None:
        self._boards = boards
        self._pending: dict[int, list[TaxelFrame]] = {}
        self._complete = False

    def add(self, frame: TaxelFrame) -> None:
        """Take one frame; then call `pop` until it gives None."""
        frames = self._pending.setdefault(frame.cycle, [])
        frames.append(frame)
        self._complete = self._complete or len(frames) == self._boards

    def pop(self, is_end: bool = False) -> list[TaxelFrame] | None:
        """The frames of the oldest cycle that is complete or overdue, None if there is none.

        `is_end`: no more frames will come, so that every cycle is due.
        """
        if not self._pending or not (self._complete or is_end or len(self._pending) > CYCLES_IN_FLIGHT):
            return None
        frames = self._pending.pop(next(iter(self._pending)))
        self._complete = self._complete and len(frames) != self._boards
        return frames
