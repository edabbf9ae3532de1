"""What becomes of a test when its phases pass, fail, break, or the operator stops it."""

from __future__ import annotations

import math

import numpy as np
import pytest

from taxel.errors import TaxelError
from taxel_tools.errors import PlanError
from taxel_tools.testing.engine import STOPPED, FatalTestError
from taxel_tools.testing.errors import SerialNumberError
from taxel_tools.testing.record import Limit, Outcome

THREE = "[phases.first]\n[phases.second]\n[phases.third]\n"


def raising(error):
    def does(context, options, log):
        log.measure("before", 1.0, "")
        raise error

    return does


def outcomes(record):
    return [phase.outcome.value for phase in record.phases]


def test_a_passing_test_says_who_tested_what_and_when(plan_of, phase, run):
    plan = plan_of("[phases.first]\n")
    record = run(plan, [phase("first")])
    assert (record.outcome, outcomes(record)) == (Outcome.PASS, ["pass"])
    assert (record.serial_number, record.operator, record.station) == ("AB-0001", "Zoë", "bench 1")
    assert (record.plan_name, record.plan_version, record.plan_sha256) == ("boards", "1", plan.sha256)
    assert record.started_utc.endswith("Z")
    assert record.seconds == 3.0  # the clock was looked at four times
    assert record.phases[0].seconds == 1.0


def test_phases_get_context_and_options_in_the_plans_order(plan_of, phase, run):
    seen = []

    def does(context, options, log):
        seen.append((context, options.take_number("seconds", 1.0)))

    run(plan_of("[phases.b]\nseconds = 2\n[phases.a]\n"), [phase("a", does), phase("b", does), phase("c", does)])
    assert seen == [("the device", 2.0), ("the device", 1.0)]


def test_a_measurement_is_held_against_the_limit_of_its_kind(plan_of, phase, run):
    plan = plan_of("[phases.a.limits]\nx = { max = 8 }\n[kinds.tip.a.limits]\nx = { max = 10 }\n")
    a = phase("a", lambda context, options, log: log.measure("x", 9.0, "counts", "TX 1"), ("x",))
    assert run(plan, [a]).outcome is Outcome.FAIL
    record = run(plan, [a], kind="tip")
    assert record.outcome is Outcome.PASS
    assert record.phases[0].measurements[0].limit == Limit(None, 10.0)


@pytest.mark.parametrize("value", [math.nan, None, "none"])
def test_what_is_no_number_fails_a_limit_and_passes_without(plan_of, phase, run, value):
    a = phase("a", lambda context, options, log: log.measure("x", value, ""), ("x",))
    assert run(plan_of("[phases.a.limits]\nx = { max = 8 }\n"), [a]).outcome is Outcome.FAIL
    assert run(plan_of("[phases.a]\n"), [a]).outcome is Outcome.PASS


@pytest.mark.parametrize("value", [np.float32(2.5), np.int64(3), 7, True])
def test_any_number_becomes_a_float(record_of, value):
    measured = record_of(lambda log: log.measure("x", value, "")).phases[0].measurements[0].value
    assert type(measured) is float
    assert measured == value


def test_a_finding_fails_a_phase_whose_measurements_all_pass(record_of):
    record = record_of(lambda log: log.finding("open TX line", "TX 3", "lift J1.4", 4.2))
    assert record.outcome is Outcome.FAIL
    assert record.findings()[0].severity == 4.2


def test_measuring_the_same_twice_is_a_defect_that_is_told(record_of):
    def does(log):
        log.measure("white", 1.0, "", "TX 1")
        log.measure("white", 1.0, "", "TX 2")
        log.measure("white", 2.0, "", "TX 1")

    record = record_of(does)
    assert record.outcome is Outcome.ERROR
    assert "white at 'TX 1' is measured twice in phase noise" in record.phases[0].problem


def test_a_limit_that_nothing_was_held_against_is_noted(record_of):
    notes = record_of(lambda log: log.measure("white", 1.0, "")).phases[0].notes
    assert notes == ["nothing was held against the limit of 'gain': no measurement of that name was made"]


def test_an_error_in_one_phase_lets_the_others_run(plan_of, phase, run):
    phases = [phase("first", raising(TaxelError("board 0x21: no answer;\ncheck it"))), phase("second"), phase("third")]
    record = run(plan_of(THREE), phases)
    assert (record.outcome, outcomes(record)) == (Outcome.ERROR, ["error", "pass", "pass"])
    assert record.phases[0].problem == "board 0x21: no answer; check it"
    assert len(record.phases[0].measurements) == 1


