"""What a test leaves behind: measurements with limits, named faults, attachments, phase by phase."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from enum import StrEnum

Value = float | str | None
"""Of a measurement: a number, which may be NaN or infinite; text; or None where nothing could be measured."""


class Outcome(StrEnum):
    """How a measurement, a phase or a test came out."""

    PASS = "pass"
    FAIL = "fail"
    ERROR = "error"
    SKIP = "skip"


@dataclass(frozen=True, slots=True)
class Limit:
    """What a value may be, the bounds included. None: no bound on that side.

    Raises ValueError for bounds that no value can lie between.
    """

    minimum: float | None
    maximum: float | None

    def __post_init__(self) -> None:
        low, high = self.bounds
        if not low <= high:
            raise ValueError(f"a limit from {low} to {high} holds nothing")

    @property
    def bounds(self) -> tuple[float, float]:
        """Both bounds as numbers; infinite where there is none."""
        low = -math.inf if self.minimum is None else self.minimum
        return low, math.inf if self.maximum is None else self.maximum

    def holds(self, value: Value) -> bool:
        """Whether the value lies within. What is no number never does."""
        low, high = self.bounds
        return isinstance(value, int | float) and low <= value <= high

    def severity(self, value: Value) -> float:
        """How many times beyond the bound a value is: at most 1 within, above 1 beyond.

        value / maximum above a positive maximum, minimum / value below a positive minimum; where signs differ, one of
        them is 0, or the value is no number, there is no such ratio: infinite beyond, 0 within.
        """
        if not isinstance(value, int | float) or math.isnan(value):
            return math.inf
        above = 0.0 if self.maximum is None else _times_above(value, self.maximum)
        below = 0.0 if self.minimum is None else _times_above(-value, -self.minimum)
        return max(above, below)

    def __str__(self) -> str:
        if self.minimum is None:
            return "no limit" if self.maximum is None else f"<= {self.maximum:.10g}"
        if self.maximum is None:
            return f">= {self.minimum:.10g}"
        if self.minimum == self.maximum:
            return f"= {self.minimum:.10g}"
        return f"{self.minimum:.10g} to {self.maximum:.10g}"


def _times_above(value: float, bound: float) -> float:
    # Of two negative numbers the one nearer to 0 is the higher, hence the ratio turned round.
    part, whole = (value, bound) if bound > 0 else (-bound, -value)
    if part < 0 or whole <= 0 or math.isinf(whole):
        return 0.0 if value <= bound else math.inf
    return part / whole  # of unequal floats it never rounds to 1


@dataclass(frozen=True, slots=True)
class Measurement:
    """One value at one place ("TX 3", or empty for the whole board), and the limit that it was held against."""

    name: str
    value: Value
    unit: str
    limit: Limit | None
    place: str
    outcome: Outcome


@dataclass(frozen=True, slots=True)
class Finding:
    """A named fault at a place, and what to do about it. severity: 1 is a limit just broken; higher is worse."""

    fault: str
    place: str
    text: str
    severity: float


@dataclass(frozen=True, slots=True)
class Attachment:
    """Bytes that belong to a phase: a picture, a recording, a text."""

    name: str
    media_type: str
    data: bytes
    caption: str


@dataclass(frozen=True, slots=True)
class PhaseRecord:
    """What one phase did. automatic: without an operator; problem: why it ended with an error, else empty."""

    name: str
    title: str
    outcome: Outcome
    automatic: bool
    seconds: float
    measurements: list[Measurement]
    findings: list[Finding]
    attachments: list[Attachment]
    notes: list[str]
    problem: str


@dataclass(frozen=True, slots=True)
class TestRecord:
    """A whole test of one device. device: what it says of itself, in words; started_utc: ISO 8601 with a Z."""

    __test__ = False  # pytest would else take it for a class of tests

    serial_number: str
    operator: str
    station: str
    plan_name: str
    plan_version: str
    plan_sha256: str
    device: dict[str, str]
    software_version: str
    started_utc: str
    outcome: Outcome
    phases: list[PhaseRecord]
    seconds: float

    def findings(self) -> list[Finding]:
        """All faults, the most severe first."""
        found = [finding for phase in self.phases for finding in phase.findings]
        return sorted(found, key=lambda finding: -finding.severity)


def outcome_of_value(value: Value, limit: Limit | None) -> Outcome:
    """Pass where there is no limit."""
    return Outcome.PASS if limit is None or limit.holds(value) else Outcome.FAIL


def outcome_of_phase(measurements: Iterable[Measurement], findings: Iterable[Finding]) -> Outcome:
    """Of a phase that ran to its end: it fails by one measurement or one finding."""
    failed = any(one.outcome is Outcome.FAIL for one in measurements) or any(True for _ in findings)
    return Outcome.FAIL if failed else Outcome.PASS


def outcome_of_test(phases: Iterable[PhaseRecord]) -> Outcome:
    """The worst of its phases: error, fail, pass. Skip where no phase ran: nothing was tested, so nothing passed."""
    outcomes = {phase.outcome for phase in phases}
    order = (Outcome.ERROR, Outcome.FAIL, Outcome.PASS)
    return next((outcome for outcome in order if outcome in outcomes), Outcome.SKIP)
