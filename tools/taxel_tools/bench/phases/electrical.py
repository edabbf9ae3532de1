"""Opens and shorts of each line, from the counts of the untouched board."""

from __future__ import annotations

from typing import Final

import numpy as np

from taxel_tools.bench.analysis.at_rest import AtRest, line_faults, mean_error
from taxel_tools.bench.analysis.fault import BOARD, Axis, Fault, line_name
from taxel_tools.bench.pictures import board_map
from taxel_tools.bench.station import Station
from taxel_tools.testing.engine import PhaseLog
from taxel_tools.testing.options import Options

LEAST: Final = 0.6
"""Relative capacitance of a sound crossing, where the plan says nothing."""
SIGNAL: Final = 0.02
"""Share of the largest count below which no taxel of a board measures anything."""


class Electrical:
    """Relative capacitances of all crossings; lines that stand out of them."""

    name = "electrical"
    title = "Opens and shorts"
    automatic = True
    limit_names = frozenset({"capacitance", "signal"})

    def unmet(self, context: Station) -> str:
        """Nothing is needed."""
        return ""

    def check_options(self, options: Options) -> None:
        """`seconds`: of the untouched board."""
        self._seconds(options)

    def _seconds(self, options: Options) -> float:
        return options.take_number("seconds", 2.0, 0.2, 3600.0)

    def run(self, context: Station, options: Options, log: PhaseLog) -> None:
        """Measure."""
        seconds = self._seconds(options)
        options.done()
        station, kind = context, context.kind
        capture = station.untouched(seconds, log)
        rest = AtRest(kind, station.largest_count - capture.mean, mean_error(capture.raw_counts), station.largest_count)
        signal = float(np.median(rest.hardware)) / station.largest_count
        log.measure("signal", signal, "of the largest count")
        if signal < SIGNAL:
            text = (
                f"its counts hold {signal:.1%} of what they could: look at the supply of its TX drivers and its RX side"
            )
            station.evidence.board.append(Fault("no signal", BOARD, text, float("inf")))
            return
        limit = log.limit("capacitance")
        least = limit.minimum if limit is not None and limit.minimum is not None else LEAST
        faults, marked = line_faults(rest, least)
        station.evidence.at_rest += faults
        for axis, lines in ((Axis.TX, kind.tx), (Axis.RX, kind.rx)):
            for index in np.unique(lines).tolist():
                share = float(np.median(rest.relative[lines == index]))
                log.measure("capacitance", share, "of the median", line_name(axis, index))
        log.measure("spread", rest.spread, "of the median")
        station.picture(
            log,
            "capacitance.png",
            lambda: board_map(kind, rest.relative, "capacitance over the board's median", marked),
            "Capacitance of each crossing; what is not as it should be is framed",
        )
