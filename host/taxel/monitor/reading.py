"""State of the skin at one moment (a reading), which the views display."""

from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any

import numpy as np

from taxel.hand import Board
from taxel.proximity import ProximityEstimate
from taxel.types import BoolArray, CountArray, FloatArray


@dataclass(frozen=True)
class BoardReading:
    """State of one board in a reading of the skin monitor.

    Attributes:
        frames: number of processed frames.
        rate_hz: frames per second over about the last two seconds.
        missing, damaged: numbers of missing frames, and of frames with a wrong CRC of the board (see
            `taxel.stream.BoardCount`).
        bus_faults: number of failed polls of the board by the hub (NACKs, time-outs, CRC and bus errors); None before
            the hub has reported it.
        silent_s: seconds since the last frame; None before the first frame.
        active: number of active taxels.
        largest_signal: largest signal of the board's taxels, counts; NaN without a baseline or without frames.
        baseline_progress: share of the baseline's frames that have arrived, 0 to 1.
        state: "streaming", "silent", "absent", "incompatible" or "no frame yet".
    """

    board: Board
    frames: int
    rate_hz: float
    missing: int
    damaged: int
    bus_faults: int | None
    silent_s: float | None
    active: int
    largest_signal: float
    baseline_progress: float
    state: str

    @property
    def is_streaming(self) -> bool:
        """Whether frames of the board arrive."""
        return self.state == "streaming"


@dataclass(frozen=True, eq=False)
class SkinReading:
    """State of the whole skin; taxels in the hand's order.

    Attributes:
        signal_counts: f64[n], largest signal since the last reading, counts; NaN where unknown.
        active: bool[n], whether the signal exceeds the threshold.
        raw_counts: u16[n], counts of the newest frame of each board; 0 before the first frame.
        boards: one reading for each board of the hand, in the hand's order.
        time_s: time of the newest frame on the stream's clock; NaN before the first frame.
        watched_s: seconds since the start of the monitor.
        scans_hz: scans of the whole skin per second: the largest frame rate of a board.
        frames_hz: frames of all boards per second.
        frames, lost_on_wire, damaged, missing, bytes_discarded, hub_restarts: totals since the start. damaged: frames
            with a wrong CRC of their board.
        bytes_waiting: received bytes that are not processed yet.
        unknown: intact frames of a type or a length that this version does not define; a newer hub sends them.
        hub_dropped: frames that the hub discarded because its buffer was full. bus_recoveries: recoveries of the bus
            by the hub. cycle_s: duration of the last poll cycle. None before the hub has reported them.
        age_s: time from the start of a scan to the processing of its frame, median and largest value of about the last
            second, seconds; None for a stream that is not in real time.
        disturbed: number of taxels that were touched during the baseline.
        suspect: number of taxels whose raw count is above the baseline by more than the threshold.
        baseline_progress: share of the baseline's frames that have arrived, mean of the sending boards, 0 to 1.
        cpu_share: share of one processor core that this process has used recently.
        is_ended: the stream has ended.
        advice: the most serious problem and the action of the user, in one line; None if there is no problem.
        no_data_since_s: Unix time of the last frame, seconds, if none has arrived for longer than `NO_DATA_S`; else
            None. Rates and signals are then out of date.
        proximity: targets in front of the boards before contact; None if they are not estimated.
    """

    signal_counts: FloatArray
    active: BoolArray
    raw_counts: CountArray
    boards: tuple[BoardReading, ...]
    time_s: float
    watched_s: float
    scans_hz: float
    frames_hz: float
    frames: int
    lost_on_wire: int
    damaged: int
    missing: int
    bytes_discarded: int
    bytes_waiting: int
    hub_restarts: int
    unknown: int
    hub_dropped: int | None
    bus_recoveries: int | None
    cycle_s: float | None
    age_s: tuple[float, float] | None
    disturbed: int
    suspect: int
    baseline_progress: float
    cpu_share: float
    is_ended: bool
    advice: str | None
    no_data_since_s: float | None = None
    proximity: tuple[ProximityEstimate, ...] | None = None

    @property
    def boards_streaming(self) -> int:
        """Number of boards whose frames arrive."""
        return sum(board.is_streaming for board in self.boards)

    @property
    def is_measuring(self) -> bool:
        """Whether the baseline of every sending board is complete."""
        return self.baseline_progress >= 1.0

    @property
    def largest_signal(self) -> float:
        """Largest signal of all taxels, counts; NaN if all are unknown."""
        finite = self.signal_counts[np.isfinite(self.signal_counts)]
        return float(finite.max()) if finite.size else float("nan")

    def as_dict(self) -> dict[str, Any]:
        """Convert the reading to the dictionary that `taxel monitor --json` prints; None for unknown values."""
        values = {
            "time_s": _round_finite(self.time_s, 6),
            "watched_s": round(self.watched_s, 3),
            "scans_hz": round(self.scans_hz, 3),
            "frames_hz": round(self.frames_hz, 1),
            "boards_streaming": self.boards_streaming,
            "baseline": round(self.baseline_progress, 3),
            "active": int(self.active.sum()),
            "largest_drop": _round_finite(self.largest_signal, 1),
            "frames": self.frames,
            "lost_on_wire": self.lost_on_wire,
            "damaged": self.damaged,
            "missing": self.missing,
            "bytes_discarded": self.bytes_discarded,
            "bytes_waiting": self.bytes_waiting,
            "hub_restarts": self.hub_restarts,
            "unknown": self.unknown,
            "hub_dropped": self.hub_dropped,
            "bus_recoveries": self.bus_recoveries,
            "age_s": None if self.age_s is None else [round(age, 4) for age in self.age_s],
            "cpu_share": round(self.cpu_share, 3),
            "no_data_since": None if self.no_data_since_s is None else _format_utc(self.no_data_since_s),
            "advice": self.advice,
            "boards": [_make_board_dict(board) for board in self.boards],
        }
        if self.proximity is not None:
            values["proximity"] = [estimate.as_dict() for estimate in self.proximity]
        return values


def _format_utc(unix_s: float) -> str:
    """Format Unix seconds as ISO 8601 in UTC."""
    return datetime.fromtimestamp(unix_s, UTC).isoformat(timespec="seconds")


def _make_board_dict(reading: BoardReading) -> dict[str, Any]:
    """Convert the reading of a board to a dictionary with the JSON keys of `taxel monitor --json`."""
    return {
        "address": reading.board.address,
        "name": reading.board.name,
        "state": reading.state,
        "rate_hz": round(reading.rate_hz, 3),
        "frames": reading.frames,
        "missing": reading.missing,
        "damaged": reading.damaged,
        "bus_faults": reading.bus_faults,
        "active": reading.active,
        "largest_drop": _round_finite(reading.largest_signal, 1),
    }


def _round_finite(value: float, digits: int) -> float | None:
    """Round a number to `digits` decimals; None for NaN and infinity, which JSON lacks."""
    return round(value, digits) if np.isfinite(value) else None
