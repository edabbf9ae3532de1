"""Execution of a test whose phases pass, fail, raise errors, or are stopped by the operator."""

import math

import numpy as np
import pytest

from taxel.errors import TaxelError
from taxel_tools.errors import PlanError
from taxel_tools.testing.engine import STOPPED, FatalTestError
from taxel_tools.testing.errors import SerialNumberError
from taxel_tools.testing.record import Limit, Outcome

THREE_PHASES = "[phases.first]\n[phases.second]\n[phases.third]\n"


def raise_in_phase(error):
    """Return the function of a phase that makes one measurement and then raises `error`."""

    def measure(context, options, log):
        log.measure("before", 1.0, "")
        raise error

    return measure


def list_outcomes(record):
    return [phase.outcome.value for phase in record.phases]


def test_a_record_contains_operator_device_plan_and_time(make_plan, phase, run):
    plan = make_plan("[phases.first]\n")
    record = run(plan, [phase("first")])
    assert (record.outcome, list_outcomes(record)) == (Outcome.PASS, ["pass"])
    assert (record.serial_number, record.operator, record.station) == ("AB-0001", "Zoë", "bench 1")
    assert (record.plan_name, record.plan_version, record.plan_sha256) == ("boards", "1", plan.sha256)
    assert record.started_utc.endswith("Z")
    assert record.seconds == 3.0  # The clock advances by 1 s at each reading and was read four times.
    assert record.phases[0].seconds == 1.0


def test_phases_run_in_plan_order_with_context_and_options(make_plan, phase, run):
    calls = []

    def measure(context, options, log):
        calls.append((context, options.take_number("seconds", 1.0)))

    run(
        make_plan("[phases.b]\nseconds = 2\n[phases.a]\n"),
        [phase("a", measure), phase("b", measure), phase("c", measure)],
    )
    assert calls == [("the device", 2.0), ("the device", 1.0)]


def test_a_measurement_is_checked_against_the_limit_of_its_kind(make_plan, phase, run):
    plan = make_plan("[phases.a.limits]\nx = { max = 8 }\n[kinds.tip.a.limits]\nx = { max = 10 }\n")
    a = phase("a", lambda context, options, log: log.measure("x", 9.0, "counts", "TX 1"), ("x",))
    assert run(plan, [a]).outcome is Outcome.FAIL
    record = run(plan, [a], kind="tip")
    assert record.outcome is Outcome.PASS
    assert record.phases[0].measurements[0].limit == Limit(None, 10.0)


@pytest.mark.parametrize("value", [math.nan, None, "none"])
def test_a_value_that_is_not_a_number_violates_every_limit(make_plan, phase, run, value):
    a = phase("a", lambda context, options, log: log.measure("x", value, ""), ("x",))
    assert run(make_plan("[phases.a.limits]\nx = { max = 8 }\n"), [a]).outcome is Outcome.FAIL
    assert run(make_plan("[phases.a]\n"), [a]).outcome is Outcome.PASS


@pytest.mark.parametrize("value", [np.float32(2.5), np.int64(3), 7, True])
def test_every_number_is_stored_as_a_float(make_record, value):
    stored = make_record(lambda log: log.measure("x", value, "")).phases[0].measurements[0].value
    assert type(stored) is float
    assert stored == value


def test_a_finding_fails_a_phase_whose_measurements_all_pass(make_record):
    record = make_record(lambda log: log.add_finding("open TX line", "TX 3", "lift J1.4", 4.2))
    assert record.outcome is Outcome.FAIL
    assert record.findings()[0].severity == 4.2


def test_a_repeated_measurement_is_reported_as_a_defect(make_record):
    def measure(log):
        log.measure("white", 1.0, "", "TX 1")
        log.measure("white", 1.0, "", "TX 2")
        log.measure("white", 2.0, "", "TX 1")

    record = make_record(measure)
    assert record.outcome is Outcome.ERROR
    assert "white at 'TX 1' is measured twice in phase noise" in record.phases[0].problem


def test_a_limit_without_a_measurement_is_noted(make_record):
    notes = make_record(lambda log: log.measure("white", 1.0, "")).phases[0].notes
    assert notes == ["limit of 'gain' not checked: the phase made no measurement of this name"]


def test_the_other_phases_run_after_an_error_in_one_phase(make_plan, phase, run):
    phases = [
        phase("first", raise_in_phase(TaxelError("board 0x21: no answer;\ncheck it"))),
        phase("second"),
        phase("third"),
    ]
    record = run(make_plan(THREE_PHASES), phases)
    assert (record.outcome, list_outcomes(record)) == (Outcome.ERROR, ["error", "pass", "pass"])
    assert record.phases[0].problem == "board 0x21: no answer; check it"
    assert len(record.phases[0].measurements) == 1  # `raise_in_phase` makes one measurement before the error