def test_an_error_of_the_system_names_the_file(plan_of, phase, run):
    record = run(plan_of("[phases.a]\n"), [phase("a", raising(OSError(5, "Input/output error", "/dev/ttyUSB0")))])
    assert record.phases[0].problem == "/dev/ttyUSB0: Input/output error"


def test_a_defect_of_a_phase_is_kept_with_its_traceback(plan_of, phase, run):
    record = run(plan_of(THREE), [phase("first", raising(KeyError("gain"))), phase("second"), phase("third")])
    assert outcomes(record) == ["error", "pass", "pass"]
    assert record.phases[0].problem == "a defect of this phase: KeyError: 'gain'; report it"
    assert b"Traceback" in record.phases[0].attachments[0].data


def test_after_a_fatal_error_the_rest_is_skipped_with_a_note(plan_of, phase, run):
    phases = [phase("first"), phase("second", raising(FatalTestError("the supply is 0 V; plug it in"))), phase("third")]
    record = run(plan_of(THREE), phases)
    assert (record.outcome, outcomes(record)) == (Outcome.ERROR, ["pass", "error", "skip"])
    assert record.phases[1].problem == "the supply is 0 V; plug it in"
    assert record.phases[2].notes == ["not run: Second ended the test: the supply is 0 V; plug it in"]


def test_stopping_a_test_keeps_what_was_measured(plan_of, phase, run):
    record = run(plan_of(THREE), [phase("first"), phase("second", raising(KeyboardInterrupt())), phase("third")])
    assert (record.outcome, outcomes(record)) == (Outcome.ERROR, ["pass", "error", "skip"])
    assert record.phases[1].problem == STOPPED
    assert record.phases[1].measurements[0].value == 1.0
    assert record.phases[2].notes == ["not run: the test was stopped"]


@pytest.mark.parametrize("wrong", ["finding", "error"])
def test_a_plan_may_stop_at_the_first_phase_that_does_not_pass(plan_of, phase, run, wrong):
    def does(context, options, log):
        if wrong == "error":
            raise TaxelError("no answer")
        log.finding("open TX line", "TX 3", "mend it", 1.0)

    record = run(plan_of("stop_at_failure = true\n" + THREE), [phase("first", does), phase("second"), phase("third")])
    assert outcomes(record)[1:] == ["skip", "skip"]
    assert record.phases[1].notes == ["not run: First did not pass, and the plan stops at the first failure"]


def test_a_skipped_phase_does_not_stop_a_test(plan_of, phase, run):
    plan = plan_of("stop_at_failure = true\n" + THREE)
    record = run(plan, [phase("first", unmet="no load\ncell"), phase("second"), phase("third")])
    assert (record.outcome, outcomes(record)) == (Outcome.PASS, ["skip", "pass", "pass"])
    assert record.phases[0].notes == ["cannot run here: no load cell"]


def test_a_test_whose_phases_were_all_skipped_did_not_pass(plan_of, phase, run):
    assert run(plan_of("[phases.a]\n"), [phase("a", unmet="no board")]).outcome is Outcome.SKIP


def test_options_that_a_phase_left_are_an_error_of_that_phase(plan_of, phase, run):
    record = run(plan_of("[phases.a]\nsecond = 2\n[phases.b]\n"), [phase("a"), phase("b")])
    assert outcomes(record) == ["error", "pass"]
    assert "plan.toml: phases.a.second: expected an option of this phase" in record.phases[0].problem


def test_nothing_runs_under_a_wrong_plan_or_serial_number(plan_of, phase, run):
    ran = []
    a = phase("a", lambda context, options, log: ran.append(1))
    with pytest.raises(PlanError):
        run(plan_of("[phases.a]\n[phases.b]\n"), [a])
    with pytest.raises(SerialNumberError):
        run(plan_of('serial_pattern = "X"\n[phases.a]\n'), [a])
    assert ran == []


def test_progress_is_told_from_0_to_1(plan_of, phase, run):
    told = []

    def does(context, options, log):
        log.progress(0.5)
        log.progress(7.0)

    run(plan_of("[phases.a]\n"), [phase("a", does)], report=lambda name, share: told.append((name, share)))
    assert told == [("a", 0.0), ("a", 0.5), ("a", 1.0), ("a", 1.0)]


def test_a_phase_can_ask_for_its_limit(record_of):
    asked = []
    record_of(lambda log: asked.extend([log.limit("gain"), log.limit("other")]))
    assert asked == [Limit(5.0, 20.0), None]
