"""What a campaign on the emulated hand is like: the scatter of reality, and how far its skin is from ideal."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from taxel.campaign.scatter import Scatter
from taxel.errors import TaxelError
from taxel.grasp.timeline import Timeline
from taxel.hand.transforms import from_rotation_vector

OFFSETS = ("bracket_offset", "object_offset")
"""Lines among the effects that displace a board's bracket or an object."""

DEFAULT_EFFECTS = (
    "noise white counts=8",
    "noise line axis=1 counts=4",
    "coupling traces picofarad=2 tx_ohm=400 rx_ohm=400",
    "spread film length_m=0.0045",
)
"""Noise, coupling and spread, which the thesis holds responsible for its gap (5.6.2); their sizes are ours."""

PRESETS: dict[str, Sequence[str]] = {"thesis": DEFAULT_EFFECTS, "none": ()}


class UnknownPresetError(TaxelError, ValueError):
    """A set of effects that has no such name."""

    def __init__(self, name: str) -> None:
        super().__init__(name)

    def __str__(self) -> str:
        names = ", ".join(PRESETS)
        return f"effects: expected {names}, or lines such as 'spread film length_m=0.002', found {self.args[0]!r}"


class OffsetLineError(TaxelError, ValueError):
    """A line that displaces something and does not say how."""

    def __init__(self, line: str) -> None:
        super().__init__(line)

    def __str__(self) -> str:
        line = self.args[0]
        return f"effects: expected a name and six numbers (x y z in metres, rotation vector in rad), found {line!r}"


@dataclass(frozen=True)
class EmulatedSettings:
    """A campaign on the emulated hand.

    effects: lines of the world file without the word `effect` (firmware/emulator/README.md), and lines such as
    "bracket_offset palm 0.001 0 0 0 0 0.02" or "object_offset cylinder ...": how far that bracket or object truly is
    from where it is believed to be (x, y, z in metres, rotation vector in radians, in its own frame). noise_counts:
    white read-out noise of every taxel beside them. scl_hz, baud: of I2C and UART.
    """

    seed: int = 1
    scatter: Scatter = field(default_factory=Scatter)
    effects: Sequence[str] = DEFAULT_EFFECTS
    noise_counts: float = 4.0
    scl_hz: float = 400e3
    baud: float = 1e6
    timeline: Timeline = field(default_factory=Timeline)

    def world_effects(self) -> list[str]:
        """The lines that the world file knows as effects."""
        return [line for line in self.effects if line.split()[0] not in OFFSETS]

    def offsets(self, word: str) -> dict[str, NDArray[np.float64]]:
        """f64[4, 4] by name of what is displaced; `word` is one of `OFFSETS`. Raises `OffsetLineError`."""
        found = {}
        for line in self.effects:
            first, *rest = line.split()
            if first == word:
                found[rest[0] if rest else ""] = _offset(line, rest[1:])
        return found

    def describe(self) -> str:
        """One line for the dataset's generator. It names no effect: what a recording lacks is for others to find."""
        alike = replace(self, effects=tuple(self.effects))  # a list of the same lines is the same campaign
        key = hashlib.sha256(repr(alike).encode()).hexdigest()[:12]
        return f"emulated hand, settings {key}"


def _offset(line: str, words: Sequence[str]) -> NDArray[np.float64]:
    try:
        x, y, z, *rotation = map(float, words)
        offset = from_rotation_vector(np.array(rotation))
    except ValueError:
        raise OffsetLineError(line) from None
    offset[:3, 3] = x, y, z
    if not np.isfinite(offset).all():
        raise OffsetLineError(line)
    return offset


def effects_of(text: str) -> Sequence[str]:
    """A preset by name, or effect lines apart by ';'. Raises `UnknownPresetError` for neither."""
    if text in PRESETS:
        return PRESETS[text]
    lines = [line.strip() for line in text.split(";") if line.strip()]
    if not lines or any(len(line.split()) < 2 for line in lines):
        raise UnknownPresetError(text)
    return lines
