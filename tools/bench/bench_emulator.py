"""Speed of the emulator relative to real time: 17 boards, 400 kHz, uncompressed frames, permanent contact on every
board.
"""

import os
import statistics
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from figures import Figure
from recordings import record

from taxel.emulated.scene import EmulatedScene, format_scene
from taxel.hand import load_hand
from taxel.hand.indentation import Indentation, compute_force_shares
from taxel.hand.world import WorldSettings, format_world
from taxel.link import write_stimulus

VIRTUAL_S, REPEATS, THREADS_MAX = 60.0, 5, 4
IDEAL_TARGET, ALL_EFFECTS_TARGET = 100.0, 20.0
EFFECTS = (
    "coupling traces picofarad=2 tx_ohm=400 rx_ohm=400",
    "noise white counts=8",
    "noise line axis=1 counts=4",
    "noise pink counts=3",
    "noise impulse counts=20 rate_hz=0.5",
    "gain electrode log_std=0.1",
    "gain idac log_std=0.05",
    "drift warm_up counts=100 seconds=300",
    "drift wander counts=20 seconds=60",
    "saturation soft counts=8000",
    "dead rest board=0x08 taxel=3",
    "dead stuck board=0x09 taxel=4 value=100",
    "line open board=0x0A axis=0 index=1",
    "line short board=0x0B axis=1 index=1",
    "silent flaky p=0.01",
    "late delay seconds=0.02",
    "late lag seconds=0.05",
    "clock skew ppm=100",
    "clock wander ppm=50 period=60",
    "stuck_bit low bit=0 board=0x0C",
    "droop supply ohms=100",
    "droop reference ohms=100",
    "nonlinear dead_zone leak=0.001",
    "nonlinear bow counts=20",
    "spread film length_m=0.0045",
    "spread pillars slope=0.2",
    "rheology solid fraction=0.2 seconds=1",
    "rheology play fraction=0.1 width_m=5e-5 seconds=10",
    "indent set fraction=0.1 threshold_m=1e-4 recovery_s=60",
    "indent bedding fraction=0.1 work_j_m2=100",
    "proximity wedge share=0.1 reach_m=0.002",
    "moisture drying board=0x0D tx=1 rx=1 radius_m=0.01 water=0.1 seconds=60",
    "modulus taxels log_std=0.1",
    "modulus board board=0x0E factor=1.2",
)
"""Every effect except exchanged boards, in each form that can be combined with the others."""


def _write_contacts(path: Path) -> None:
    """Write a stimulus file with one contact on every board.

    The force of each contact varies between 1 N and 9 N over `VIRTUAL_S` seconds.
    """
    hand = load_hand("original")
    times = np.arange(0.0, VIRTUAL_S, 0.02)
    share = sum(
        compute_force_shares(
            hand, Indentation(b.name, b.kind.layout_shape[0] / 2, b.kind.layout_shape[1] / 2, 1.0, 0.0)
        )
        for b in hand.boards
    )
    write_stimulus(path, times, np.outer(5.0 + 4.0 * np.sin(times), share))


def _measure_speed(folder: Path, world: str, threads: int) -> tuple[float, dict[str, Any]]:
    """Run the emulator program on a world file `REPEATS` times.

    Returns the median of the virtual seconds per second of real time, and the statistics of the last run.
    """
    speeds = []
    for _ in range(REPEATS):
        before = time.perf_counter()
        _, run = record(folder, VIRTUAL_S, folder / "contacts.stm", world=world, threads=threads)
        speeds.append(VIRTUAL_S / (time.perf_counter() - before))
    return statistics.median(speeds), run


def measure() -> list[Figure]:
    """Run the benchmark of the emulator: virtual seconds per second of real time, one thread per available core."""
    hand, threads = load_hand("original"), min(len(os.sched_getaffinity(0)), THREADS_MAX)
    worlds = {
        "ideal skin": (IDEAL_TARGET, format_world(hand, WorldSettings())),
        "all effects": (ALL_EFFECTS_TARGET, format_scene(hand, EmulatedScene({}), WorldSettings(effects=EFFECTS))),
    }
    figures = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        _write_contacts(folder / "contacts.stm")
        for condition, (target, world) in worlds.items():
            single_speed, _ = _measure_speed(folder, world, 1)
            speed, run = _measure_speed(folder, world, threads)
            detail = (
                f"{threads} threads ({single_speed:.0f} x with one thread); "
                f"{1e6 / run['cycle_time_us']:.2f} scans/s, bus {100 * run['bus_busy']:.1f} % busy"
            )
            figures.append(Figure(f"emulator, 17 boards, {condition}", speed, target, "real time", detail))
    return figures
