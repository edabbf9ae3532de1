"""Test records as JUnit XML."""

import xml.etree.ElementTree as ET

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from taxel_tools.testing.errors import ResultFileError
from taxel_tools.testing.junit import format_junit, write_junit
from taxel_tools.testing.record import Outcome, PhaseRecord, TestRecord


def parse_cases(record):
    """Format a record as JUnit XML and return its test cases by (class name, name)."""
    root = ET.fromstring(format_junit(record))
    return {(case.get("classname"), case.get("name")): case for case in root.iter("testcase")}


def test_each_limit_and_each_finding_is_a_case(full_record):
    cases = parse_cases(full_record)
    assert list(cases) == [
        ("boards.identity", "Identity"),
        ("boards.noise", "white at TX 3"),
        ("boards.noise", "white at TX 4"),
        ("boards.noise", "white at TX 5"),
        ("boards.noise", "white at TX 6"),
        ("boards.noise", "noisy TX line at TX 3"),
        ("boards.noise", "open TX line at TX 5"),
        ("boards.bus", "Bus"),
        ("boards.touch", "Touch"),
    ]


def test_failures_errors_and_skips_state_their_reason(full_record):
    cases = parse_cases(full_record)
    failures = {
        name: case.find("failure").get("message")
        for (_, name), case in cases.items()
        if case.find("failure") is not None
    }
    assert failures == {
        "white at TX 3": "9.5 counts, allowed <= 8",
        "white at TX 5": "nan counts, allowed <= 8",
        "white at TX 6": "no value, allowed <= 8",
        "noisy TX line at TX 3": "lift the solder joint J1.4",
        "open TX line at TX 5": "check the trace",
    }
    assert cases["boards.bus", "Bus"].find("error").get("message") == "/dev/bus: Input/output error"
    assert cases["boards.touch", "Touch"].find("skipped").get("message") == "cannot run: no operator at the bench"


def test_the_suite_contains_counts_and_identity(full_record):
    root = ET.fromstring(format_junit(full_record))
    suite = root.find("testsuite")
    assert (root.tag, suite.get("name"), suite.get("hostname")) == ("testsuites", "boards AB-0001", "bench 1")
    assert [suite.get(key) for key in ("tests", "failures", "errors", "skipped")] == ["9", "5", "1", "1"]
    properties = {node.get("name"): node.get("value") for node in suite.find("properties")}
    assert properties["serial_number"] == "AB-0001"
    assert properties["operator"] == "Zoë"
    assert properties["device.address"] == "0x21"
    assert properties["outcome"] == "error"


def test_the_times_of_the_cases_add_up_to_the_time_of_the_phase(full_record):
    noise = [case for (kind, _), case in parse_cases(full_record).items() if kind == "boards.noise"]
    assert sum(float(case.get("time")) for case in noise) == pytest.approx(full_record.phases[1].seconds, abs=0.01)


def test_a_phase_with_an_error_keeps_its_measured_cases(make_plan, phase, run):
    def measure(context, options, log):
        log.measure("x", 1.0, "")
        raise OSError(5, "Input/output error", "/dev/bus")

    record = run(make_plan("[phases.a.limits]\nx = { max = 8 }\n"), [phase("a", measure, ("x",))])
    assert [name for _, name in parse_cases(record)] == ["x", "A"]


@settings(deadline=None)
@given(text=st.text(st.characters(exclude_categories=()), max_size=20))
def test_any_text_gives_well_formed_xml(text):
    phase = PhaseRecord(text, text, Outcome.ERROR, True, 1.0, [], [], [], [], text)
    record = TestRecord(text, text, text, text, text, text, {text: text}, text, text, Outcome.ERROR, [phase], 1.0)
    assert ET.fromstring(format_junit(record)).find("testsuite").get("errors") == "1"


def test_characters_that_xml_cannot_contain_are_replaced(make_record):
    record = make_record(lambda log: log.add_finding("open\x00line\ud800", "", "a\x1b[2Jb ✓", 1.0))
    ((_, case),) = [(key, case) for key, case in parse_cases(record).items()]
    assert case.get("name") == "open\ufffdline\ufffd"
    assert case.find("failure").text == "a\ufffd[2Jb ✓"


def test_an_existing_file_is_overwritten_only_on_request(make_record, tmp_path):
    write_junit(make_record(), tmp_path / "r.xml")
    with pytest.raises(ResultFileError, match="an existing one"):
        write_junit(make_record(), tmp_path / "r.xml")
    write_junit(make_record(), tmp_path / "r.xml", overwrite=True)
