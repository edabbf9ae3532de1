"""Execution of a hardware test: runs the phases of a plan in order and records results and errors."""

import traceback
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from typing import Any, Final, Protocol, runtime_checkable

from taxel.errors import TaxelError
from taxel.hand.checks import suggest_name
from taxel_tools.errors import PlanError
from taxel_tools.testing.errors import FatalTestError
from taxel_tools.testing.log import PhaseLog, Report
from taxel_tools.testing.plan import Options, PhasePlan, Plan
from taxel_tools.testing.record import Outcome, PhaseRecord, TestRecord, judge_test

__all__ = [
    "DeviceUnderTest",
    "FatalTestError",
    "Phase",
    "PhaseLog",
    "Report",
    "RunConditions",
    "SupportsOptionCheck",
    "check_plan",
    "run_test",
]

STOPPED: Final = "stopped from the keyboard"


@runtime_checkable
class Phase(Protocol):
    """One part of a test. `context` is the object under test; the engine passes it on without using it."""

    @property
    def name(self) -> str:
        """Name of the phase in test plans."""

    @property
    def title(self) -> str:
        """Name of the phase in reports."""

    @property
    def is_automatic(self) -> bool:
        """Whether the phase runs without an operator."""

    @property
    def limit_names(self) -> frozenset[str]:
        """Names of the measurements of this phase for which a test plan may set a limit."""

    def find_unmet_requirement(self, context: Any, /) -> str:
        """Return why the phase cannot run, in one line; "" if it can run."""

    def run(self, context: Any, options: Options, log: PhaseLog, /) -> None:
        """Measure the object under test (`context`), and write the results to `log`.

        Reads all options first, then calls `options.refuse_unknown_keys()` before anything is done to the device.
        """


@runtime_checkable
class SupportsOptionCheck(Protocol):
    """A phase that can check its options without running, so that errors are found before the test starts."""

    def check_options(self, options: Options, /) -> None:
        """Check every option of a phase by taking it as `run` does, before the test starts. Raises `PlanError`."""


@dataclass(frozen=True, slots=True)
class DeviceUnderTest:
    """Device under test.

    `kind` selects the limits and options that the plan sets for a kind of device. `serial_number` is empty for a device
    without one. `properties`: further properties for the record, by name.
    """

    kind: str
    serial_number: str = ""
    properties: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class RunConditions:
    """Circumstances of a test run: operator, name of the station, version of the test software, clock in seconds."""

    operator: str
    station: str
    software_version: str
    now_s: Callable[[], float]


def check_plan(plan: Plan, phases: Sequence[Phase], phase_names: Collection[str] = ()) -> None:
    """Check a plan against the available phases, for all kinds and also for phases that are not enabled.

    `phase_names`: names of phases that exist but are not loaded, for suggestions. Raises `PlanError` for an unknown
    phase, an unknown limit and, if the phase supports the check (`SupportsOptionCheck`), invalid options.
    """
    by_name = {phase.name: phase for phase in phases}
    for kind in ("", *plan.kinds):
        for _, planned in plan.all_phases(kind):
            if planned.name not in by_name:
                remedy = suggest_name(planned.name, {*by_name, *phase_names})
                field_name = f"phases.{planned.name}"
                raise PlanError(plan.source, field_name, "the name of a phase", "an unknown one", remedy)
            _check_phase(plan, by_name[planned.name], planned)


def _check_phase(plan: Plan, phase: Phase, planned: PhasePlan) -> None:
    """Check that limits and options of a planned phase exist in the phase. Raises `PlanError` with the location in
    the plan.
    """
    for limit in planned.limits:
        if limit not in phase.limit_names:
            remedy = suggest_name(limit, phase.limit_names) if phase.limit_names else "this phase has no limits"
            location = planned.locations[f"limits.{limit}"]
            raise PlanError(plan.source, location, "a measurement of this phase", "an unknown one", remedy)
    if isinstance(phase, SupportsOptionCheck):
        options = plan.build_options(planned)
        phase.check_options(options)
        options.refuse_unknown_keys()


