"""Wiring between hub and boards: a star of branches with pull-up resistors, capacitances and series resistances.

The rise time of a line is the time from 30 % to 70 % of the supply after every driver has released the line (NXP
UM10204, rev. 7, section 6). A line with one pull-up resistance R and one capacitance C has the rise time
ln(7/3) R C = 0.8473 R C (UM10204, section 7.1).
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np

from taxel.types import FloatArray

RISE_FACTOR: Final = math.log(7 / 3)
"""Rise time of a line divided by the product of its resistance and capacitance (UM10204, section 7.1)."""

RISE_LIMITS_S: Final = {100e3: 1000e-9, 400e3: 300e-9, 1e6: 120e-9}
"""Largest rise time of each I2C mode, seconds, by the highest clock rate of the mode, hertz (UM10204, table 11)."""

LOW_LEVEL: Final = 0.3
HIGH_LEVEL: Final = 0.7

MIN_PULLUP_OHM: Final = (3.3 - 0.4) / 3e-3
"""Smallest pull-up resistance of a line at 3.3 V: a driver has at most 0.4 V at 3 mA (UM10204, section 7.1)."""

CONTACT_OHM: Final = 0.01
"""Resistance of a connection without series resistance, ohms; the emulator uses the same value."""

BOARD_CAPACITANCE_PF: Final = 10.0
"""Assumed capacitance of one board on a line: pin of the PSoC 4200 (at most 7 pF, data sheet) and copper."""

CABLE_CAPACITANCE_PF: Final = 12.0
"""Assumed capacitance of the flat cable of a branch: 0.25 m at about 50 pF/m."""

DEFAULT_HUB_PULLUP_OHM: Final = 1000.0
DEFAULT_HUB_CAPACITANCE_PF: Final = 10.0


@dataclass(frozen=True)
class Branch:
    """Electrical values of each line (SCL and SDA) of one branch of the wiring.

    Attributes:
        name: such as "index".
        pullup_ohm: pull-up resistor at the boards; 0: none.
        capacitance_pf: capacitance of cable and boards.
        series_ohm: resistance between hub and boards.
    """

    name: str
    pullup_ohm: float
    capacitance_pf: float
    series_ohm: float


@dataclass(frozen=True)
class Wiring:
    """Star of branches between the hub and the boards of a hand.

    Attributes:
        branches: sorted by name.
        is_buffered: a bus buffer separates each branch from the hub; False: all branches are connected.
        hub_pullup_ohm: pull-up resistor of each line at the hub; 0: none.
        hub_capacitance_pf: capacitance of each line at the hub.
    """

    branches: tuple[Branch, ...]
    is_buffered: bool = False
    hub_pullup_ohm: float = DEFAULT_HUB_PULLUP_OHM
    hub_capacitance_pf: float = DEFAULT_HUB_CAPACITANCE_PF


@dataclass(frozen=True)
class RiseTime:
    """Rise time at the boards of a branch, and the highest permitted clock rate.

    Attributes:
        branch: name of the branch; "hub" for the line at the hub.
        rise_s: seconds; infinity: the line stays low.
        highest_scl_hz: highest clock rate whose I2C mode permits the rise time; 0: none.
    """

    branch: str
    rise_s: float
    highest_scl_hz: float


def build_wiring(document: Mapping[str, Any]) -> Wiring | None:
    """Build the wiring of a checked hand description; None if no board has a branch.

    Values that the description does not contain are the assumed defaults of this module.
    """
    sizes: dict[str, int] = {}
    for board in document["boards"]:
        if "branch" in board:
            sizes[board["branch"]] = sizes.get(board["branch"], 0) + 1
    if not sizes:
        return None
    table = document.get("wiring", {})
    described = table.get("branches", {})
    branches = [_build_branch(name, sizes[name], described.get(name, {})) for name in sorted(sizes)]
    wiring = Wiring(
        tuple(branches),
        hub_pullup_ohm=float(table.get("hub_pullup_ohm", DEFAULT_HUB_PULLUP_OHM)),
        hub_capacitance_pf=float(table.get("hub_capacitance_pf", DEFAULT_HUB_CAPACITANCE_PF)),
    )
    return add_buffers(wiring) if table.get("kind") == "buffered" else wiring


def add_buffers(wiring: Wiring) -> Wiring:
    """Return the wiring with a bus buffer before each branch.

    A buffer does not pull up its far side: a branch without a pull-up resistor gets one with the value of the hub's.
    """
    branches = tuple(
        replace(branch, pullup_ohm=branch.pullup_ohm or wiring.hub_pullup_ohm) for branch in wiring.branches
    )
    return replace(wiring, branches=branches, is_buffered=True)


def _build_branch(name: str, board_count: int, table: Mapping[str, Any]) -> Branch:
    """Build a branch with `board_count` boards from its table in the hand description; missing values are assumed."""
    capacitance_pf = table.get("capacitance_pf", board_count * BOARD_CAPACITANCE_PF + CABLE_CAPACITANCE_PF)
    return Branch(name, float(table.get("pullup_ohm", 0.0)), float(capacitance_pf), float(table.get("series_ohm", 0.0)))


def compute_rise_times(wiring: Wiring) -> list[RiseTime]:
    """Compute rise time and highest clock rate: first at the hub, then at the boards of each branch, in their order."""
    if wiring.is_buffered:
        rises = [_solve_rise(wiring, ())[0], *(_solve_rise(None, (branch,))[1] for branch in wiring.branches)]
    else:
        rises = _solve_rise(wiring, wiring.branches)
    names = ["hub", *(branch.name for branch in wiring.branches)]
    return [RiseTime(name, rise_s, find_highest_rate(rise_s)) for name, rise_s in zip(names, rises, strict=True)]


def find_highest_rate(rise_s: float) -> float:
    """Return the highest clock rate, hertz, whose I2C mode permits this rise time; 0 if no mode does."""
    return max((rate for rate, limit_s in RISE_LIMITS_S.items() if rise_s <= limit_s), default=0.0)


def _solve_rise(hub: Wiring | None, branches: tuple[Branch, ...]) -> list[float]:
    """Compute the rise times in one electrical network, seconds: first at the hub, then at each branch.

    A rise time is the time from 30 % to 70 % of the supply. It is infinite in a network without a pull-up resistor.
    hub: wiring whose hub belongs to the network; None for a branch behind a bus buffer, whose output has no pull-up
    resistor and almost no capacitance. Method: the levels V, relative to the supply, obey C dV/dt = i - G V with the
    capacitances C, the conductances G and the currents i of the pull-up resistors. The eigenvectors of C^-1/2 G C^-1/2
    solve this equation. All levels rise monotonically from 0, so each crossing of a level is unique.
    """
    size = 1 + len(branches)
    pullups = np.array([hub.hub_pullup_ohm if hub else 0.0, *(branch.pullup_ohm for branch in branches)])
    farads = 1e-12 * np.array([hub.hub_capacitance_pf if hub else 1e-3, *(each.capacitance_pf for each in branches)])
    source = np.divide(1.0, pullups, out=np.zeros(size), where=pullups > 0)
    matrix = np.diag(source)
    for index, branch in enumerate(branches, 1):
        siemens = 1.0 / max(branch.series_ohm, CONTACT_OHM)
        matrix[[0, index], [0, index]] += siemens
        matrix[[0, index], [index, 0]] -= siemens
    if not source.any():
        return [math.inf] * size
    scale = 1.0 / np.sqrt(farads)
    rates, vectors = np.linalg.eigh(scale[:, None] * matrix * scale)
    modes = scale[:, None] * vectors * (vectors.T @ (np.sqrt(farads) * -1.0))  # deviation from the level 1 at time 0
    return [_find_crossing(mode, rates, HIGH_LEVEL) - _find_crossing(mode, rates, LOW_LEVEL) for mode in modes]


def _find_crossing(mode: FloatArray, rates: FloatArray, level: float) -> float:
    """Return the time t, seconds, at which the rising level 1 + sum(mode exp(-rates t)) reaches `level` (bisection)."""
    low, high = 0.0, 1.0 / float(rates[0])
    while 1.0 + mode @ np.exp(-rates * high) < level:
        high *= 2.0
    for _ in range(80):  # 80 halvings exceed the precision of a float
        middle = (low + high) / 2.0
        if 1.0 + mode @ np.exp(-rates * middle) < level:
            low = middle
        else:
            high = middle
    return high
