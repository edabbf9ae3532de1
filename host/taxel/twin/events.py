"""Events of a twin: alarms, causes, cleared alarms, and faults of the input."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from taxel.twin.places import Place


@dataclass(frozen=True)
class Alarm:
    """A change of a quantity at a place.

    number: from 1, in order of time. time_s: of the alarm. onset_s, onset_ci95: estimated onset with its interval.
    quantity: of `taxel.twin.statistics.QUANTITIES`. amplitude: in `unit`. size_counts: change of the largest signal at
    the place, counts; None for a quantity without counts. words: the quantity for people.
    """

    number: int
    time_s: float
    place: Place
    quantity: str
    amplitude: float
    unit: str
    size_counts: float | None
    onset_s: float
    onset_ci95: tuple[float, float]
    words: str

    def to_json(self) -> dict[str, Any]:
        """The alarm as an event of `taxel twin --json`."""
        return {
            "time_s": self.time_s,
            "event": "alarm",
            "alarm": self.number,
            "place": self.place.to_json(),
            "quantity": self.quantity,
            "amplitude": self.amplitude,
            "unit": self.unit,
            "size_counts": self.size_counts,
            "onset_s": self.onset_s,
            "onset_ci95": list(self.onset_ci95),
        }

    def __str__(self) -> str:
        size = f", {self.size_counts:+.0f} counts" if self.size_counts is not None else ""
        low, high = self.onset_ci95
        return (
            f"{format_time(self.time_s)} alarm {self.number}: {self.words} of {self.place} has changed"
            f" ({self._format_amplitude()}{size}); onset {format_time(self.onset_s)}"
            f" ({format_time(low)} to {format_time(high)})"
        )

    def _format_amplitude(self) -> str:
        """The amplitude in the unit of people."""
        if self.quantity == "missing":
            return f"{100 * self.amplitude:.0f} % missing"
        if self.unit == "1":
            return f"{100 * self.amplitude:+.0f} %"
        if self.unit == "s":
            return f"{1e3 * self.amplitude:+.0f} ms"
        if self.unit == "ln":
            return f"x {2.718281828 ** (0.5 * self.amplitude):.2g}"
        return f"{self.amplitude:+.0f} {self.unit}"


@dataclass(frozen=True)
class Cleared:
    """An alarm whose quantity has its reference value again."""

    time_s: float
    alarm: Alarm

    def to_json(self) -> dict[str, Any]:
        """The event of `taxel twin --json`."""
        return {**self.alarm.to_json(), "event": "cleared", "time_s": self.time_s}

    def __str__(self) -> str:
        return f"{format_time(self.time_s)} alarm {self.alarm.number} cleared: {self.alarm.words} of {self.alarm.place}"


@dataclass(frozen=True)
class InputFault:
    """A fault of the input, which interrupts the comparison but is no change of the skin."""

    time_s: float
    kind: str
    message: str

    def to_json(self) -> dict[str, Any]:
        """The event of `taxel twin --json`."""
        return {"time_s": self.time_s, "event": "input", "kind": self.kind, "message": self.message}

    def __str__(self) -> str:
        return f"{format_time(self.time_s)} input: {self.message}"


@dataclass(frozen=True)
class CauseEvent:
    """Probabilities of the causes after a number of contacts since the first alarm.

    probabilities: of every effect, of an unknown cause and of no gap. headline: one sentence. action: recommended.
    """

    time_s: float
    contacts: int
    probabilities: Mapping[str, float]
    effects: tuple[str, ...]
    headline: str
    action: str
    alarms: tuple[int, ...] = field(default=())

    def to_json(self) -> dict[str, Any]:
        """The event of `taxel twin --json`."""
        return {
            "time_s": self.time_s,
            "event": "cause",
            "contacts": self.contacts,
            "probabilities": {name: round(value, 6) for name, value in self.probabilities.items()},
            "effects": list(self.effects),
            "headline": self.headline,
            "action": self.action,
            "alarms": list(self.alarms),
        }

    def __str__(self) -> str:
        best = sorted(self.probabilities.items(), key=lambda item: -item[1])[:3]
        shown = ", ".join(f"{name.replace('_', ' ')} {100 * value:.0f} %" for name, value in best)
        return (
            f"{format_time(self.time_s)} cause after {self.contacts} contacts: {self.headline} {self.action} ({shown})"
        )


@dataclass(frozen=True)
class Repaired:
    """The corrections of the signals have changed. corrections: all that are active, in words."""

    time_s: float
    corrections: tuple[str, ...]

    def to_json(self) -> dict[str, Any]:
        """The event of `taxel twin --json`."""
        return {"time_s": self.time_s, "event": "repair", "corrections": list(self.corrections)}

    def __str__(self) -> str:
        return f"{format_time(self.time_s)} repair: {'; '.join(self.corrections) or 'no correction'}"


Event = Alarm | Cleared | InputFault | CauseEvent | Repaired


def format_time(time_s: float) -> str:
    """Format a time of the stream as hours, minutes and seconds."""
    tenths = round(10 * time_s)
    sign, tenths = ("-" if tenths < 0 else ""), abs(tenths)
    return f"{sign}{tenths // 36000}:{tenths // 600 % 60:02d}:{tenths // 10 % 60:02d}.{tenths % 10}"
