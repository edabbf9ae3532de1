"""Phase `rest`: level of the raw counts of the untouched board, constant taxels, constant bits."""

from typing import Final

import numpy as np

from taxel.types import CountArray
from taxel_tools.bench.analysis.fault import BOARD, Fault, format_taxel_name
from taxel_tools.bench.board_under_test import BoardUnderTest
from taxel_tools.bench.pictures import draw_board_map
from taxel_tools.testing.engine import PhaseLog
from taxel_tools.testing.options import Options

FRAMES_MIN: Final = 9
"""In fewer frames, a healthy taxel may have a constant count by chance."""
TAXELS_MIN: Final = 16
"""With fewer taxels, all counts may have the same value of a bit by chance."""
PERCENTILES: Final = (15.0, 85.0)
"""Percentiles that define the range of the counts; a faulty line does not widen this range."""


class Rest:
    """Phase that measures the raw counts of the untouched board and finds constant taxels and constant bits."""

    name = "rest"
    title = "Raw counts at rest"
    is_automatic = True
    limit_names = frozenset({"median", "lowest", "highest"})

    def find_unmet_requirement(self, board: BoardUnderTest) -> str:
        """Return "", because this phase needs only the untouched board."""
        return ""

    def check_options(self, options: Options) -> None:
        """Check the option of this phase, `seconds`: duration of the record of the untouched board."""
        self._take_seconds(options)

    def _take_seconds(self, options: Options) -> float:
        """Take the duration of the record in s from the options; default 2 s."""
        return options.take_number("seconds", 2.0, 0.2, 3600.0)

    def run(self, board: BoardUnderTest, options: Options, log: PhaseLog) -> None:
        """Measure the raw counts of the untouched board, and report constant taxels and constant bits."""
        seconds = self._take_seconds(options)
        options.refuse_unknown_keys()
        kind = board.kind
        raw = board.read_at_rest(seconds, log).raw_counts
        mean = raw.mean(axis=0)
        median = float(np.median(mean))
        log.measure("median", median, "counts")
        log.measure("lowest", float(mean.min()), "counts")
        log.measure("highest", float(mean.max()), "counts")
        limit = log.get_limit("median")
        if limit is not None and not limit.contains(median):
            text = f"median raw count {median:.0f}, limit {limit}; check the current source and the layer"
            board.evidence.at_rest.append(Fault("rest level", BOARD, text, limit.severity(median)))
        is_constant = raw.min(axis=0) == raw.max(axis=0)
        if len(raw) >= FRAMES_MIN and not is_constant.all():
            for taxel in np.nonzero(is_constant)[0].tolist():
                text = f"constant raw count {raw[0, taxel]}; check TX {kind.tx[taxel]}, RX {kind.rx[taxel]}"
                board.evidence.at_rest.append(Fault("dead taxel", format_taxel_name(taxel), text, float("inf")))
        for bit, value in find_stuck_bits(raw[:, ~board.find_faulty_taxels()]):
            text = f"bit {bit} of every raw count is {value}; replace the board"
            board.evidence.board.append(Fault("stuck bit", BOARD, text, float("inf")))
        board.attach_picture(
            log,
            "rest.png",
            lambda: draw_board_map(kind, mean, "raw count at rest"),
            "Mean raw counts of the untouched board",
        )


def find_stuck_bits(raw_counts: CountArray) -> list[tuple[int, int]]:
    """Find bits that have the same value in every count, although the range of the counts covers both values.

    raw_counts: u16[t, taxels]. Constant taxels are ignored. Returns (bit, value) for each such bit.
    """
    varying = raw_counts[:, raw_counts.min(axis=0) != raw_counts.max(axis=0)]
    if varying.size == 0:
        return []
    all_ones, any_ones = int(np.bitwise_and.reduce(varying, axis=None)), int(np.bitwise_or.reduce(varying, axis=None))
    # With few taxels, only the range of the noise of a single taxel is certain to be covered.
    axis = None if varying.shape[1] >= TAXELS_MIN else 0
    covered_range = np.ptp(np.percentile(varying, PERCENTILES, axis=axis), axis=0).min()
    stuck = []
    for bit in range(16):
        if 2 ** (bit + 1) <= covered_range and (all_ones >> bit & 1 or not any_ones >> bit & 1):
            stuck.append((bit, all_ones >> bit & 1))
    return stuck
