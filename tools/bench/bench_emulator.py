"""The emulator against real time: 17 boards, 400 kHz, plain frames, noise, a press on every board all the time."""

import statistics
import tempfile
from pathlib import Path

import numpy as np
from figures import Figure
from recorded import record

from taxel.hand import load_hand
from taxel.hand.press import Press, share_of_force
from taxel.link import write_stimulus

VIRTUAL_SECONDS = 60.0
REPEATS = 5


def _pressed_everywhere(path: Path) -> None:
    hand = load_hand("allegro")
    times = np.arange(0.0, VIRTUAL_SECONDS, 0.02)
    share = sum(
        share_of_force(hand, Press(b.name, b.kind.tx_count / 2, b.kind.rx_count / 2, 1.0, 0.0)) for b in hand.boards
    )
    write_stimulus(path, times, np.outer(5.0 + 4.0 * np.sin(times), share))


def measure() -> list[Figure]:
    """Virtual seconds in a wall second."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        _pressed_everywhere(folder / "presses.stm")
        runs = [record(folder, VIRTUAL_SECONDS, folder / "presses.stm")[1] for _ in range(REPEATS)]
    ratio = statistics.median(run["virtual_seconds"] / run["wall_seconds"] for run in runs)
    rate = 1e6 / runs[0]["cycle_time_us"]
    detail = f"{rate:.2f} scans/s of 17 boards, bus {100 * runs[0]['bus_busy']:.1f} % busy"
    return [Figure("emulator, fast mode", ratio, 50.0, "real time", detail)]
