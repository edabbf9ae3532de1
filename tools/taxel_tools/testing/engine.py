"""Run a test: the phases of a plan in their order, and what becomes of the test when one of them goes wrong."""

from __future__ import annotations

import traceback
from collections.abc import Callable, Mapping, Sequence
from datetime import UTC, datetime
from typing import Any, Final, Protocol, runtime_checkable

from taxel.errors import TaxelError
from taxel.hand.checks import suggest_name
from taxel_tools.errors import PlanError
from taxel_tools.testing.errors import FatalTestError
from taxel_tools.testing.log import PhaseLog, Report
from taxel_tools.testing.plan import Options, PhasePlan, Plan
from taxel_tools.testing.record import Outcome, PhaseRecord, TestRecord, outcome_of_test

__all__ = ["ChecksOptions", "FatalTestError", "Phase", "PhaseLog", "Report", "check_plan", "run_test"]

STOPPED: Final = "stopped from the keyboard"


class Phase(Protocol):
    """One part of a test. What it works on, `context`, is the bench's own and passes through here unseen."""

    @property
    def name(self) -> str:
        """As plans call it."""

    @property
    def title(self) -> str:
        """As people call it."""

    @property
    def automatic(self) -> bool:
        """Whether it needs no operator."""

    @property
    def limit_names(self) -> frozenset[str]:
        """The measurements on which a plan may set a limit."""

    def unmet(self, context: Any) -> str:
        """Empty, or one line that says why the phase cannot run here."""

    def run(self, context: Any, options: Options, log: PhaseLog) -> None:
        """Measure. Takes its options first, and calls `options.done()` before anything is done to the device."""


@runtime_checkable
class ChecksOptions(Protocol):
    """A phase that can read its options without running, so that a mistake in them is found before the test begins."""

    def check_options(self, options: Options) -> None:
        """Take every option as `run` does. Raises `PlanError`."""


def check_plan(plan: Plan, phases: Sequence[Phase]) -> None:
    """Hold a plan against the phases that there are: for all kinds, also where a phase is not enabled.

    Raises `PlanError` for an unknown phase or limit, and, where phases check them (`ChecksOptions`), wrong options.
    """
    by_name = {phase.name: phase for phase in phases}
    for kind in ("", *plan.kinds):
        for _, planned in plan.every_phase(kind):
            place = f"phases.{planned.name}"
            if planned.name not in by_name:
                remedy = suggest_name(planned.name, by_name)
                raise PlanError(plan.source, place, "the name of a phase", "an unknown one", remedy)
            _check_phase(plan, by_name[planned.name], planned)


def _check_phase(plan: Plan, phase: Phase, planned: PhasePlan) -> None:
    for limit in planned.limits:
        if limit not in phase.limit_names:
            known = suggest_name(limit, phase.limit_names) if phase.limit_names else "this phase has no limits"
            place = planned.places[f"limits.{limit}"]
            raise PlanError(plan.source, place, "a measurement of this phase", "an unknown one", known)
    if isinstance(phase, ChecksOptions):
        options = plan.options(planned)
        phase.check_options(options)
        options.done()


def run_test(
    plan: Plan,
    kind: str,
    phases: Sequence[Phase],
    context: Any,
    *,
    serial_number: str,
    operator: str,
    station: str,
    device: Mapping[str, str],
    software_version: str,
    now_s: Callable[[], float],
    report: Report = lambda phase, fraction: None,
) -> TestRecord:
    """Run the phases that the plan has for this kind of device, in the plan's order.

    A phase that raises a `TaxelError`, or anything else, ends with an error and the others go on; after a
    `FatalTestError`, after Ctrl-C, and where the plan stops at failures, the rest is skipped with a note.

    Args:
        plan: what to run, and its limits.
        kind: of the device, for what the plan says of it alone.
        phases: all that there are; those that the plan does not name do not run.
        context: handed to each phase.
        serial_number: of the device; empty if it has none.
        operator: who tests.
        station: where.
        device: what else is known of it, in words.
        software_version: of what tests.
        now_s: the bench's clock, seconds.
        report: told of progress.

    Raises:
        PlanError: the plan does not fit the phases. Nothing has run then.
        SerialNumberError: the plan does not allow this serial number. Nothing has run then.
    """
    check_plan(plan, phases)
    plan.check_serial(serial_number)
    started, begin = datetime.now(UTC), now_s()
    records = _run_all(plan, kind, {phase.name: phase for phase in phases}, context, now_s, report)
    return TestRecord(
        serial_number=serial_number,
        operator=operator,
        station=station,
        plan_name=plan.name,
        plan_version=plan.version,
        plan_sha256=plan.sha256,
        device=dict(device),
        software_version=software_version,
        started_utc=started.isoformat(timespec="milliseconds").replace("+00:00", "Z"),
        outcome=outcome_of_test(records),
        phases=records,
        seconds=now_s() - begin,
    )


def _run_all(
    plan: Plan, kind: str, phases: Mapping[str, Phase], context: Any, now_s: Callable[[], float], report: Report
) -> list[PhaseRecord]:
    records: list[PhaseRecord] = []
    ended = ""  # why no further phase runs
    for planned in plan.for_kind(kind):
        phase = phases[planned.name]
        log = PhaseLog(phase.name, planned.limits, report)
        if ended:
            log.note(f"not run: {ended}")
            records.append(log.close(phase.title, phase.automatic, 0.0, skipped=True, problem=""))
            continue
        begin = now_s()
        skipped, problem, ended = _run_phase(phase, context, plan.options(planned), log)
        record = log.close(phase.title, phase.automatic, now_s() - begin, skipped, problem)
        records.append(record)
        if plan.stop_at_failure and not ended and record.outcome in (Outcome.FAIL, Outcome.ERROR):
            ended = f"{phase.title} did not pass, and the plan stops at the first failure"
    return records


def _run_phase(phase: Phase, context: Any, options: Options, log: PhaseLog) -> tuple[bool, str, str]:
    """Whether it was skipped, why it ended with an error, and why the test ends with it."""
    try:
        log.progress(0.0)
        unmet = phase.unmet(context)
        if unmet:
            log.note(f"cannot run here: {_one_line(unmet)}")
            return True, "", ""
        phase.run(context, options, log)
        options.done()
        for name in log.unused_limits():
            log.note(f"nothing was held against the limit of '{name}': no measurement of that name was made")
        log.progress(1.0)
    except KeyboardInterrupt:
        return False, STOPPED, "the test was stopped"
    except FatalTestError as error:
        return False, _one_line(str(error)), f"{phase.title} ended the test: {_one_line(str(error))}"
    except TaxelError as error:
        return False, _one_line(str(error)), ""
    except OSError as error:
        return False, _one_line(f"{error.filename}: {error.strerror}" if error.filename else str(error)), ""
    except Exception as error:  # a record of ten good minutes is worth more than a traceback
        log.attach("traceback.txt", "text/plain", traceback.format_exc().encode("utf-8", "replace"), "The defect")
        return False, _one_line(f"a defect of this phase: {type(error).__name__}: {error}; report it"), ""
    return False, "", ""


def _one_line(text: str) -> str:
    return " ".join(text.split()) or "no reason given"
