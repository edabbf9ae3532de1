"""Takes every frame of a skin and says, when asked, how the skin is. Knows nothing of screens."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from taxel.monitor.advice import advice_of
from taxel.monitor.board_state import BoardState
from taxel.monitor.rates import RecentRate
from taxel.monitor.reading import BoardReading, SkinReading
from taxel.signal import ACTIVATION_THRESHOLD_COUNTS, BASELINE_SAMPLES
from taxel.skin import Skin
from taxel.stream import TaxelFrame

AGES_KEPT = 64
"""Ages of frames that a reading looks at: one for each time frames were taken, about a second of them."""


class SkinMonitor:
    """Every frame goes in with `take`; `read` says how the skin is.

    Each board takes its own baseline from its first `samples` frames, also one that is plugged in later. A taxel is
    active when its count has dropped by more than `threshold` counts below it. Between two readings the lowest count of
    each taxel is kept, so that a touch that comes and goes between them is still seen.

    Time is `time.monotonic` for a stream in real time, else the stream's own clock: a capture that is played faster
    has the rates that it had when it was recorded. Raises ValueError for a number of samples or a threshold that
    `taxel.signal` does not take.
    """

    def __init__(
        self, skin: Skin, samples: int = BASELINE_SAMPLES, threshold: float = ACTIVATION_THRESHOLD_COUNTS
    ) -> None:
        self.skin = skin
        self.hand = hand = skin.hand
        self.threshold = threshold
        self._raw = np.zeros(hand.n_taxels, dtype=np.uint16)
        lowest = np.zeros_like(self._raw)
        places = [(board, hand.get_slice(board.address)) for board in hand.boards]
        self._boards = {
            board.address: BoardState(board, where, self._raw[where], lowest[where], samples) for board, where in places
        }
        self._is_real_time = skin.link.is_real_time
        self._began_s = time.monotonic()
        self._newest_s = float("nan")
        self._ages_s: deque[float] = deque(maxlen=AGES_KEPT)
        self._rate = RecentRate()
        self._cpu = RecentRate()
        self._wants_baseline = False

    def take(self, frames: Sequence[TaxelFrame], now_s: float) -> None:
        """Frames that have arrived, in order; `now_s`: `time.monotonic`."""
        if self._wants_baseline:
            self._wants_baseline = False
            for state in self._boards.values():
                state.begin_baseline()
        for frame in frames:
            came_s = now_s if self._is_real_time else frame.time_s
            self._boards[frame.address].take(frame, came_s, self.threshold)
        if frames:
            self._newest_s = frames[-1].time_s
            if self._is_real_time:
                self._ages_s.append(now_s - self._newest_s)

    def begin_baseline(self) -> None:
        """Take every board's baseline anew from the next frames; may be called from another thread."""
        self._wants_baseline = True

    def read(self, now_s: float, is_ended: bool = False) -> SkinReading:
        """How the skin is; `now_s`: `time.monotonic`; `is_ended`: nothing more will come."""
        clock_s = now_s if self._is_real_time else self._newest_s
        states = list(self._boards.values())
        signal = np.full(self.hand.n_taxels, np.nan)
        active = np.zeros(self.hand.n_taxels, dtype=bool)
        suspect = 0
        boards = []
        rates = self._rate.update([state.time_s for state in states], [state.frames for state in states])
        counts = self.skin.losses.boards
        for state, rate_hz in zip(states, rates.tolist(), strict=True):
            judged = state.judge(clock_s)
            if judged is not None:
                signal[state.where], active[state.where] = judged.signal_counts, judged.active
                suspect += int(judged.suspect_baseline.sum())
            address = state.board.address
            status = self.skin.hub.board_status.get(address)
            is_expected = self.skin.link.is_recorded or address in self.skin.hub.boards
            boards.append(state.read(judged, clock_s, rate_hz, counts.get(address), status, is_expected))
        sending = [state.progress for state in states if state.frames]
        reading = SkinReading(
            signal_counts=signal,
            active=active,
            raw_counts=self._raw.copy(),
            boards=tuple(boards),
            time_s=self._newest_s,
            watched_s=now_s - self._began_s,
            age_s=self._ages(),
            disturbed=sum(state.disturbed for state in states),
            suspect=suspect,
            baseline=sum(sending) / len(sending) if sending else 0.0,
            cpu_share=float(self._cpu.update([now_s], [time.process_time()])[0]),
            is_ended=is_ended,
            advice=None,
            **self._counts(boards),
        )
        return replace(reading, advice=advice_of(reading, self.skin))

    def _counts(self, boards: list[BoardReading]) -> dict[str, Any]:
        """What the stream and the hub have counted, by the names of `SkinReading`."""
        losses, status = self.skin.losses, self.skin.hub.status
        return {
            "scans_hz": max(board.rate_hz for board in boards),
            "frames_hz": sum(board.rate_hz for board in boards),
            "frames": sum(board.frames for board in boards),
            "lost_on_wire": losses.lost_on_wire,
            "damaged": sum(board.damaged for board in boards),
            "missing": sum(board.missing for board in boards),
            "bytes_discarded": self.skin.bytes_discarded,
            "bytes_waiting": self.skin.bytes_waiting,
            "hub_restarts": losses.restarts,
            "hub_dropped": status["frames_dropped"] if status else None,
            "bus_recoveries": status["bus_recoveries"] if status else None,
            "cycle_s": status["cycle_time_us"] * 1e-6 if status else None,
        }

    def _ages(self) -> tuple[float, float] | None:
        if not self._ages_s:
            return None
        ages = np.array(self._ages_s)
        return float(np.median(ages)), float(ages.max())
