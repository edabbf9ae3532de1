"""Contacts without an announcement, including contacts that are too light to make a taxel active."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from taxel.signal import TrackedBaseline
from taxel.twin.steps import REST, Step
from taxel.types import BoolArray, FloatArray, IntArray

LONGEST_S: Final = 4.0 * 3600.0
"""Longest duration of a contact, seconds. A count that stays low for longer is treated as a change of the taxel."""


@dataclass(eq=False)
class UnannouncedContacts:
    """Contacts between the announced ones, found by the tracked baseline of `taxel.signal`.

    noise_variance: f64[n], noise variance of one frame, counts^2. board: i64[n], column of each taxel's board.
    """

    noise_variance: FloatArray
    board: IntArray
    _tracked: TrackedBaseline | None = None
    _end_s: float = 0.0

    def find_pressed(self, step: Step) -> tuple[BoolArray, BoolArray]:
        """Find the taxels pressed in the part of a step without announced contact, and all taxels of their boards.

        A count that stays low for longer than `LONGEST_S` is a change of the taxel and no contact. Returns two arrays
        bool[n], which are all False until every taxel has delivered a frame.
        """
        found = np.zeros(len(self.board), dtype=bool)
        if self._tracked is None:
            if (step.count[REST] == 0).any():
                return found, found
            first = step.total[REST] / step.count[REST]
            self._tracked = TrackedBaseline(first, np.sqrt(self.noise_variance), self.board)
        elapsed_s = max(step.start_s - self._end_s, 1.0)
        for total, count in step.seconds:
            state = self._tracked.correct(total, count, elapsed_s)
            elapsed_s = 1.0
            found |= state.is_contact & (state.contact_s < LONGEST_S)
        self._end_s = step.end_s
        boards = np.bincount(self.board, found, int(self.board.max()) + 1) > 0
        return found, np.asarray(boards[self.board])
