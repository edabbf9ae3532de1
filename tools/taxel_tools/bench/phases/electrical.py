"""Phase `electrical`: open and shorted lines, from the raw counts of the untouched board."""

from typing import Final

import numpy as np

from taxel_tools.bench.analysis.at_rest import RestCounts, compute_standard_error, find_line_faults
from taxel_tools.bench.analysis.fault import BOARD, Axis, Fault, format_line_name
from taxel_tools.bench.board_under_test import BoardUnderTest
from taxel_tools.bench.pictures import draw_board_map
from taxel_tools.testing.engine import PhaseLog
from taxel_tools.testing.options import Options

CAPACITANCE_MIN: Final = 0.6
"""Least relative capacitance of a healthy crossing, for a plan without this limit."""
SIGNAL_MIN: Final = 0.02
"""Share of the full-scale count below which no taxel of the board measures a capacitance."""


class Electrical:
    """Phase that measures the relative capacitances of all crossings and finds lines with deviating capacitances."""

    name = "electrical"
    title = "Opens and shorts"
    is_automatic = True
    limit_names = frozenset({"capacitance", "signal"})

    def find_unmet_requirement(self, board: BoardUnderTest) -> str:
        """Return "", because the electrical phase needs only the board."""
        return ""

    def check_options(self, options: Options) -> None:
        """Check the option of the electrical phase, `seconds`: duration of the record of the untouched board."""
        self._take_seconds(options)

    def _take_seconds(self, options: Options) -> float:
        """Take the duration of the record in s from the options; default 2 s."""
        return options.take_number("seconds", 2.0, 0.2, 3600.0)

    def run(self, board: BoardUnderTest, options: Options, log: PhaseLog) -> None:
        """Measure the relative capacitance of each line and find line faults.

        A board whose counts are far below full scale has the single fault "no signal".
        """
        seconds = self._take_seconds(options)
        options.refuse_unknown_keys()
        kind, full_scale = board.kind, board.full_scale_count
        capture = board.read_at_rest(seconds, log)
        error = compute_standard_error(capture.raw_counts)
        counts = RestCounts(kind, full_scale - capture.mean, error, full_scale)
        signal = float(np.median(counts.hardware)) / full_scale
        log.measure("signal", signal, "of the largest count")
        if signal < SIGNAL_MIN:
            text = f"counts have {signal:.1%} of full scale; check the supply of the TX drivers and the RX side"
            board.evidence.board.append(Fault("no signal", BOARD, text, float("inf")))
            return
        limit = log.get_limit("capacitance")
        minimum = limit.minimum if limit is not None and limit.minimum is not None else CAPACITANCE_MIN
        faults, marked = find_line_faults(counts, minimum)
        board.evidence.at_rest += faults
        relative = counts.relative_capacitance
        for axis, lines in ((Axis.TX, kind.tx), (Axis.RX, kind.rx)):
            for index in np.unique(lines).tolist():
                share = float(np.median(relative[lines == index]))
                log.measure("capacitance", share, "of the median", format_line_name(axis, index))
        log.measure("spread", counts.spread, "of the median")
        board.attach_picture(
            log,
            "capacitance.png",
            lambda: draw_board_map(kind, relative, "capacitance / median of the board", marked),
            "Capacitance of each crossing; faulty crossings have a frame",
        )
