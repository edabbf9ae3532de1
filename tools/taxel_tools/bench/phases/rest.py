"""Counts at rest: the board's level, taxels that never change, bits that never change."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from taxel_tools.bench.analysis.fault import BOARD, Fault, taxel_name
from taxel_tools.bench.pictures import board_map
from taxel_tools.bench.station import Station
from taxel_tools.testing.engine import PhaseLog
from taxel_tools.testing.options import Options

FRAMES_MIN: Final = 9
"""Fewer frames may show the same count by chance."""
TAXELS_MIN: Final = 16
"""Of fewer taxels, all may lie on one side of a bit by chance."""
MOST: Final = (15.0, 85.0)
"""Percentiles between which counts are taken to be spread: a line that is off by itself does not widen that."""


class Rest:
    """Median raw count, counts that stand still."""

    name = "rest"
    title = "Counts at rest"
    automatic = True
    limit_names = frozenset({"median", "lowest", "highest"})

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
        raw = station.untouched(seconds, log).raw_counts
        mean = raw.mean(axis=0)
        median = float(np.median(mean))
        log.measure("median", median, "counts")
        log.measure("lowest", float(mean.min()), "counts")
        log.measure("highest", float(mean.max()), "counts")
        limit = log.limit("median")
        if limit is not None and not limit.holds(median):
            text = f"the median count is {median:.0f}, it should be {limit}: look at the current source and the layer"
            station.evidence.at_rest.append(Fault("rest level", BOARD, text, limit.severity(median)))
        still = raw.min(axis=0) == raw.max(axis=0)
        if len(raw) >= FRAMES_MIN and not still.all():
            for taxel in np.nonzero(still)[0].tolist():
                text = f"always reads {raw[0, taxel]}: look at TX {kind.tx[taxel]}, RX {kind.rx[taxel]}"
                station.evidence.at_rest.append(Fault("dead taxel", taxel_name(taxel), text, float("inf")))
        for bit, value in stuck_bits(raw[:, ~station.faulty()]):
            text = f"bit {bit} of every count reads {value}: exchange the board"
            station.evidence.board.append(Fault("stuck bit", BOARD, text, float("inf")))
        station.picture(
            log,
            "rest.png",
            lambda: board_map(kind, mean, "raw count at rest"),
            "Mean counts, nothing touches the board",
        )


def stuck_bits(raw_counts: NDArray[np.uint16]) -> list[tuple[int, int]]:
    """Bits that are the same in every count though most counts are spread over more than that bit's two values, and
    what they read. raw_counts: u16[t, taxels]. Taxels that never change are left out.
    """
    moving = raw_counts[:, raw_counts.min(axis=0) != raw_counts.max(axis=0)]
    if moving.size == 0:
        return []
    all_ones, any_ones = int(np.bitwise_and.reduce(moving, axis=None)), int(np.bitwise_or.reduce(moving, axis=None))
    # Of few taxels only what noise itself moves is sure: the spread of one of them.
    spread = np.ptp(np.percentile(moving, MOST, axis=None if moving.shape[1] >= TAXELS_MIN else 0), axis=0).min()
    found = []
    for bit in range(16):
        if 2 ** (bit + 1) <= spread and (all_ones >> bit & 1 or not any_ones >> bit & 1):
            found.append((bit, all_ones >> bit & 1))
    return found