def test_an_operating_system_error_names_the_file(make_plan, phase, run):
    record = run(
        make_plan("[phases.a]\n"), [phase("a", raise_in_phase(OSError(5, "Input/output error", "/dev/ttyUSB0")))]
    )
    assert record.phases[0].problem == "/dev/ttyUSB0: Input/output error"


def test_a_defect_of_a_phase_is_recorded_with_its_traceback(make_plan, phase, run):
    record = run(
        make_plan(THREE_PHASES), [phase("first", raise_in_phase(KeyError("gain"))), phase("second"), phase("third")]
    )
    assert list_outcomes(record) == ["error", "pass", "pass"]
    assert record.phases[0].problem == "a defect of this phase: KeyError: 'gain'; report it"
    assert b"Traceback" in record.phases[0].attachments[0].data


def test_after_a_fatal_error_the_remaining_phases_are_skipped_with_a_note(make_plan, phase, run):
    phases = [
        phase("first"),
        phase("second", raise_in_phase(FatalTestError("the supply is 0 V; plug it in"))),
        phase("third"),
    ]
    record = run(make_plan(THREE_PHASES), phases)
    assert (record.outcome, list_outcomes(record)) == (Outcome.ERROR, ["pass", "error", "skip"])
    assert record.phases[1].problem == "the supply is 0 V; plug it in"
    assert record.phases[2].notes == ["not run: Second ended the test: the supply is 0 V; plug it in"]


def test_a_stopped_test_keeps_its_measurements(make_plan, phase, run):
    record = run(
        make_plan(THREE_PHASES), [phase("first"), phase("second", raise_in_phase(KeyboardInterrupt())), phase("third")]
    )
    assert (record.outcome, list_outcomes(record)) == (Outcome.ERROR, ["pass", "error", "skip"])
    assert record.phases[1].problem == STOPPED
    assert record.phases[1].measurements[0].value == 1.0
    assert record.phases[2].notes == ["not run: the test was stopped"]


@pytest.mark.parametrize("cause", ["finding", "error"])
def test_a_plan_can_stop_at_the_first_phase_that_does_not_pass(make_plan, phase, run, cause):
    def measure(context, options, log):
        if cause == "error":
            raise TaxelError("no answer")
        log.add_finding("open TX line", "TX 3", "fix it", 1.0)

    record = run(
        make_plan("stop_at_failure = true\n" + THREE_PHASES), [phase("first", measure), phase("second"), phase("third")]
    )
    assert list_outcomes(record)[1:] == ["skip", "skip"]
    assert record.phases[1].notes == ["not run: First did not pass, and the plan stops at the first failure"]


def test_a_skipped_phase_does_not_stop_a_test(make_plan, phase, run):
    plan = make_plan("stop_at_failure = true\n" + THREE_PHASES)
    record = run(plan, [phase("first", requirement="no load\ncell"), phase("second"), phase("third")])
    assert (record.outcome, list_outcomes(record)) == (Outcome.PASS, ["skip", "pass", "pass"])
    assert record.phases[0].notes == ["cannot run: no load cell"]


def test_a_test_with_only_skipped_phases_does_not_pass(make_plan, phase, run):
    assert run(make_plan("[phases.a]\n"), [phase("a", requirement="no board")]).outcome is Outcome.SKIP


def test_an_unread_option_is_an_error_of_its_phase(make_plan, phase, run):
    record = run(make_plan("[phases.a]\nsecond = 2\n[phases.b]\n"), [phase("a"), phase("b")])
    assert list_outcomes(record) == ["error", "pass"]
    assert "plan.toml: phases.a.second: expected an option of this phase" in record.phases[0].problem


def test_no_phase_runs_with_an_invalid_plan_or_serial_number(make_plan, phase, run):
    calls = []
    a = phase("a", lambda context, options, log: calls.append(1))
    with pytest.raises(PlanError):
        run(make_plan("[phases.a]\n[phases.b]\n"), [a])
    with pytest.raises(SerialNumberError):
        run(make_plan('serial_pattern = "X"\n[phases.a]\n'), [a])
    assert calls == []


def test_progress_is_reported_from_0_to_1(make_plan, phase, run):
    reports = []

    def measure(context, options, log):
        log.report_progress(0.5)
        log.report_progress(7.0)  # limited to 1.0

    run(make_plan("[phases.a]\n"), [phase("a", measure)], report=lambda name, share: reports.append((name, share)))
    assert reports == [("a", 0.0), ("a", 0.5), ("a", 1.0), ("a", 1.0)]


def test_a_phase_can_read_its_limits(make_record):
    limits = []
    make_record(lambda log: limits.extend([log.get_limit("gain"), log.get_limit("other")]))
    assert limits == [Limit(5.0, 20.0), None]
