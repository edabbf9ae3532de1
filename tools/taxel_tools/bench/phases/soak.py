"""Phase `soak`: long record of the untouched board."""

from dataclasses import dataclass, field
from typing import Final

import numpy as np

from taxel_tools.bench.analysis.fault import BOARD, Fault
from taxel_tools.bench.board_under_test import BoardUnderTest
from taxel_tools.bench.capture import Capture
from taxel_tools.bench.pictures import draw_time_course
from taxel_tools.errors import BoardError
from taxel_tools.testing.engine import PhaseLog
from taxel_tools.testing.options import Options

PART_S: Final = 5.0
S_PER_MIN: Final = 60.0
US_PER_S: Final = 1e6
CLOCK_SHARE: Final = 0.05
CLOCK_S: Final = 0.05
"""Permitted deviation between board and host clock: 5 % of the elapsed time and 50 ms; a larger one shows a restart."""
QUANTISATION_COUNTS: Final = 0.3
"""Standard deviation of the rounding to whole counts: lower limit of the noise of a board."""


@dataclass
class SoakLog:
    """Results of a soak.

    `silences`: number of times the frames stopped. `restarts`: number of restarts of the board's clock. `missed_scans`:
    scans without a frame. `time_s`, `mean`, `sigma`: for each part of the record its time, the mean raw count of the
    board and the noise of its median taxel.
    """

    silences: int = 0
    restarts: int = 0
    missed_scans: int = 0
    time_s: list[float] = field(default_factory=list)
    mean: list[float] = field(default_factory=list)
    sigma: list[float] = field(default_factory=list)
    _is_silent: bool = False
    _last_clock: tuple[float, int] | None = None

    def add_silence(self) -> None:
        """Record an interruption of the frames; successive calls are treated as one interruption."""
        self.silences += not self._is_silent
        self._is_silent = True

    def add_clock(self, time_s: float, clock_us: int) -> None:
        """Record a reading of the board's clock, microseconds modulo 2^32, at the host time `time_s`.

        A restart is counted if, since the last reading, the board's clock and the host's clock have advanced by
        different times. The tolerance is `CLOCK_SHARE` of the elapsed host time plus `CLOCK_S`.
        """
        if self._last_clock is not None:
            elapsed_s = time_s - self._last_clock[0]
            board_s = ((clock_us - self._last_clock[1]) % 2**32) / US_PER_S
            self.restarts += abs(board_s - elapsed_s) > CLOCK_SHARE * elapsed_s + CLOCK_S
        self._last_clock = time_s, clock_us

    def add_part(self, time_s: float, part: Capture) -> None:
        """Record mean and noise of one part of the frames. time_s: host time since the start of the record."""
        self._is_silent = False
        self.missed_scans += part.missed_scans
        self.time_s.append(time_s)
        self.mean.append(float(part.mean.mean()))
        self.sigma.append(float(np.median(part.raw_counts.std(axis=0))))


class Soak:
    """Phase that records the untouched board for minutes: interruptions, restarts, drift and noise."""

    name = "soak"
    title = "Soak"
    is_automatic = True
    limit_names = frozenset({"silences", "restarts", "missed_scans", "walk", "noise_growth"})

    def find_unmet_requirement(self, board: BoardUnderTest) -> str:
        """Return "", because the soak needs only the board."""
        return ""

    def check_options(self, options: Options) -> None:
        """Check the option of this phase, `minutes`: duration of the long record."""
        self._take_seconds(options)

    def _take_seconds(self, options: Options) -> float:
        """Return the duration of the long record in s, from the option in minutes; default 10 minutes."""
        return options.take_number("minutes", 10.0, 0.1, 10000.0) * S_PER_MIN

    def run(self, board: BoardUnderTest, options: Options, log: PhaseLog) -> None:
        """Record frames of a board for minutes; report interruptions and restarts, drift and growth of the noise."""
        seconds = self._take_seconds(options)
        options.refuse_unknown_keys()
        soak = self._record(board, seconds, log)
        log.measure("silences", soak.silences, "")
        log.measure("restarts", soak.restarts, "")
        if soak.silences or soak.restarts:
            text = (
                f"stopped responding {_format_times(soak.silences)} and restarted {_format_times(soak.restarts)} in "
                f"{seconds / S_PER_MIN:g} minutes; check plug and supply"
            )
            board.evidence.board.append(Fault("unsteady", BOARD, text, float("inf")))
        if len(soak.time_s) < 2:
            log.add_note("too few frames for the other measurements")
            return
        log.measure("missed_scans", soak.missed_scans, "scans")
        mean, times = np.array(soak.mean), np.array(soak.time_s)
        log.measure("walk", float(np.ptp(mean)), "counts")
        log.measure("noise_growth", max(soak.sigma) / max(min(soak.sigma), QUANTISATION_COUNTS), "")
        slope = float(np.polyfit(times, mean, 1)[0]) * S_PER_MIN
        board.attach_picture(log, "soak.png", lambda: draw_time_course(times, mean, slope), "Mean raw count")

    def _record(self, board: BoardUnderTest, seconds: float, log: PhaseLog) -> SoakLog:
        """Record frames and clock readings for `seconds`; interruptions are counted."""
        soak = SoakLog()
        soak.add_clock(board.wire.now_s(), board.read_status()["clock_us"])
        start_s = board.wire.now_s()
        while (elapsed := board.wire.now_s() - start_s) < seconds:
            try:
                # At least 0.5 s, so that the last part has enough frames for its noise.
                soak.add_part(elapsed, board.read_for(min(PART_S, seconds - elapsed + 0.5)))
                soak.add_clock(board.wire.now_s(), board.read_status()["clock_us"])
            except BoardError:
                soak.add_silence()
            log.report_progress((board.wire.now_s() - start_s) / seconds)
        return soak


def _format_times(count: int) -> str:
    """Format how often an event occurred: "once" or "3 times"."""
    return "once" if count == 1 else f"{count} times"
