"""What goes wrong in a soak."""

import random
from collections.abc import Callable
from typing import Final

BOOT_S: Final = 0.04
"""From power to the first acknowledge, of the emulated boards."""

Steps = list[tuple[float, str, float, float]]

KINDS: Final[tuple[tuple[str, str, Callable[[random.Random], Steps], float], ...]] = (
    ("nack at a byte", "board", lambda r: [(0.0, "nack_at", r.randrange(60), 0)], 0.0),
    ("flipped bit", "board", lambda r: [(0.0, "flip_at", r.randrange(60), r.randrange(8))], 0.0),
    ("short stretch", "board", lambda r: [(0.0, "stretch_at", r.randrange(60), 4000)], 0.0),
    ("long stretch", "bus", lambda r: [(0.0, "stretch_at", r.randrange(60), 30000)], 0.03),
    ("arbitration", "board", lambda r: [(0.0, "arbitration_at", r.randrange(60), 0)], 0.0),
    ("stray stop", "board", lambda r: [(0.0, "bus_error_at", r.randrange(60), 0)], 0.0),
    ("brown-out", "board", lambda r: [(0.0, "brown_out_at", r.randrange(60), 5)], 0.005 + BOOT_S),
    ("SDA low", "bus", lambda r: [(0.0, "hold_sda", r.randrange(1, 100), 0)], 0.15),
    ("SCL low", "bus", lambda r: [(0.0, "hold_scl", r.choice((2000, 20000, 120000)), 0)], 0.15),
    ("some NACKs", "board", lambda r: [(0.0, "nack", r.randrange(1, 12), 0)], 1.0),
    ("unplugged", "board", lambda r: [(0.0, "unplug", 0, 0), (r.uniform(0.05, 3.0), "plug", 0, 0)], BOOT_S),
    ("UART bit", "wire", lambda r: [(0.0, "up_flip", r.randrange(900), r.randrange(8))], 0.1),
    ("UART loss", "wire", lambda r: [(0.0, "up_drop", r.randrange(900), r.randrange(1, 400))], 0.1),
    ("UART doubled", "wire", lambda r: [(0.0, "up_double", r.randrange(900), r.randrange(1, 40))], 0.1),
    ("UART held", "bus", lambda r: [(0.0, "up_delay", r.randrange(5, 90), 0)], 0.1),
    ("host mute", "bus", lambda r: [(0.0, "mute_host", 1, 0), (r.uniform(0.05, 1.0), "mute_host", 0, 0)], 0.2),
    ("hub busy", "bus", lambda r: [(0.0, "hub_stall", r.randrange(5, 60), 0)], 0.1),
    ("hub brown-out", "hub", lambda r: [(0.0, "hub_restart", 0, 0)], 2.5),
    ("hub unplugged", "hub", lambda r: [(0.0, "hub_unplug", 0, 0), (r.uniform(0.05, 1.0), "hub_plug", 0, 0)], 2.5),
)
"""Name; whose frames it may cost (one board's, everybody's, the wire's, all while the hub is away); its steps, drawn
(after seconds, fault, value, second value); how long it lasts after the last one, seconds.
"""
