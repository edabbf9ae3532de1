"""What a monitor keeps of one board between two readings."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel.hand import Board
from taxel.monitor.reading import BoardReading
from taxel.signal import Activation, ActivationFrame, Baseline
from taxel.stream import BoardCount, TaxelFrame
from taxel_protocol import BoardState as HubsBoardState

SILENT_S = 1.0
"""A board that has sent nothing for so long is silent: what it said last is shown no more."""

_BUS_FAULTS = ("nacks", "timeouts", "crc_errors", "bus_errors")
_WORDS = {HubsBoardState.ABSENT: "absent", HubsBoardState.INCOMPATIBLE: "incompatible"}


class BoardState:
    """Counts, baseline and activation of a board.

    `where`: its taxels in the hand's order. `raw`, `lowest`: u16 views of the hand's arrays: newest count of each
    taxel, and the lowest since the last reading. `last_s`: when its last frame came, on the monitor's clock; `time_s`:
    that frame's own time; NaN before the first.
    """

    def __init__(
        self, board: Board, where: slice, raw: NDArray[np.uint16], lowest: NDArray[np.uint16], samples: int
    ) -> None:
        self.board = board
        self.where = where
        self.frames = 0
        self.last_s = float("nan")
        self.time_s = float("nan")
        self.disturbed = 0
        self._raw, self._lowest = raw, lowest
        self._has_new = False
        self._baseline = Baseline(board.kind.taxel_count, samples=samples)
        self._activation: Activation | None = None

    def begin_baseline(self) -> None:
        """Forget the baseline and take it from the next frames."""
        self._baseline.reset()
        self._activation = None
        self.disturbed = 0

    def take(self, frame: TaxelFrame, now_s: float, threshold: float) -> None:
        """A frame that came at `now_s`."""
        self._raw[:] = frame.raw_counts
        if self._has_new:
            np.minimum(self._lowest, frame.raw_counts, out=self._lowest)
        else:
            self._lowest[:] = frame.raw_counts
            self._has_new = True
        self.frames += 1
        self.last_s, self.time_s = now_s, frame.time_s
        if self._activation is None and self._baseline.update(frame.raw_counts):
            result = self._baseline.result()
            self._activation = Activation(result.mean, threshold)
            self.disturbed = int(result.disturbed.sum())

    @property
    def progress(self) -> float:
        """Of the baseline, 0 to 1."""
        return 1.0 if self._activation is not None else self._baseline.progress

    def is_sending(self, now_s: float) -> bool:
        """Whether it is not silent."""
        return now_s - self.last_s < SILENT_S  # False before the first frame

    def judge(self, now_s: float) -> ActivationFrame | None:
        """Signals and active taxels since the last reading; None if nothing is known. Begins the next reading."""
        self._has_new = False
        if self._activation is None or not self.is_sending(now_s):
            return None
        return self._activation(self._lowest)

    def read(
        self,
        judged: ActivationFrame | None,
        now_s: float,
        rate_hz: float,
        count: BoardCount | None,
        status: Mapping[str, Any] | None,
        is_expected: bool,
    ) -> BoardReading:
        """The board's part of a reading; `status`: BOARD_STATUS; `is_expected`: it has answered, or may have."""
        is_sending = self.is_sending(now_s)
        return BoardReading(
            board=self.board,
            frames=self.frames,
            rate_hz=rate_hz if is_sending else 0.0,
            missing=count.missing if count else 0,
            damaged=count.damaged if count else 0,
            bus_faults=None if status is None else sum(status[name] for name in _BUS_FAULTS),
            silent_s=max(0.0, now_s - self.last_s) if self.frames else None,
            active=int(judged.active.sum()) if judged else 0,
            largest_signal=float(judged.signal_counts.max()) if judged else float("nan"),
            baseline=self.progress,
            state="streaming" if is_sending else self._word(status, is_expected),
        )

    def _word(self, status: Mapping[str, Any] | None, is_expected: bool) -> str:
        known = _WORDS.get(status["state"]) if status is not None else None
        if known is not None:
            return known
        if self.frames:
            return "silent"
        return "no frame yet" if is_expected else "absent"
