"""The location of a gap as a small map of the hand on a terminal."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from rich.console import Console

from taxel.cli.signal_map import MOST_COLUMNS
from taxel.errors import TaxelError
from taxel.gap.report.checked_report import CheckedReport
from taxel.hand import load_hand
from taxel.monitor.map_picture import draw_signal_map


def print_gap_map(console: Console, report: Mapping[str, Any], hand_name: str) -> None:
    """Print a map of the taxels on the terminal: the excess of each taxel, which random variation does not explain.

    The map shows the root of the excess (squared gap minus squared floor), in counts. Nothing is printed if the hand
    has no packaged description with the same taxels. report: content of `report.json`. hand_name: name of the hand in
    the datasets. The name of a board is bright if a value of the board exceeds the floor.
    """
    checked = CheckedReport(report)
    if checked.excess is None:
        return
    try:
        hand = load_hand(hand_name)
    except TaxelError:
        return  # the description is not packaged; the page shows its own picture
    excess = np.sqrt(np.maximum(np.asarray(checked.excess[0], dtype=np.float64), 0.0))
    floor = checked.gap.optional_number("floor") or 0.0
    if len(excess) != hand.n_taxels or floor <= 0.0 or not np.isfinite(excess).any():
        return
    console.print(
        f"excess of each taxel, {np.nanmax(excess):.0f} counts at most (floor of the whole hand: {floor:.0f} counts)",
        highlight=False,
        soft_wrap=True,
    )
    has_colour = console.color_system is not None
    console.print(draw_signal_map(hand, excess, floor, min(console.width, MOST_COLUMNS), has_colour))
