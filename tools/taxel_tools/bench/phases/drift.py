"""Phase `drift`: drift of the untouched board."""

from typing import Final

from taxel_tools.bench.analysis.drift import fit_drift
from taxel_tools.bench.analysis.fault import BOARD, Fault
from taxel_tools.bench.board_under_test import BoardUnderTest
from taxel_tools.bench.pictures import draw_time_course
from taxel_tools.testing.engine import PhaseLog
from taxel_tools.testing.options import Options

SIGNIFICANT_ERRORS: Final = 4.0
"""A slope is significant above this number of standard errors, because strong noise causes slopes by chance."""


class Drift:
    """Phase that measures the slope of the board's median raw count over time."""

    name = "drift"
    title = "Baseline drift"
    is_automatic = True
    limit_names = frozenset({"board", "worst_taxel"})

    def find_unmet_requirement(self, board: BoardUnderTest) -> str:
        """Return "", because the drift phase needs only the board."""
        return ""

    def check_options(self, options: Options) -> None:
        """Check the option of the drift phase, `seconds`: duration of the record of the untouched board."""
        self._take_seconds(options)

    def _take_seconds(self, options: Options) -> float:
        """Take the duration of the record in s from the options; default 12 s."""
        return options.take_number("seconds", 12.0, 3.0, 36000.0)

    def run(self, board: BoardUnderTest, options: Options, log: PhaseLog) -> None:
        """Measure the drift of the raw counts, and report a significant drift beyond the limit."""
        seconds = self._take_seconds(options)
        options.refuse_unknown_keys()
        capture = board.read_at_rest(seconds, log)
        drift = fit_drift(capture.raw_counts, capture.time_s)
        log.measure("board", abs(drift.board), "counts/min")
        log.measure("worst_taxel", abs(drift.worst), "counts/min", f"taxel {drift.worst_taxel}")
        log.measure("error", drift.error, "counts/min")
        limit = log.get_limit("board")
        is_significant = abs(drift.board) > SIGNIFICANT_ERRORS * drift.error
        if limit is not None and not limit.contains(abs(drift.board)) and is_significant:
            text = f"{drift.board:+.0f} counts/min, limit {limit}; let the board warm up, check its supply"
            board.evidence.board.append(Fault("drift", BOARD, text, limit.severity(abs(drift.board))))
        board.attach_picture(
            log,
            "drift.png",
            lambda: draw_time_course(drift.time_s, drift.change, drift.board),
            "Change of the untouched board, median of its taxels",
        )
