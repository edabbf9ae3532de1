"""State of a skin for display: updated with every frame, read several times per second. Independent of the views."""

import time
from collections import deque
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from taxel.monitor.advice import make_advice
from taxel.monitor.board_faults import BoardFaults
from taxel.monitor.board_state import BoardState
from taxel.monitor.rates import RecentRate
from taxel.monitor.reading import BoardReading, SkinReading
from taxel.proximity import ProximityEstimate, ProximityWatch
from taxel.signal import ACTIVATION_THRESHOLD_COUNTS, BASELINE_SAMPLES
from taxel.skin import Skin
from taxel.stream import TaxelFrame
from taxel.stream.frame_stream import has_arrivals

STORED_AGES = 64
"""Number of stored ages of frames, one for each call of `take`: about one second."""


NO_DATA_S = 2.0
"""Time without any frame after which all rates and signals are treated as out of date, seconds: longer than the start
of the boards (1 s) and the longest delay of a loaded computer (0.2 s, docs/how-to-monitor.md). With a larger value,
outdated figures are displayed longer.
"""

MISSED_PERIODS = 3
"""Number of poll cycles without a frame after which rates and signals are treated as out of date, if the scan rate is
below 1.5 Hz and these cycles therefore take longer than `NO_DATA_S`."""


class SkinMonitor:
    """State of a skin for display: `take` processes taxel frames, `read` returns the state at one moment (a reading).

    The baseline of each board is the mean of its own first `samples` frames, also for a board that is connected later.
    A taxel is active when its signal exceeds `threshold` counts. A reading contains the largest signal of each taxel
    since the last reading, so that a touch between two readings is visible.

    The clock is `time.monotonic` for a stream in real time, otherwise the clock of the stream: for a capture that is
    played faster, the displayed rates are those at which it was recorded. Raises ValueError for a number of samples or
    a threshold that `taxel.signal` rejects.
    """

    def __init__(
        self,
        skin: Skin,
        samples: int = BASELINE_SAMPLES,
        threshold: float = ACTIVATION_THRESHOLD_COUNTS,
        proximity: ProximityWatch | None = None,
        is_tracked: bool = False,
    ) -> None:
        """Create a monitor of the frames of an open skin.

        samples: number of frames of each board's baseline. threshold: signal above which a taxel is active, counts.
        proximity: estimators of targets before contact; None: not estimated. is_tracked: the baselines follow drift
        (`taxel.signal.TrackedBaseline`). Raises ValueError for a number of samples or a threshold that `taxel.signal`
        rejects.
        """
        self.skin = skin
        self._proximity = proximity
        self.hand = hand = skin.hand
        self.threshold = threshold
        self._raw = np.zeros(hand.n_taxels, dtype=np.uint16)
        lowest = np.zeros_like(self._raw)
        slices = [(board, hand.get_slice(board.address)) for board in hand.boards]
        self._boards = {
            board.address: BoardState(board, taxels, self._raw[taxels], lowest[taxels], samples, is_tracked)
            for board, taxels in slices
        }
        self._is_real_time = skin.link.is_real_time
        self._has_arrivals = self._is_real_time and has_arrivals(skin.link)
        self._started_s = time.monotonic()
        self._arrived_s = self._started_s
        rate_hz = getattr(skin, "rate_hz", None)
        self._period_s = 1.0 / rate_hz if rate_hz else None
        self._newest_s = float("nan")
        self._ages_s: deque[float] = deque(maxlen=STORED_AGES)
        self._rate = RecentRate()
        self._cpu = RecentRate()
        self._is_baseline_requested = False
        self._faults = BoardFaults(skin)

    def take(self, frames: Sequence[TaxelFrame], now_s: float) -> None:
        """Update the state of all boards with taxel frames in the order of their arrival.

        now_s: `time.monotonic`. Also begins the new baselines that `restart_baseline` has requested.
        """
        if self._is_baseline_requested:
            self._is_baseline_requested = False
            for state in self._boards.values():
                state.restart_baseline()
            if self._proximity is not None:
                self._proximity.restart_baseline()
        for frame in frames:
            arrival_s = now_s if self._is_real_time else frame.time_s
            self._boards[frame.address].take(frame, arrival_s, self.threshold)
            if self._proximity is not None:
                self._proximity.take(frame, arrival_s if self._has_arrivals else None)
        if frames:
            self._arrived_s = now_s
            self._newest_s = frames[-1].time_s
            if self._is_real_time:
                self._ages_s.append(now_s - self._newest_s)

    def restart_baseline(self) -> None:
        """Request that the baseline of every board is measured again; the next call of `take` begins the measurement.

        Other threads may call this method.
        """
        self._is_baseline_requested = True

    def read(self, now_s: float, is_ended: bool = False) -> SkinReading:
        """Return the current reading of the skin: signals, activity, rates and losses.

        now_s: `time.monotonic`. is_ended: the stream has ended. The next reading contains only the signals after this
        call. Fault records of boards that have restarted are read from the hub.
        """
        clock_s = now_s if self._is_real_time else self._newest_s
        states = list(self._boards.values())
        signal = np.full(self.hand.n_taxels, np.nan)
        active = np.zeros(self.hand.n_taxels, dtype=bool)
        suspect = 0
        targets = self._list_targets()
        near = {each.address for each in targets or () if each.present > 0.5}
        boards = []
        rates = self._rate.update([state.time_s for state in states], [state.frames for state in states])
        counts = self.skin.losses.boards
        for state, rate_hz in zip(states, rates.tolist(), strict=True):
            activation = state.take_activation(clock_s)
            if activation is not None:
                signal[state.taxels], active[state.taxels] = activation.signal_counts, activation.active
                # A conductor near the board raises its counts above the baseline, although the baseline is correct.
                suspect += 0 if state.board.address in near else int(activation.suspect_baseline.sum())
            address = state.board.address
            status = self.skin.hub.board_status.get(address)
            is_expected = self.skin.link.is_recorded or address in self.skin.hub.boards
            boards.append(state.read(activation, clock_s, rate_hz, counts.get(address), status, is_expected))
        # A board that stopped during its baseline never completes it, so it is included only if no board is streaming.
        progress = [board.baseline_progress for board in boards if board.is_streaming]
        progress = progress or [state.progress for state in states if state.frames]
        reading = SkinReading(
            signal_counts=signal,
            active=active,
            raw_counts=self._raw.copy(),
            boards=tuple(boards),
            time_s=self._newest_s,
            watched_s=now_s - self._started_s,
            age_s=self._compute_ages(),
            disturbed=sum(state.disturbed for state in states),
            suspect=suspect,
            baseline_progress=sum(progress) / len(progress) if progress else 0.0,
            cpu_share=float(self._cpu.update([now_s], [time.process_time()])[0]),
            is_ended=is_ended,
            advice=None,
            proximity=targets,
            no_data_since_s=None if is_ended else self._find_silence(now_s),
            **self._read_counters(boards),
        )
        fault = None if is_ended else self._faults.update()
        return replace(reading, advice=make_advice(reading, self.skin) or fault)

    def _list_targets(self) -> tuple[ProximityEstimate, ...] | None:
        """List the latest estimate of each board's target before contact, without estimates that are out of date.

        Returns None if targets are not estimated.
        """
        if self._proximity is None:
            return None
        latest = self._proximity.latest.values()
        return tuple(each for each in latest if self._newest_s - each.time_s <= NO_DATA_S)

    def _read_counters(self, boards: list[BoardReading]) -> dict[str, Any]:
        """Return the counters of the stream and the hub, as a dictionary with the field names of `SkinReading`."""
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
            "unknown": losses.unknown_frames,
            "hub_dropped": status["frames_dropped"] if status else None,
            "bus_recoveries": status["bus_recoveries"] if status else None,
            "cycle_s": status["cycle_time_us"] * 1e-6 if status else None,
        }

    def _find_silence(self, now_s: float) -> float | None:
        """Return the Unix time since which no frame has arrived, seconds; None while frames arrive.

        Also None for a stream that is not in real time, whose clock stops without frames.
        """
        silent_s = now_s - self._arrived_s
        longest_s = NO_DATA_S if self._period_s is None else max(NO_DATA_S, MISSED_PERIODS * self._period_s)
        return time.time() - silent_s if self._is_real_time and silent_s > longest_s else None

    def _compute_ages(self) -> tuple[float, float] | None:
        """Return median and largest of the stored ages of frames, seconds; None if the stream is not in real time."""
        if not self._ages_s:
            return None
        ages = np.array(self._ages_s)
        return float(np.median(ages)), float(ages.max())
