"""The largest signal of each taxel of a stream, as a small map on the terminal."""

import numpy as np
from rich.console import Console

from taxel.hand import Hand
from taxel.monitor.map_picture import draw_signal_map
from taxel.signal import ACTIVATION_THRESHOLD_COUNTS, BASELINE_SAMPLES, Baseline
from taxel.stream import TaxelFrame

MOST_COLUMNS = 100
"""Largest width of the map, characters, at which both sides of the original hand fit beside each other."""


class LargestSignals:
    """Collects the lowest raw count of each taxel after the baseline of its board, the first 100 frames."""

    def __init__(self, hand: Hand) -> None:
        """Create an empty collection of the lowest raw counts (largest signals) of all taxels of `hand`."""
        self._hand = hand
        self._baselines = {board.address: Baseline(board.kind.taxel_count) for board in hand.boards}
        # The largest raw count is the start value of each minimum.
        self._lowest = {board.address: np.full(board.kind.taxel_count, 65_535, np.uint16) for board in hand.boards}

    def add(self, frame: TaxelFrame) -> None:
        """Add a taxel frame: to the baseline of its board, or, after the baseline is complete, to the lowest counts.

        Contact lowers the raw counts. A frame of a board that the hand does not have is ignored.
        """
        baseline = self._baselines.get(frame.address)
        if baseline is None:
            return
        if baseline.is_ready:
            lowest = self._lowest[frame.address]
            np.minimum(lowest, frame.raw_counts, out=lowest)
        else:
            baseline.update(frame.raw_counts)

    def print(self, console: Console) -> None:
        """Print the map of the largest signals; without a complete baseline, print a line with the reason instead."""
        signal = np.full(self._hand.n_taxels, np.nan)
        for address, baseline in self._baselines.items():
            if baseline.is_ready:
                # A lowest count of 65535, the start value, means that no frame followed the baseline.
                found = np.asarray(baseline.mean - self._lowest[address])
                signal[self._hand.get_slice(address)] = np.where(self._lowest[address] < 65_535, found, np.nan)
        if not np.isfinite(signal).any():
            console.print(f"no map: a baseline needs {BASELINE_SAMPLES} frames of a board", highlight=False)
            return
        active = int((np.nan_to_num(signal) > ACTIVATION_THRESHOLD_COUNTS).sum())
        console.print(
            f"largest signal of each taxel after the first {BASELINE_SAMPLES} frames; {active} taxels were active, "
            f"{np.nanmax(signal):.0f} counts at most",
            highlight=False,
            soft_wrap=True,
        )
        width = min(console.width, MOST_COLUMNS)
        has_colour = console.color_system is not None
        console.print(draw_signal_map(self._hand, signal, ACTIVATION_THRESHOLD_COUNTS, width, has_colour))
