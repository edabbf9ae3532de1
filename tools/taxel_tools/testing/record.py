"""Record of a test: measurements with limits, named faults and attachments, phase by phase."""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from enum import StrEnum

Value = float | str | None
"""Value of a measurement: a number, including NaN and infinity; text; or None if nothing could be measured."""


class Outcome(StrEnum):
    """Result of a measurement, a phase or a test."""

    PASS = "pass"
    FAIL = "fail"
    ERROR = "error"
    SKIP = "skip"


@dataclass(frozen=True, slots=True)
class Limit:
    """Range of permitted values, bounds included. None: no bound on this side.

    Raises ValueError if no value lies between the bounds.
    """

    minimum: float | None
    maximum: float | None

    def __post_init__(self) -> None:
        """Check that the lower bound is not above the upper one. Raises ValueError."""
        low, high = self.bounds
        if not low <= high:
            raise ValueError(f"expected a lower bound below the upper bound, found {low} and {high}")

    @property
    def bounds(self) -> tuple[float, float]:
        """Lower and upper bound of the permitted range; infinite if there is no bound on this side."""
        low = -math.inf if self.minimum is None else self.minimum
        return low, math.inf if self.maximum is None else self.maximum

    def contains(self, value: Value) -> bool:
        """Return whether a value lies within the permitted range, bounds included; False for text, None and NaN."""
        low, high = self.bounds
        return isinstance(value, int | float) and low <= value <= high

    def severity(self, value: Value) -> float:
        """Return the factor by which a value exceeds the limit: at most 1 within, above 1 beyond the limit.

        It is value / maximum above a positive maximum, minimum / value below a positive minimum. Without such a ratio
        (different signs, a zero) the severity is infinite beyond the limit and 0 within. It is infinite for text, None
        and NaN.
        """
        if not isinstance(value, int | float) or math.isnan(value):
            return math.inf
        above = 0.0 if self.maximum is None else _compute_ratio_above(value, self.maximum)
        below = 0.0 if self.minimum is None else _compute_ratio_above(-value, -self.minimum)
        return max(above, below)

    def __str__(self) -> str:
        """Return the text of the permitted range, such as "<= 8" or "1 to 5"."""
        if self.minimum is None:
            return "no limit" if self.maximum is None else f"<= {self.maximum:.10g}"
        if self.maximum is None:
            return f">= {self.minimum:.10g}"
        if self.minimum == self.maximum:
            return f"= {self.minimum:.10g}"
        return f"{self.minimum:.10g} to {self.maximum:.10g}"


def _compute_ratio_above(value: float, bound: float) -> float:
    """Compute the factor by which a value exceeds its upper bound, above 1 only beyond the bound.

    If the ratio has no meaning (different signs, a zero): 0 within the bound, infinite beyond.
    """
    # Of two negative numbers, the number nearer to 0 is the larger one, so the ratio is inverted.
    part, whole = (value, bound) if bound > 0 else (-bound, -value)
    if part < 0 or whole <= 0 or math.isinf(whole):
        return 0.0 if value <= bound else math.inf
    return part / whole  # The ratio of unequal floats never rounds to 1.


@dataclass(frozen=True, slots=True)
class Measurement:
    """A value at a place ("TX 3", or empty for the whole board), and the limit of the plan."""

    name: str
    value: Value
    unit: str
    limit: Limit | None
    place: str
    outcome: Outcome


@dataclass(frozen=True, slots=True)
class Finding:
    """A named fault, its place and the remedy. `severity`: 1 at the limit, larger beyond the limit."""

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
    """Result of one phase. `automatic`: without an operator; `problem`: the error that ended the phase, else empty."""

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
    """Result of a test of one device.

    `device`: properties of the device by name; `started_utc`: ISO 8601 with a Z.
    """

    __test__ = False  # Otherwise pytest collects this class as a class of tests.

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
        """Return all faults that the phases of the test have found, in order of decreasing severity."""
        findings = [finding for phase in self.phases for finding in phase.findings]
        return sorted(findings, key=lambda finding: -finding.severity)


def judge_value(value: Value, limit: Limit | None) -> Outcome:
    """Judge the outcome of a measurement: PASS within the limit or without a limit, else FAIL."""
    return Outcome.PASS if limit is None or limit.contains(value) else Outcome.FAIL


def judge_phase(measurements: Iterable[Measurement], findings: Iterable[Finding]) -> Outcome:
    """Judge the outcome of a completed phase: FAIL with at least one failed measurement or finding, else PASS."""
    has_failed = any(measurement.outcome is Outcome.FAIL for measurement in measurements) or any(True for _ in findings)
    return Outcome.FAIL if has_failed else Outcome.PASS


def judge_test(phases: Iterable[PhaseRecord]) -> Outcome:
    """Judge the outcome of a test, the worst of its phases: ERROR, FAIL, PASS; SKIP if no phase ran, because nothing
    was tested.
    """
    outcomes = {phase.outcome for phase in phases}
    order = (Outcome.ERROR, Outcome.FAIL, Outcome.PASS)
    return next((outcome for outcome in order if outcome in outcomes), Outcome.SKIP)
