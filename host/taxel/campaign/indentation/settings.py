"""Settings of indentation campaigns: defaults for the emulated skin, and settings of the simulator."""

import hashlib
from dataclasses import dataclass, field, replace
from typing import Any

from taxel.campaign.settings import EmulatedSettings
from taxel.campaign.variation import Variation
from taxel.grasp.timeline import Timeline
from taxel.hand import Hand
from taxel.recording.grasp_format import BASELINE_FRAMES
from taxel.sim.sensor_model import SimSensor
from taxel.sim.soft_contact import LayerLaw

RIG_VARIATION = Variation(object_m=0.3e-3, object_rad=0.006, grip=0.04, remount_m=0.08e-3, remount_rad=0.002)
"""Variation of a rig, which places objects and brackets more accurately than an arm and a hand do (assumed). grip:
relative standard deviation of the force."""

I2C_MODES_HZ = (100e3, 400e3, 1e6)
"""Clock frequencies of the I2C standard (NXP UM10204: standard mode, fast mode, fast mode plus)."""

MIN_ROW_RATE_HZ = 18.0
"""Smallest frame rate of an indentation: about ten frames while the skin is loaded."""

SPARE_FRAMES = 8
"""Baseline frames beyond those that the mean of the baseline needs."""

_POLL_BITS, _BOARD_BITS, _TAXEL_BITS = 64, 66, 18


def compute_poll_rate(hand: Hand, scl_hz: float) -> float:
    """Compute the hub's poll cycles per second if only the I2C clock limits the rate, rounded to 0.01.

    scl_hz: I2C clock. Each byte takes 9 bits and each taxel two bytes. The overhead per board and per cycle (addresses,
    header and CRC of a snapshot, a clock read-out, probes) was counted in captures.
    """
    bits = _POLL_BITS + _BOARD_BITS * len(hand.boards) + _TAXEL_BITS * hand.n_taxels
    return round(scl_hz / bits, 2)


def choose_scl_frequency(hand: Hand) -> float:
    """Choose the lowest I2C clock, hertz, that reaches `MIN_ROW_RATE_HZ`; the highest clock if none reaches it.

    A higher clock than necessary would only give more frames, and their emulation would take longer.
    """
    sufficient = [scl_hz for scl_hz in I2C_MODES_HZ if compute_poll_rate(hand, scl_hz) >= MIN_ROW_RATE_HZ]
    return sufficient[0] if sufficient else I2C_MODES_HZ[-1]


def indentation_timeline(hand: Hand) -> Timeline:
    """Make the timeline of an indentation, with a baseline long enough for the frames that the dataset format needs."""
    baseline_s = (BASELINE_FRAMES + SPARE_FRAMES) / compute_poll_rate(hand, choose_scl_frequency(hand))
    return Timeline(round(baseline_s, 2), closing_s=1.2, hold_s=1.2, release_s=0.8, recovery_s=0.8)


def indentation_settings(hand: Hand, **changes: Any) -> EmulatedSettings:
    """Make the settings of the emulated skin of `hand` on a rig: I2C clock and variation, no effects.

    changes: values of fields of `EmulatedSettings`; they also replace the I2C clock, the variation and the effects.
    """
    return replace(EmulatedSettings(variation=RIG_VARIATION, effects=(), scl_hz=choose_scl_frequency(hand)), **changes)


@dataclass(frozen=True)
class SimIndentationSettings:
    """Settings of an indentation campaign in the simulator.

    repeats: indentations per approach, preferably an even number, because `variation` is applied as a balanced design
    (`taxel.campaign.variation.sample_balanced_variation`). law: force law of the layer under one taxel. rate_hz: frame
    rate.
    """

    seed: int = 1
    repeats: int = 4
    variation: Variation = RIG_VARIATION
    law: LayerLaw = field(default_factory=LayerLaw)
    sensor: SimSensor = field(default_factory=SimSensor)
    rate_hz: float = 25.0

    def describe(self) -> str:
        """Return one line for the generator attribute of the dataset, with a digest of the settings."""
        key = hashlib.sha256(repr(self).encode()).hexdigest()[:12]
        return f"simulator, layer sensing, settings {key}"
