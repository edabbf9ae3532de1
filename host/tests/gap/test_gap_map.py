"""Map of the hand on the terminal after a diagnosis."""

import io

import numpy as np
from rich.console import Console

from taxel.cli.gap_map import print_gap_map
from taxel.gap.report.checked_report import FORMAT, VERSIONS
from taxel.hand import load_hand

HAND = load_hand("original")


def draw(excess, hand_name="original", floor=12.0):
    """Return the text of the map for an excess of the taxels, counts squared, f64[n]."""
    stream = io.StringIO()
    lines = {"sensor": HAND.sensor.tolist(), "tx": HAND.tx.tolist(), "rx": HAND.rx.tolist()}
    report = {
        "format": FORMAT,
        "version": VERSIONS[-1],
        "gap": {"floor": floor},
        "inputs": {"lacking": []},
        "taxels": {name: values[: len(excess)] for name, values in lines.items()},
        "taxel_excess": {"before": list(excess), "after": list(excess)},
    }
    print_gap_map(Console(file=stream, width=100, force_terminal=True, highlight=False), report, hand_name)
    return stream.getvalue()


def test_the_map_shows_the_largest_excess_and_the_boards():
    excess = np.zeros(HAND.n_taxels)
    excess[HAND.get_slice(HAND.find_board("palm").address)] = 100.0**2
    text = draw(excess)
    assert "excess of each taxel, 100 counts at most (floor of the whole hand: 12 counts)" in text
    assert "palm" in text


def test_negative_excess_is_shown_as_none():
    assert "0 counts at most" in draw(np.full(HAND.n_taxels, -4.0))


def test_a_hand_without_a_packaged_description_has_no_map():
    assert draw(np.zeros(HAND.n_taxels), hand_name="mat of another laboratory") == ""
    assert draw(np.zeros(HAND.n_taxels - 1)) == ""