def run_test(
    plan: Plan,
    phases: Sequence[Phase],
    context: Any,
    device: DeviceUnderTest,
    conditions: RunConditions,
    report: Report = lambda phase, fraction: None,
) -> TestRecord:
    """Run the phases that the plan enables for this kind of device, in the order of the plan.

    An exception in a phase ends this phase with an error, and the next phase runs. After a `FatalTestError`, after
    Ctrl-C, and after a failure if the plan stops at failures, the remaining phases are skipped with a note.

    Args:
        plan: phases, options and limits.
        phases: all available phases; phases that the plan does not name do not run.
        context: object passed to each phase.
        device: device under test.
        conditions: operator, station, software version and clock.
        report: called with the progress.

    Raises:
        PlanError: the plan does not fit the phases; no phase has run.
        SerialNumberError: the plan does not allow this serial number; no phase has run.
    """
    check_plan(plan, phases)
    plan.check_serial_number(device.serial_number)
    started, start_s = datetime.now(UTC), conditions.now_s()
    records = _run_phases(plan, device.kind, {phase.name: phase for phase in phases}, context, conditions.now_s, report)
    return TestRecord(
        serial_number=device.serial_number,
        operator=conditions.operator,
        station=conditions.station,
        plan_name=plan.name,
        plan_version=plan.version,
        plan_sha256=plan.sha256,
        device=dict(device.properties),
        software_version=conditions.software_version,
        started_utc=started.isoformat(timespec="milliseconds").replace("+00:00", "Z"),
        outcome=judge_test(records),
        phases=records,
        seconds=conditions.now_s() - start_s,
    )


def _run_phases(
    plan: Plan, kind: str, phases: Mapping[str, Phase], context: Any, now_s: Callable[[], float], report: Report
) -> list[PhaseRecord]:
    """Run the enabled phases of a test plan in order; phases after a final failure are recorded as skipped.

    kind: kind of the device. context: object under test. now_s: clock in s.
    """
    records: list[PhaseRecord] = []
    end_reason = ""  # Reason why no further phase runs.
    for planned in plan.enabled_phases(kind):
        phase = phases[planned.name]
        log = PhaseLog(phase.name, planned.limits, report)
        if end_reason:
            log.add_note(f"not run: {end_reason}")
            records.append(log.close(phase.title, phase.is_automatic, 0.0, is_skipped=True, problem=""))
            continue
        start_s = now_s()
        is_skipped, problem, end_reason = _run_phase(phase, context, plan.build_options(planned), log)
        record = log.close(phase.title, phase.is_automatic, now_s() - start_s, is_skipped, problem)
        records.append(record)
        if plan.stop_at_failure and not end_reason and record.outcome in (Outcome.FAIL, Outcome.ERROR):
            end_reason = f"{phase.title} did not pass, and the plan stops at the first failure"
    return records


def _run_phase(phase: Phase, context: Any, options: Options, log: PhaseLog) -> tuple[bool, str, str]:
    """Run one phase of a test.

    Returns whether the phase was skipped, the error that ended it (otherwise ""), and the reason why the whole test
    ends (otherwise "").
    """
    try:
        log.report_progress(0.0)
        requirement = phase.find_unmet_requirement(context)
        if requirement:
            log.add_note(f"cannot run: {_join_lines(requirement)}")
            return True, "", ""
        phase.run(context, options, log)
        options.refuse_unknown_keys()
        for name in log.find_unused_limits():
            log.add_note(f"limit of '{name}' not checked: the phase made no measurement of this name")
        log.report_progress(1.0)
    except KeyboardInterrupt:
        return False, STOPPED, "the test was stopped"
    except FatalTestError as error:
        return False, _join_lines(str(error)), f"{phase.title} ended the test: {_join_lines(str(error))}"
    except TaxelError as error:
        return False, _join_lines(str(error)), ""
    except OSError as error:
        return False, _join_lines(f"{error.filename}: {error.strerror}" if error.filename else str(error)), ""
    except Exception as error:  # A defect of one phase must not discard the measurements of the other phases.
        log.attach("traceback.txt", "text/plain", traceback.format_exc().encode("utf-8", "replace"), "Traceback")
        return False, _join_lines(f"a defect of this phase: {type(error).__name__}: {error}; report it"), ""
    return False, "", ""


def _join_lines(text: str) -> str:
    """Join the lines of an exception's text; "no reason given" for an empty text."""
    return " ".join(text.split()) or "no reason given"
