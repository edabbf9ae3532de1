"""How the untouched board's counts change by themselves."""

from __future__ import annotations

from typing import Final

from taxel_tools.bench.analysis.drift import drift_of
from taxel_tools.bench.analysis.fault import BOARD, Fault
from taxel_tools.bench.pictures import course
from taxel_tools.bench.station import Station
from taxel_tools.testing.engine import PhaseLog
from taxel_tools.testing.options import Options

SURE: Final = 4.0
"""A slope is believed if it is so many times its own error: strong noise has slopes too."""


class Drift:
    """Slope of the board's mean."""

    name = "drift"
    title = "Baseline drift"
    automatic = True
    limit_names = frozenset({"board", "worst_taxel"})

    def unmet(self, context: Station) -> str:
        """Nothing is needed."""
        return ""

    def check_options(self, options: Options) -> None:
        """`seconds`: of the untouched board."""
        self._seconds(options)

    def _seconds(self, options: Options) -> float:
        return options.take_number("seconds", 12.0, 3.0, 36000.0)

    def run(self, context: Station, options: Options, log: PhaseLog) -> None:
        """Measure."""
        seconds = self._seconds(options)
        options.done()
        capture = context.untouched(seconds, log)
        drift = drift_of(capture.raw_counts, capture.time_s)
        log.measure("board", abs(drift.board), "counts/min")
        log.measure("worst_taxel", abs(drift.worst), "counts/min", f"taxel {drift.worst_taxel}")
        log.measure("error", drift.error, "counts/min")
        limit = log.limit("board")
        if limit is not None and not limit.holds(abs(drift.board)) and abs(drift.board) > SURE * drift.error:
            text = f"{drift.board:+.0f} counts a minute, {limit} is allowed: let it warm up, look at its supply"
            context.evidence.board.append(Fault("drift", BOARD, text, limit.severity(abs(drift.board))))
        context.picture(
            log,
            "drift.png",
            lambda: course(drift.time_s, drift.change, drift.board),
            "Change of the untouched board, the median of its taxels",
        )
