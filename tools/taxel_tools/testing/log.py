"""What a phase writes into while it runs: measurements are held against their limits here."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import SupportsFloat

from taxel_tools.testing.record import (
    Attachment,
    Finding,
    Limit,
    Measurement,
    Outcome,
    PhaseRecord,
    outcome_of_phase,
    outcome_of_value,
)

Report = Callable[[str, float], None]
"""Called with a phase's name and the share of it that is done, 0 to 1."""


class PhaseLog:
    """The record of one phase in the making.

    limits: of the plan, by name of measurement. report: told of progress.
    """

    def __init__(self, phase: str, limits: Mapping[str, Limit], report: Report = lambda phase, fraction: None) -> None:
        self._phase = phase
        self._limits = dict(limits)
        self._report = report
        self._measurements: dict[tuple[str, str], Measurement] = {}
        self._findings: list[Finding] = []
        self._attachments: list[Attachment] = []
        self._notes: list[str] = []

    def limit(self, name: str) -> Limit | None:
        """The limit that the plan sets on a measurement; None if none."""
        return self._limits.get(name)

    def measure(self, name: str, value: SupportsFloat | str | None, unit: str, place: str = "") -> Measurement:
        """Record a value and hold it against its limit. None: it could not be measured, which no limit allows.

        Raises ValueError if that was measured at that place already: a phase says one thing once.
        """
        if (name, place) in self._measurements:
            raise ValueError(f"{name} at '{place}' is measured twice in phase {self._phase}")
        plain = value if value is None or isinstance(value, str) else float(value)
        limit = self._limits.get(name)
        measurement = Measurement(name, plain, unit, limit, place, outcome_of_value(plain, limit))
        self._measurements[name, place] = measurement
        return measurement

    def finding(self, fault: str, place: str, text: str, severity: float) -> Finding:
        """Name a fault, where it is and what to do about it; the phase fails by it."""
        found = Finding(fault, place, text, float(severity))
        self._findings.append(found)
        return found

    def attach(self, name: str, media_type: str, data: bytes, caption: str = "") -> None:
        """Keep bytes with the phase."""
        self._attachments.append(Attachment(name, media_type, bytes(data), caption))

    def note(self, text: str) -> None:
        """A sentence for who reads the record."""
        self._notes.append(text)

    def progress(self, fraction: float) -> None:
        """How far the phase is, 0 to 1."""
        self._report(self._phase, min(max(float(fraction), 0.0), 1.0))

    def unused_limits(self) -> list[str]:
        """The limits against which nothing was held."""
        measured = {name for name, _ in self._measurements}
        return [name for name in self._limits if name not in measured]

    def close(self, title: str, automatic: bool, seconds: float, skipped: bool, problem: str) -> PhaseRecord:
        """The finished record. problem: why the phase did not run to its end, else empty."""
        measurements = list(self._measurements.values())
        if problem:
            outcome = Outcome.ERROR
        else:
            outcome = Outcome.SKIP if skipped else outcome_of_phase(measurements, self._findings)
        return PhaseRecord(
            name=self._phase,
            title=title,
            outcome=outcome,
            automatic=automatic,
            seconds=seconds,
            measurements=measurements,
            findings=list(self._findings),
            attachments=list(self._attachments),
            notes=list(self._notes),
            problem=problem,
        )
