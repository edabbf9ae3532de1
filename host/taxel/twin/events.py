"""Events of a twin: alarms, causes, cleared alarms, and faults of the input."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from taxel.twin.places import Place


@dataclass(frozen=True)
class Alarm:
    """A change of a quantity at a place.

    number: 1 for the first alarm. time_s: time of the alarm. quantity: name of a quantity of
    `taxel.twin.statistics.QUANTITIES`. amplitude: size of the change in `unit`. size_counts: the same size in counts
    (`compute_size`); None for a quantity that does not change counts. onset_s, onset_ci95: estimated onset of the
    change and its 95 % interval, seconds. words: description of the quantity in messages.
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
        """Return the alarm as an event of `taxel twin --json`."""
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
        """Format the alarm as one line: time, quantity, place, amplitude, and onset with its 95 % interval."""
        size = f", {self.size_counts:+.0f} counts" if self.size_counts is not None else ""
        low, high = self.onset_ci95
        return (
            f"{format_time(self.time_s)} alarm {self.number}: {self.words} of {self.place} has changed"
            f" ({self._format_amplitude()}{size}); onset {format_time(self.onset_s)}"
            f" ({format_time(low)} to {format_time(high)})"
        )

    def _format_amplitude(self) -> str:
        """Format the amplitude with a unit for readers: percent, milliseconds, a factor of the standard deviation."""
        if self.quantity == "missing":
            return f"{100 * self.amplitude:.0f} % missing"
        if self.unit == "1":
            return f"{100 * self.amplitude:+.0f} %"
        if self.unit == "s":
            return f"{1e3 * self.amplitude:+.0f} ms"
        if self.unit == "ln":  # logarithm of a variance ratio; its half is that of the standard deviation
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
    """A fault of the input that interrupts the comparison but is no change of the skin.

    kind: "gap", "clock", "board" (a board was exchanged), "pose", "joints" or "cause".
    """

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
    """Probabilities of the causes after a number of contacts since the earliest onset of the active alarms.

    contacts: number of contacts in the diagnosis. probabilities: probability of every effect, of an unknown cause and
    of no gap. effects: effects that the diagnosis reports as the cause; empty for no gap. headline: result in one
    sentence. action: recommended action. alarms: numbers of the active alarms.
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
        """Format the diagnosis as one line: time, verdict, remedy, and the three most probable causes."""
        best = sorted(self.probabilities.items(), key=lambda item: -item[1])[:3]
        shown = ", ".join(f"{name.replace('_', ' ')} {100 * value:.0f} %" for name, value in best)
        return (
            f"{format_time(self.time_s)} cause after {self.contacts} contacts: {self.headline} {self.action} ({shown})"
        )


@dataclass(frozen=True)
class Repaired:
    """A change of the corrections of the signals. corrections: all active corrections, one sentence each."""

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
