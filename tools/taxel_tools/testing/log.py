"""Log of a running phase: receives measurements, findings and attachments, and checks the measurements' limits."""

from collections.abc import Callable, Mapping
from typing import SupportsFloat

from taxel_tools.testing.record import (
    Attachment,
    Finding,
    Limit,
    Measurement,
    Outcome,
    PhaseRecord,
    judge_phase,
    judge_value,
)

Report = Callable[[str, float], None]
"""Called with the name of a phase and its progress, 0 to 1."""


class PhaseLog:
    """Results of one phase while it runs.

    `limits`: limits of the plan, by name of the measurement. `report`: called with the progress.
    """

    def __init__(self, phase: str, limits: Mapping[str, Limit], report: Report = lambda phase, fraction: None) -> None:
        """Create an empty log for the measurements, findings, attachments and notes of a test phase.

        limits: permitted range of each measurement, by name. report: receives the name of the phase and its
        progress, 0 to 1.
        """
        self._phase = phase
        self._limits = dict(limits)
        self._report = report
        self._measurements: dict[tuple[str, str], Measurement] = {}
        self._findings: list[Finding] = []
        self._attachments: list[Attachment] = []
        self._notes: list[str] = []

    def get_limit(self, name: str) -> Limit | None:
        """Return the limit that the plan sets for a measurement; None without a limit."""
        return self._limits.get(name)

    def measure(self, name: str, value: SupportsFloat | str | None, unit: str, place: str = "") -> Measurement:
        """Record a measured value and check its limit. place: such as "TX 3".

        None as value: the value could not be measured, which violates every limit. Raises ValueError for a second
        measurement of the same name and place.
        """
        if (name, place) in self._measurements:
            raise ValueError(f"{name} at '{place}' is measured twice in phase {self._phase}")
        number_or_text = value if value is None or isinstance(value, str) else float(value)
        limit = self._limits.get(name)
        measurement = Measurement(name, number_or_text, unit, limit, place, judge_value(number_or_text, limit))
        self._measurements[name, place] = measurement
        return measurement

    def add_finding(self, fault: str, place: str, text: str, severity: float) -> Finding:
        """Record a named fault, its place and the remedy; the phase fails."""
        finding = Finding(fault, place, text, float(severity))
        self._findings.append(finding)
        return finding

    def attach(self, name: str, media_type: str, data: bytes, caption: str = "") -> None:
        """Store bytes, such as a picture or a recording, with the phase."""
        self._attachments.append(Attachment(name, media_type, bytes(data), caption))

    def add_note(self, text: str) -> None:
        """Add a sentence for readers of the test record."""
        self._notes.append(text)

    def report_progress(self, fraction: float) -> None:
        """Report the progress of the phase, 0 to 1."""
        self._report(self._phase, min(max(float(fraction), 0.0), 1.0))

    def find_unused_limits(self) -> list[str]:
        """Find the names of the limits without a measurement."""
        measured = {name for name, _ in self._measurements}
        return [name for name in self._limits if name not in measured]

    def close(self, title: str, is_automatic: bool, seconds: float, is_skipped: bool, problem: str) -> PhaseRecord:
        """Return the record of the finished phase, with all measurements, findings, attachments and notes.

        problem: the error that ended the phase, else empty.
        """
        measurements = list(self._measurements.values())
        if problem:
            outcome = Outcome.ERROR
        else:
            outcome = Outcome.SKIP if is_skipped else judge_phase(measurements, self._findings)
        return PhaseRecord(
            name=self._phase,
            title=title,
            outcome=outcome,
            automatic=is_automatic,
            seconds=seconds,
            measurements=measurements,
            findings=list(self._findings),
            attachments=list(self._attachments),
            notes=list(self._notes),
            problem=problem,
        )
