"""What a monitor says of the skin at one moment."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel.hand import Board


@dataclass(frozen=True)
class BoardReading:
    """One board.

    Attributes:
        frames: taken so far.
        rate_hz: frames a second over the last seconds.
        missing, damaged: frames that did not come, and those whose own CRC was wrong (see `taxel.stream.BoardCount`).
        bus_faults: polls that the hub lost on the bus: NACKs, time-outs, CRC and bus errors; None until the hub says.
        silent_s: seconds since the last frame; None before the first.
        active: active taxels.
        largest_signal: counts; NaN while there is no baseline or no frame.
        baseline: share of the baseline's samples that have come, 0 to 1.
        state: a word or two: "streaming", "silent", "absent", "incompatible", "no frame yet".
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
    baseline: float
    state: str

    @property
    def is_well(self) -> bool:
        """Whether its frames come."""
        return self.state == "streaming"


@dataclass(frozen=True, eq=False)
class SkinReading:
    """The whole skin; taxels in the hand's order.

    Attributes:
        signal_counts: f64[n], baseline minus raw count, the largest since the last reading; NaN where unknown.
        active: bool[n], the signal is larger than the threshold.
        raw_counts: u16[n], of the newest frame of each board; 0 before the first.
        boards: one for each board of the hand, in its order.
        time_s: of the newest frame, on the stream's clock; NaN before the first.
        watched_s: seconds since the monitor began, on the clock of its user.
        scans_hz: scans of the whole skin a second: the largest of the boards' rates.
        frames_hz: frames a second, all boards together.
        frames, lost_on_wire, damaged, missing, bytes_discarded, bytes_waiting, hub_restarts: since the beginning.
        hub_dropped: frames that the hub had no room for; bus_recoveries: times it freed the bus; cycle_s: length of its
            last poll cycle. None until the hub says.
        age_s: from the beginning of a scan to its frame being taken, median and largest of the last second; None for
            a stream that is not in real time.
        disturbed: taxels that something touched while the baseline was taken.
        suspect: taxels whose raw count is above the baseline by more than the threshold.
        baseline: share of the baseline's samples that have come from the boards that send, 0 to 1.
        cpu_share: of one core, used by this process lately.
        is_ended: nothing more will come.
        advice: what to do, if anything, in one line.
    """

    signal_counts: NDArray[np.float64]
    active: NDArray[np.bool_]
    raw_counts: NDArray[np.uint16]
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
    hub_dropped: int | None
    bus_recoveries: int | None
    cycle_s: float | None
    age_s: tuple[float, float] | None
    disturbed: int
    suspect: int
    baseline: float
    cpu_share: float
    is_ended: bool
    advice: str | None

    @property
    def boards_streaming(self) -> int:
        """Boards whose frames come."""
        return sum(board.is_well for board in self.boards)

    @property
    def is_measuring(self) -> bool:
        """Whether every board that sends has a baseline, and there is one."""
        return self.baseline >= 1.0

    @property
    def largest_signal(self) -> float:
        """Counts, of all taxels; NaN if nothing is known."""
        known = self.signal_counts[np.isfinite(self.signal_counts)]
        return float(known.max()) if known.size else float("nan")

    def as_dict(self) -> dict[str, Any]:
        """For scripts: numbers that JSON knows, None for what is not known."""
        return {
            "time_s": _known(self.time_s, 6),
            "watched_s": round(self.watched_s, 3),
            "scans_hz": round(self.scans_hz, 3),
            "frames_hz": round(self.frames_hz, 1),
            "boards_streaming": self.boards_streaming,
            "baseline": round(self.baseline, 3),
            "active": int(self.active.sum()),
            "largest_drop": _known(self.largest_signal, 1),
            "frames": self.frames,
            "lost_on_wire": self.lost_on_wire,
            "damaged": self.damaged,
            "missing": self.missing,
            "bytes_discarded": self.bytes_discarded,
            "bytes_waiting": self.bytes_waiting,
            "hub_restarts": self.hub_restarts,
            "hub_dropped": self.hub_dropped,
            "bus_recoveries": self.bus_recoveries,
            "age_s": None if self.age_s is None else [round(age, 4) for age in self.age_s],
            "cpu_share": round(self.cpu_share, 3),
            "advice": self.advice,
            "boards": [_board_dict(board) for board in self.boards],
        }


def _board_dict(reading: BoardReading) -> dict[str, Any]:
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
        "largest_drop": _known(reading.largest_signal, 1),
    }


def _known(value: float, digits: int) -> float | None:
    return round(value, digits) if np.isfinite(value) else None
