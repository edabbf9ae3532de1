"""State of one board between two readings of the monitor."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from taxel.hand import Board
from taxel.monitor.reading import BoardReading
from taxel.signal import Activation, ActivationFrame, Baseline, TrackedBaseline
from taxel.stream import BoardCount, TaxelFrame
from taxel.types import CountArray
from taxel_protocol import BoardState as HubBoardState

SILENT_S = 1.0
"""Time without a frame after which a board is treated as silent and its last signals are no longer displayed, seconds.
The default hand sends a frame of each board every 50 ms. With a larger value, outdated signals are displayed longer.
"""

_BUS_FAULTS = ("nacks", "timeouts", "crc_errors", "bus_errors")
_STATE_NAMES = {HubBoardState.ABSENT: "absent", HubBoardState.INCOMPATIBLE: "incompatible"}


class BoardState:
    """Counts, baseline and activation of a board.

    Attributes:
        taxels: position of the board's taxels on the hand's taxel axis.
        frames: number of processed frames.
        last_s, time_s: arrival time of the last frame on the monitor's clock, and time of this frame on the stream's
            clock, seconds; NaN before the first frame.
        disturbed: number of taxels that were touched during the baseline.
    """

    def __init__(
        self, board: Board, taxels: slice, raw: CountArray, lowest: CountArray, samples: int, is_tracked: bool = False
    ) -> None:
        """Create the state of one board before its first frame.

        taxels: position of the board's taxels on the hand's taxel axis. raw, lowest: writable u16 views of the hand's
        arrays, for the newest count of each taxel of the board and the lowest count since the last reading. samples:
        number of frames of a baseline. is_tracked: the baseline follows drift afterwards.
        """
        self.board = board
        self.taxels = taxels
        self.frames = 0
        self.last_s = float("nan")
        self.time_s = float("nan")
        self.disturbed = 0
        self._raw, self._lowest = raw, lowest
        self._has_new_frame = False
        self._baseline = Baseline(board.kind.taxel_count, samples=samples)
        self._is_tracked = is_tracked
        self._tracked: TrackedBaseline | None = None
        self._activation: Activation | None = None

    def restart_baseline(self) -> None:
        """Discard the baseline of the board; the next frames give a new baseline."""
        self._baseline.reset()
        self._activation = self._tracked = None
        self.disturbed = 0

    def take(self, frame: TaxelFrame, now_s: float, threshold: float) -> None:
        """Process a taxel frame of the board: store its counts and update the baseline.

        now_s: arrival time on the monitor's clock, seconds. threshold: activation threshold, counts.
        """
        self._raw[:] = frame.raw_counts
        if self._has_new_frame:
            np.minimum(self._lowest, frame.raw_counts, out=self._lowest)
        else:
            self._lowest[:] = frame.raw_counts
            self._has_new_frame = True
        self.frames += 1
        self.last_s, self.time_s = now_s, frame.time_s
        if self._activation is None and self._baseline.update(frame.raw_counts):
            result = self._baseline.result()
            self._activation = Activation(result.mean, threshold)
            self.disturbed = int(result.disturbed.sum())
            if self._is_tracked:
                self._tracked = TrackedBaseline(result.mean, result.noise)
        elif self._tracked is not None and (state := self._tracked.update(frame.time_s, frame.raw_counts)) is not None:
            self._activation = Activation(state.mean, threshold)

    @property
    def progress(self) -> float:
        """Share of the baseline's frames that have arrived, 0 to 1."""
        return 1.0 if self._activation is not None else self._baseline.progress

    def is_sending(self, now_s: float) -> bool:
        """Whether the board has sent a frame within the last `SILENT_S` seconds."""
        return now_s - self.last_s < SILENT_S  # False before the first frame

    def take_activation(self, now_s: float) -> ActivationFrame | None:
        """Compare the lowest counts since the last call with the baseline; then begin to collect new lowest counts.

        Returns None without a complete baseline, or if the board sends no frames.
        """
        self._has_new_frame = False
        if self._activation is None or not self.is_sending(now_s):
            return None
        return self._activation(self._lowest)

    def read(
        self,
        activation: ActivationFrame | None,
        now_s: float,
        rate_hz: float,
        count: BoardCount | None,
        status: Mapping[str, Any] | None,
        is_expected: bool,
    ) -> BoardReading:
        """Return the present state of the board as a part of the monitor's reading.

        activation: result of `take_activation`. now_s: time on the monitor's clock. rate_hz: measured frame rate.
        count: frame losses of the board. status: fields of its latest BOARD_STATUS message; None before the first.
        is_expected: the hub has found the board, or the source is a recording, in which this is unknown.
        """
        is_sending = self.is_sending(now_s)
        return BoardReading(
            board=self.board,
            frames=self.frames,
            rate_hz=rate_hz if is_sending else 0.0,
            missing=count.missing if count else 0,
            damaged=count.damaged if count else 0,
            bus_faults=None if status is None else sum(status[name] for name in _BUS_FAULTS),
            silent_s=max(0.0, now_s - self.last_s) if self.frames else None,
            active=int(activation.active.sum()) if activation else 0,
            largest_signal=float(activation.signal_counts.max()) if activation else float("nan"),
            baseline_progress=self.progress,
            state="streaming" if is_sending else self._get_state_name(status, is_expected),
        )

    def _get_state_name(self, status: Mapping[str, Any] | None, is_expected: bool) -> str:
        """Return the state of a board that sends no frames: "absent", "incompatible", "silent" or "no frame yet".

        status: fields of its latest BOARD_STATUS message; None before the first. is_expected: the hub has found the
        board, or the source is a recording.
        """
        name = _STATE_NAMES.get(status["state"]) if status is not None else None
        if name is not None:
            return name
        if self.frames:
            return "silent"
        return "no frame yet" if is_expected else "absent"
