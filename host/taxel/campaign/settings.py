"""Settings of a campaign on the emulated hand: variation between repeats, and effects of the emulated skin."""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from taxel.campaign.attempts import MAX_ATTEMPTS
from taxel.campaign.variation import Variation
from taxel.errors import TaxelError
from taxel.grasp.timeline import Timeline
from taxel.hand.transforms import from_rotation_vector

OFFSETS = ("bracket_offset", "object_offset")
"""First words of the effect lines that displace a board's bracket or an object."""

DEFAULT_EFFECTS = (
    "noise white counts=8",
    "noise line axis=1 counts=4",
    "coupling traces picofarad=2 tx_ohm=400 rx_ohm=400",
    "spread film length_m=0.0045",
)
"""Noise, coupling and spread, to which the thesis attributes its gap (5.6.2); the magnitudes are chosen."""

PRESETS: dict[str, Sequence[str]] = {"thesis": DEFAULT_EFFECTS}


class UnknownPresetError(TaxelError, ValueError):
    """A string is neither the name of a preset of effects nor a list of effect lines."""

    def __init__(self, name: str) -> None:
        """Create the error. name: the string that is neither the name of a preset nor a list of effect lines."""
        super().__init__(name)

    def _format_message(self) -> str:
        """Format the error as one line with the names of the presets and the text found."""
        names = ", ".join(PRESETS)
        return f"effects: expected {names} or lines such as 'spread film length_m=0.002', found {self.args[0]!r}"


class OffsetLineError(TaxelError, ValueError):
    """An effect line that displaces a bracket or an object lacks the name or the six finite numbers."""

    def __init__(self, line: str) -> None:
        """Create the error of an effect line with an invalid displacement. line: the whole line."""
        super().__init__(line)

    def _format_message(self) -> str:
        """Format the error as one line with the expected format and the line found."""
        line = self.args[0]
        return f"effects: expected a name and six numbers (x y z in metres, rotation vector in rad), found {line!r}"


@dataclass(frozen=True)
class EmulatedSettings:
    """Settings of a campaign on the emulated hand.

    effects: lines of the world file without the word `effect` (firmware/emulator/README.md), and offset lines such as
    "bracket_offset palm 0.001 0 0 0 0 0.02" or "object_offset cylinder ...": the true pose of that bracket or object
    relative to its nominal pose (x, y, z in metres, rotation vector in radians, in its own frame). noise_counts:
    standard deviation of the white read-out noise of every taxel, added to the effects. scl_hz: I2C clock. baud: UART.
    max_attempts: largest number of attempts of a grasp that fails (`taxel.campaign.failure`), 1: no repetition.
    """

    seed: int = 1
    variation: Variation = field(default_factory=Variation)
    effects: Sequence[str] = DEFAULT_EFFECTS
    noise_counts: float = 4.0
    scl_hz: float = 400e3
    baud: float = 1e6
    timeline: Timeline = field(default_factory=Timeline)
    max_attempts: int = MAX_ATTEMPTS

    def world_effect_lines(self) -> list[str]:
        """Return the effect lines for the emulator's world file, without the displacements of brackets and objects."""
        return [line for line in self.effects if line.split()[0] not in OFFSETS]

    def offsets(self, keyword: str) -> dict[str, NDArray[np.float64]]:
        """Parse the effect lines that displace brackets or objects; return displacements f64[4, 4] by board or object.

        keyword: "bracket_offset" or "object_offset". Raises `OffsetLineError`.
        """
        offsets = {}
        for line in self.effects:
            first, *arguments = line.split()
            if first == keyword:
                offsets[arguments[0] if arguments else ""] = _parse_offset(line, arguments[1:])
        return offsets

    def describe(self) -> str:
        """Return one line for the generator attribute of the dataset, with a digest of the settings.

        The digest does not reveal the effects, which a gap diagnosis must find without help.
        """
        normalised = replace(self, effects=tuple(self.effects))  # a list and a tuple of the same lines are equivalent
        key = hashlib.sha256(repr(normalised).encode()).hexdigest()[:12]
        return f"emulated hand, settings {key}"


def _parse_offset(line: str, numbers: Sequence[str]) -> NDArray[np.float64]:
    """Parse the displacement f64[4, 4] of an effect line. Raises OffsetLineError.

    line: whole line, for the message. numbers: x, y, z in metres and a rotation vector in radians.
    """
    try:
        x, y, z, *rotation = map(float, numbers)
        offset = from_rotation_vector(np.array(rotation))
    except ValueError:
        raise OffsetLineError(line) from None
    offset[:3, 3] = x, y, z
    if not np.isfinite(offset).all():
        raise OffsetLineError(line)
    return offset


def parse_effects(text: str) -> Sequence[str]:
    """Return the effect lines of the preset `text`, or the lines that ';' separates in `text`.

    Raises `UnknownPresetError` for a string that is neither.
    """
    if text in PRESETS:
        return PRESETS[text]
    lines = [line.strip() for line in text.split(";") if line.strip()]
    if not lines or any(len(line.split()) < 2 for line in lines):
        raise UnknownPresetError(text)
    return lines
