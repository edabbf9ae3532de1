"""What a press campaign is like by default: clocks, phases, scatter, and the simulator's side."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, field, replace
from typing import Any

from taxel.campaign.scatter import Scatter
from taxel.campaign.settings import EmulatedSettings
from taxel.grasp.timeline import Timeline
from taxel.hand import Hand
from taxel.recording.grasp_format import BASELINE_FRAMES
from taxel.sim.sensor_model import SimSensor
from taxel.sim.soft_contact import LayerLaw

PRESS_SCATTER = Scatter(object_m=0.3e-3, object_rad=0.006, grip=0.04, remount_m=0.08e-3, remount_rad=0.002)
"""Of a rig, which places objects and brackets better than an arm and a hand do (assumed). grip: of the force."""

I2C_MODES_HZ = (100e3, 400e3, 1e6)
"""Clocks that the I2C standard names (NXP UM10204: standard mode, fast mode, fast mode plus)."""

SLOWEST_HZ = 18.0
"""Rows a second that a press asks for at least: some ten while it is loaded."""

SPARE_FRAMES = 8
"""Of the baseline, beyond those that its mean takes."""

_POLL_BITS, _BOARD_BITS, _TAXEL_BITS = 64, 66, 18


def poll_hz(hand: Hand, scl_hz: float) -> float:
    """Poll cycles a second of the hub when I2C alone limits it: 9 bits a byte, two bytes a taxel, and what a board and
    a cycle cost besides (counted from captures: addresses, snapshot's head and CRC, a clock, probes).
    """
    bits = _POLL_BITS + _BOARD_BITS * len(hand.boards) + _TAXEL_BITS * hand.n_taxels
    return round(scl_hz / bits, 2)


def scl_for(hand: Hand) -> float:
    """The slowest I2C clock that gives a press its rows: more would only cost time."""
    fast = [scl_hz for scl_hz in I2C_MODES_HZ if poll_hz(hand, scl_hz) >= SLOWEST_HZ]
    return fast[0] if fast else I2C_MODES_HZ[-1]


def press_timeline(hand: Hand) -> Timeline:
    """Phases with a baseline as long as the format's number of frames needs."""
    baseline_s = (BASELINE_FRAMES + SPARE_FRAMES) / poll_hz(hand, scl_for(hand))
    return Timeline(round(baseline_s, 2), closing_s=1.2, hold_s=1.2, release_s=0.8, recovery_s=0.8)


def press_settings(hand: Hand, **changes: Any) -> EmulatedSettings:
    """`EmulatedSettings` of a rig with the skin of `hand`: its clock and scatter, no effects, but for `changes`."""
    return replace(EmulatedSettings(scatter=PRESS_SCATTER, effects=(), scl_hz=scl_for(hand)), **changes)


@dataclass(frozen=True)
class SimPressSettings:
    """Presses in the simulator.

    repeats: of every approach; `taxel.campaign.scatter.balanced_draw` goes through `scatter`, which it does best with
    an even number. law: of the layer under one taxel. rate_hz: rows a second.
    """

    seed: int = 1
    repeats: int = 4
    scatter: Scatter = PRESS_SCATTER
    law: LayerLaw = field(default_factory=LayerLaw)
    sensor: SimSensor = field(default_factory=SimSensor)
    rate_hz: float = 25.0

    def describe(self) -> str:
        """One line for the dataset's generator."""
        key = hashlib.sha256(repr(self).encode()).hexdigest()[:12]
        return f"simulator, layer sensing, settings {key}"
