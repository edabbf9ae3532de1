"""A long watch over the untouched board."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Final

import numpy as np

from taxel_tools.bench.analysis.fault import BOARD, Fault
from taxel_tools.bench.capture import Capture
from taxel_tools.bench.pictures import course
from taxel_tools.bench.station import Station
from taxel_tools.errors import BoardError
from taxel_tools.testing.engine import PhaseLog
from taxel_tools.testing.options import Options

PART_S: Final = 5.0
S_PER_MIN: Final = 60.0
US_PER_S: Final = 1e6
CLOCK_SHARE: Final = 0.05
CLOCK_S: Final = 0.05
"""A board's clock goes on as the host's does, within 2 % and what a transfer takes; if not, it has begun anew."""
ROUNDING_COUNTS: Final = 0.3
"""Standard deviation of a count's rounding: no board has less noise."""


@dataclass
class Watch:
    """What a watch has seen. `silences`: how often frames ceased; `restarts`: how often the board's clock began anew;
    `time_s`, `mean`, `sigma`: of each part the time, the board's mean count and the noise of its median taxel.
    """

    silences: int = 0
    restarts: int = 0
    missed: int = 0
    time_s: list[float] = field(default_factory=list)
    mean: list[float] = field(default_factory=list)
    sigma: list[float] = field(default_factory=list)
    _is_silent: bool = False
    _clock: tuple[float, int] | None = None

    def fell_silent(self) -> None:
        """No frames came, for the first time or still."""
        self.silences += not self._is_silent
        self._is_silent = True

    def take_clock(self, time_s: float, clock_us: int) -> None:
        """The board's clock was read. clock_us: modulo 2^32."""
        if self._clock is not None:
            elapsed_s = time_s - self._clock[0]
            board_s = ((clock_us - self._clock[1]) % 2**32) / US_PER_S
            self.restarts += abs(board_s - elapsed_s) > CLOCK_SHARE * elapsed_s + CLOCK_S
        self._clock = time_s, clock_us

    def take(self, time_s: float, part: Capture) -> None:
        """Frames came."""
        self._is_silent = False
        self.missed += part.missed
        self.time_s.append(time_s)
        self.mean.append(float(part.mean.mean()))
        self.sigma.append(float(np.median(part.raw_counts.std(axis=0))))


class Soak:
    """Frames for minutes: falls silent, restarts, drifts, gets noisier."""

    name = "soak"
    title = "Soak"
    automatic = True
    limit_names = frozenset({"silences", "restarts", "missed_scans", "walk", "noise_growth"})

    def unmet(self, context: Station) -> str:
        """Nothing is needed."""
        return ""

    def check_options(self, options: Options) -> None:
        """`minutes`."""
        self._seconds(options)

    def _seconds(self, options: Options) -> float:
        return options.take_number("minutes", 10.0, 0.1, 10000.0) * S_PER_MIN

    def run(self, context: Station, options: Options, log: PhaseLog) -> None:
        """Watch."""
        seconds = self._seconds(options)
        options.done()
        watch = self._watch(context, seconds, log)
        log.measure("silences", watch.silences, "")
        log.measure("restarts", watch.restarts, "")
        if watch.silences or watch.restarts:
            text = (
                f"fell silent {_times(watch.silences)} and restarted {_times(watch.restarts)} in "
                f"{seconds / S_PER_MIN:g} minutes: look at its plug and supply"
            )
            context.evidence.board.append(Fault("unsteady", BOARD, text, float("inf")))
        if len(watch.time_s) < 2:
            log.note("too few frames came to say more")
            return
        log.measure("missed_scans", watch.missed, "scans")
        mean, times = np.array(watch.mean), np.array(watch.time_s)
        log.measure("walk", float(np.ptp(mean)), "counts")
        log.measure("noise_growth", max(watch.sigma) / max(min(watch.sigma), ROUNDING_COUNTS), "")
        slope = float(np.polyfit(times, mean, 1)[0]) * S_PER_MIN
        context.picture(log, "soak.png", lambda: course(times, mean, slope), "Mean count over the watch")

    def _watch(self, station: Station, seconds: float, log: PhaseLog) -> Watch:
        watch = Watch()
        watch.take_clock(station.wire.now_s(), station.status()["clock_us"])
        begin = station.wire.now_s()
        while (elapsed := station.wire.now_s() - begin) < seconds:
            try:
                watch.take(elapsed, station.frames_for(min(PART_S, seconds - elapsed + 0.5)))
                watch.take_clock(station.wire.now_s(), station.status()["clock_us"])
            except BoardError:
                watch.fell_silent()
            log.progress((station.wire.now_s() - begin) / seconds)
        return watch


def _times(count: int) -> str:
    return "once" if count == 1 else f"{count} times"
