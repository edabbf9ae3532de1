"""Random faults of a soak test."""

import random
from collections.abc import Callable, Sequence
from typing import Final, NamedTuple

from hil_tests.harness.fault_cases import BOOT_S

Steps = Sequence[tuple[float, str, float, float]]
"""(delay in seconds, name of the fault, value, second value)."""


class FaultKind(NamedTuple):
    """A kind of fault.

    `scope`: the frames that the fault may cost: of one board ("board"), of all boards ("bus"), on the UART ("wire"), or
    all frames until the hub has restarted ("hub"). `sample_steps`: random steps of one fault. `duration_s`: time from
    the last step to the end of the fault, seconds.
    """

    name: str
    scope: str
    sample_steps: Callable[[random.Random], Steps]
    duration_s: float


KINDS: Final[tuple[FaultKind, ...]] = (
    FaultKind("nack at a byte", "board", lambda r: [(0.0, "nack_at", r.randrange(60), 0)], 0.0),
    FaultKind("flipped bit", "board", lambda r: [(0.0, "flip_at", r.randrange(60), r.randrange(8))], 0.0),
    FaultKind("short stretch", "board", lambda r: [(0.0, "stretch_at", r.randrange(60), 4000)], 0.0),
    FaultKind("long stretch", "bus", lambda r: [(0.0, "stretch_at", r.randrange(60), 30000)], 0.03),
    FaultKind("arbitration", "board", lambda r: [(0.0, "arbitration_at", r.randrange(60), 0)], 0.0),
    FaultKind("stray stop", "board", lambda r: [(0.0, "bus_error_at", r.randrange(60), 0)], 0.0),
    FaultKind("brown-out", "board", lambda r: [(0.0, "brown_out_at", r.randrange(60), 5)], 0.005 + BOOT_S),
    FaultKind("SDA low", "bus", lambda r: [(0.0, "hold_sda", r.randrange(1, 100), 0)], 0.15),
    FaultKind("SCL low", "bus", lambda r: [(0.0, "hold_scl", r.choice((2000, 20000, 120000)), 0)], 0.15),
    FaultKind("some NACKs", "board", lambda r: [(0.0, "nack", r.randrange(1, 12), 0)], 1.0),
    FaultKind("unplugged", "board", lambda r: [(0.0, "unplug", 0, 0), (r.uniform(0.05, 3.0), "plug", 0, 0)], BOOT_S),
    FaultKind("UART bit", "wire", lambda r: [(0.0, "up_flip", r.randrange(900), r.randrange(8))], 0.1),
    FaultKind("UART loss", "wire", lambda r: [(0.0, "up_drop", r.randrange(900), r.randrange(1, 400))], 0.1),
    FaultKind("UART doubled", "wire", lambda r: [(0.0, "up_double", r.randrange(900), r.randrange(1, 40))], 0.1),
    FaultKind("UART held", "bus", lambda r: [(0.0, "up_delay", r.randrange(5, 90), 0)], 0.1),
    FaultKind("host mute", "bus", lambda r: [(0.0, "mute_host", 1, 0), (r.uniform(0.05, 1.0), "mute_host", 0, 0)], 0.2),
    FaultKind("hub busy", "bus", lambda r: [(0.0, "hub_stall", r.randrange(5, 60), 0)], 0.1),
    FaultKind("hub brown-out", "hub", lambda r: [(0.0, "hub_restart", 0, 0)], 2.5),
    FaultKind(
        "hub unplugged", "hub", lambda r: [(0.0, "hub_unplug", 0, 0), (r.uniform(0.05, 1), "hub_plug", 0, 0)], 2.5
    ),
)

KINDS_WITHOUT_HUB: Final = tuple(
    kind for kind in KINDS if kind.scope not in {"wire", "hub"} and kind.name != "UART held"
)
"""Kinds of a skin without a hub: no fault of a UART, and no fault of a hub's supply."""
