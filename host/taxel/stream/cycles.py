"""Grouping of board frames into poll cycles."""

from taxel.stream.frames import TaxelFrame

CYCLES_IN_FLIGHT = 2
"""Largest number of incomplete poll cycles. An incomplete cycle is released when a frame of the second cycle after it
arrives.
"""


class CycleSorter:
    """Collects the frames of each poll cycle. `boards`: number of frames in a complete cycle."""

    def __init__(self, boards: int) -> None:
        """Create an empty sorter; boards: number of taxel frames in a complete poll cycle."""
        self._boards = boards
        self._pending: dict[int, list[TaxelFrame]] = {}
        self._has_complete_cycle = False

    def add(self, frame: TaxelFrame) -> None:
        """Add one taxel frame to its poll cycle; afterwards call `pop` until it returns None."""
        frames = self._pending.setdefault(frame.cycle, [])
        frames.append(frame)
        self._has_complete_cycle = self._has_complete_cycle or len(frames) == self._boards

    def pop(self, is_end: bool = False) -> list[TaxelFrame] | None:
        """Remove and return the frames of the oldest poll cycle; None if no cycle can be released yet.

        The oldest cycle is released, complete or not, if a stored cycle is complete or if more than `CYCLES_IN_FLIGHT`
        cycles are stored. `is_end`: the stream has ended, so every cycle is released.
        """
        if not self._pending or not (self._has_complete_cycle or is_end or len(self._pending) > CYCLES_IN_FLIGHT):
            return None
        frames = self._pending.pop(next(iter(self._pending)))
        self._has_complete_cycle = self._has_complete_cycle and len(frames) != self._boards
        return frames
