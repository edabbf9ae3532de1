"""The map of the largest signals after a recording or a replay on a terminal."""

import io

import numpy as np
import pytest
from rich.console import Console

from taxel.cli.signal_map import LargestSignals
from taxel.hand import load_hand
from taxel.skin import open_skin


def print_map(signals: LargestSignals, width: int = 100) -> list[str]:
    """Print the map on a terminal of `width` characters, and return its lines."""
    console = Console(file=io.StringIO(), width=width, color_system=None, legacy_windows=False)
    signals.print(console)
    return console.file.getvalue().splitlines()


@pytest.fixture(scope="module")
def signals():
    """Largest signals of 9 s of an emulated skin; from 8 s on, taxel 3 of the palm has 400 counts less."""
    with open_skin("emulator:?speed=max&duration_s=9") as skin:
        found = LargestSignals(skin.hand)
        for frame in skin:
            pressed = frame.raw_counts.copy()
            pressed[3] -= np.uint16(400)
            is_pressed = frame.address == skin.hand.boards[-1].address and frame.time_s > 8.0
            found.add(frame._replace(raw_counts=pressed) if is_pressed else frame)
        return found


@pytest.mark.parametrize("width", [100, 80, 40])
def test_map_fits_the_width_and_names_the_palm(signals, width):
    _, *lines = print_map(signals, width)
    text = "\n".join(lines)
    assert "palm" in text
    assert max(map(len, lines)) <= width


def test_first_line_states_the_number_of_active_taxels_and_the_largest_signal(signals):
    text = print_map(signals, 200)[0]
    assert text.startswith("largest signal of each taxel after the first 100 frames; 1 taxels were active, 4")


def test_without_a_baseline_one_line_states_what_is_missing():
    assert print_map(LargestSignals(load_hand("original"))) == ["no map: a baseline needs 100 frames of a board"]
