"""Result files: read back as written, damage is refused with one error line, existing files are kept."""

import json
import math
import os
import pickle
import xml.etree.ElementTree as ET

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from taxel_tools.testing.errors import ResultFileError
from taxel_tools.testing.junit import format_junit
from taxel_tools.testing.page import render_page
from taxel_tools.testing.record import (
    Attachment,
    Finding,
    Limit,
    Measurement,
    Outcome,
    PhaseRecord,
    TestRecord,
    judge_phase,
    judge_test,
    judge_value,
)
from taxel_tools.testing.result_file import format_json_bytes, parse_json, read_json, write_json

# Includes control characters and lone surrogates; a surrogate pair is one character, as in JSON.
TEXT = st.text(st.characters(exclude_categories=()), max_size=12).map(
    lambda text: text.encode("utf-16", "surrogatepass").decode("utf-16", "surrogatepass")
)
NUMBER = st.floats()
FINITE = st.floats(allow_nan=False, allow_infinity=False)


def comparison_key(record):
    """Return a string that is equal for equal records, also with NaN, which is not equal to itself."""
    return repr(record)


@st.composite
def limits(draw):
    """Sample a limit with none, one or two bounds."""
    low, high = draw(st.none() | FINITE), draw(st.none() | FINITE)
    return Limit(low, high) if None in (low, high) else Limit(min(low, high), max(low, high))


@st.composite
def measurements(draw):
    """Sample a measurement whose outcome agrees with its value and limit."""
    value, limit = draw(NUMBER | TEXT | st.none()), draw(st.none() | limits())
    outcome = judge_value(value, limit)
    return Measurement(draw(TEXT), value, draw(TEXT), limit, draw(TEXT), outcome)


@st.composite
def phases(draw):
    """Sample the record of a phase whose outcome agrees with its content."""
    phase_measurements = draw(
        st.lists(measurements(), max_size=3, unique_by=lambda measurement: (measurement.name, measurement.place))
    )
    findings = draw(st.lists(st.builds(Finding, TEXT, TEXT, TEXT, NUMBER), max_size=2))
    problem = draw(st.just("") | TEXT)
    outcome = Outcome.ERROR if problem else judge_phase(phase_measurements, findings)
    if not problem and not phase_measurements and not findings and draw(st.booleans()):
        outcome = Outcome.SKIP
    return PhaseRecord(
        name=draw(TEXT),
        title=draw(TEXT),
        outcome=outcome,
        automatic=draw(st.booleans()),
        seconds=draw(NUMBER),
        measurements=phase_measurements,
        findings=findings,
        attachments=draw(st.lists(st.builds(Attachment, TEXT, TEXT, st.binary(max_size=20), TEXT), max_size=2)),
        notes=draw(st.lists(TEXT, max_size=2)),
        problem=problem,
    )


@st.composite
def records(draw):
    """Sample a test record whose outcome agrees with its phases."""
    test_phases = draw(st.lists(phases(), max_size=3, unique_by=lambda phase: phase.name))
    return TestRecord(
        serial_number=draw(TEXT),
        operator=draw(TEXT),
        station=draw(TEXT),
        plan_name=draw(TEXT),
        plan_version=draw(TEXT),
        plan_sha256="0123456789abcdef" * 4,
        device=draw(st.dictionaries(TEXT, TEXT, max_size=3)),
        software_version=draw(TEXT),
        started_utc="2026-01-31T09:30:00.125Z",
        outcome=judge_test(test_phases),
        phases=test_phases,
        seconds=draw(NUMBER),
    )


@settings(deadline=None, max_examples=60)
@given(records())
def test_any_record_is_read_back_as_written(record):
    data = format_json_bytes(record)
    assert comparison_key(parse_json(data, "r.json")) == comparison_key(record)
    assert format_json_bytes(parse_json(data, "r.json")) == data
    data.decode("utf-8")  # raises an error unless the file is UTF-8


@settings(deadline=None, max_examples=60)
@given(records())
def test_any_record_has_a_page_and_a_junit_file(record):
    ET.fromstring(render_page(record).removeprefix("<!DOCTYPE html>\n"))
    ET.fromstring(format_junit(record))


def test_a_full_record_is_read_back_from_a_file(full_record, tmp_path):
    write_json(full_record, tmp_path / "r.json")
    assert comparison_key(read_json(tmp_path / "r.json")) == comparison_key(full_record)


def test_the_file_is_standard_json(full_record, tmp_path):
    write_json(full_record, tmp_path / "r.json")

    def refuse(constant):
        pytest.fail(f"{constant} is not valid JSON")

    document = json.loads((tmp_path / "r.json").read_bytes(), parse_constant=refuse)
    assert document["taxel_test_record"] == 1
    assert document["operator"] == "Zoë"
    assert document["phases"][1]["measurements"][2]["value"] == {"not_finite": "nan"}
    assert document["phases"][1]["measurements"][3]["value"] is None
    assert "Zoë".encode() in (tmp_path / "r.json").read_bytes()


def test_a_badly_decoded_name_is_stored(make_record, tmp_path):
    write_json(make_record(operator="Zo\udceb"), tmp_path / "r.json")
    assert read_json(tmp_path / "r.json").operator == "Zo\udceb"


def test_an_existing_file_is_overwritten_only_on_request(full_record, make_record, tmp_path):
    path = tmp_path / "r.json"
    write_json(full_record, path)
    other_record = make_record()
    with pytest.raises(ResultFileError, match=r"r\.json: file: expected a new file, found an existing one; choose"):
        write_json(other_record, path)
    assert comparison_key(read_json(path)) == comparison_key(full_record)
    write_json(other_record, path, overwrite=True)
    assert comparison_key(read_json(path)) == comparison_key(other_record)


def test_a_file_created_meanwhile_is_not_overwritten(full_record, tmp_path, monkeypatch):
    path = tmp_path / "r.json"

    def sync(handle):
        path.write_text("of another station")

    monkeypatch.setattr(os, "fsync", sync)
    with pytest.raises(ResultFileError, match="found an existing one"):
        write_json(full_record, path)
    assert path.read_text() == "of another station"
    assert os.listdir(tmp_path) == ["r.json"]


def test_a_file_system_without_hard_links_is_supported(full_record, tmp_path, monkeypatch):
    def link(source, target):
        raise PermissionError(1, "Operation not permitted")

    monkeypatch.setattr(os, "link", link)
    write_json(full_record, tmp_path / "r.json")
    assert os.listdir(tmp_path) == ["r.json"]
    with pytest.raises(ResultFileError, match="found an existing one"):
        write_json(full_record, tmp_path / "r.json")


class PowerCutError(Exception):
    """Ends the program at this point."""


@pytest.mark.parametrize("step", ["fsync", "replace"])
def test_a_power_cut_leaves_the_old_file_unchanged(full_record, make_record, tmp_path, monkeypatch, step):
    path, old = tmp_path / "r.json", make_record()
    write_json(old, path)

    def cut_power(*arguments):
        raise PowerCutError

    monkeypatch.setattr(os, step, cut_power)
    with pytest.raises(PowerCutError):
        write_json(full_record, path, overwrite=True)
    assert comparison_key(read_json(path)) == comparison_key(old)


def test_the_content_is_written_to_disk_before_the_name(full_record, tmp_path, monkeypatch):
    calls = []
    sync, link = os.fsync, os.link
    monkeypatch.setattr(os, "fsync", lambda handle: (calls.append("fsync"), sync(handle)))
    monkeypatch.setattr(os, "link", lambda source, target: (calls.append("link"), link(source, target)))
    write_json(full_record, tmp_path / "r.json")
    assert calls == ["fsync", "link", "fsync"]


def test_a_path_in_a_file_and_a_folder_as_path_are_refused_for_writing(full_record, tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(ResultFileError, match="expected a writable file, found Not a directory"):
        write_json(full_record, tmp_path / "file" / "r.json")
    with pytest.raises(ResultFileError, match="found a folder"):
        write_json(full_record, tmp_path, overwrite=True)


def test_an_unreadable_file_gives_one_error_line(tmp_path):
    with pytest.raises(ResultFileError, match=r"r\.json: file: expected a readable result file, found No such"):
        read_json(tmp_path / "r.json")


def damage_document(record, path, value):
    """Return the JSON bytes of a record with one changed entry; the value `...` removes the entry.

    path: keys and indices that lead to the entry.
    """
    document = json.loads(format_json_bytes(record))
    node = document
    for section in path[:-1]:
        node = node[section]
    if value is ...:
        del node[path[-1]]
    else:
        node[path[-1]] = value
    return json.dumps(document).encode()


NOISE = ("phases", 1)
WHITE = (*NOISE, "measurements", 0)


@pytest.mark.parametrize(
    ("path", "value", "expected_text"),
    [
        (("taxel_test_record",), 2, "taxel_test_record: expected 1, found 2; is this a result file of this release?"),
        (("taxel_test_record",), True, "taxel_test_record: expected 1, found true"),
        (("taxel_test_record",), ..., "taxel_test_record: expected 1, found None"),
        (("serial_number",), 7, "serial_number: expected a string, found 7"),
        (("serial_number",), ..., "serial_number: expected this key, found nothing"),
        (("serial",), "x", "serial: expected a known key, found an unknown one; did you mean serial_number?"),
        (("operator",), None, "operator: expected a string, found None"),
        (("device",), [], "device: expected a table, found a list"),
        (("device", "kind"), 3, "device.kind: expected a string, found 3"),
        (("plan_sha256",), "12", "plan_sha256: expected 64 hexadecimal digits, found '12'"),
        (("started_utc",), "yesterday", "started_utc: expected a time such as 2026-01-31T09:30:00.000Z"),
        (("started_utc",), "2026-01-31T09:30:00+01:00", "started_utc: expected a time such as"),
        (("started_utc",), "2026-01-31T09:30:00", "started_utc: expected a time such as"),
        (("outcome",), "pass", "outcome: expected error, as its values require, found 'pass'"),
        (("outcome",), "good", "outcome: expected error, as its values require, found 'good'"),
        (("seconds",), "4", "seconds: expected a finite number, found '4'"),
        (("seconds",), True, "seconds: expected a finite number, found true"),
        (("seconds",), 10**400, "file: expected integers of at most 64 bits, found an integer of 401 characters"),
        (("phases",), {}, "phases: expected a list, found a table"),
        (NOISE, 1, "phases[1]: expected a table, found 1"),
        ((*NOISE, "name"), "identity", "phases: expected unique entries, found 'identity' twice"),
        ((*NOISE, "automatic"), "yes", "phases[1].automatic: expected true or false, found 'yes'"),
        ((*NOISE, "outcome"), "pass", "phases[1].outcome: expected fail, as its values require, found 'pass'"),
        (
            ("phases", 2, "problem"),
            "",
            "phases[2].outcome: expected pass or skip, as its values require, found 'error'",
        ),
        (("phases", 3, "notes"), [1], "phases[3].notes[0]: expected a string, found 1"),
        (
            (*WHITE, "value"),
            3.0,
            "phases[1].measurements[0].outcome: expected pass, as its values require, found 'fail'",
        ),
        ((*WHITE, "value"), [], "phases[1].measurements[0].value: expected a finite number, found a list"),
        ((*WHITE, "value"), {"not_finite": "big"}, "measurements[0].value: expected not_finite to be one of nan, inf"),
        ((*WHITE, "value"), {"not_finite": []}, "measurements[0].value: expected not_finite to be one of nan, inf"),
        ((*WHITE, "limit"), 8, "phases[1].measurements[0].limit: expected a table, found 8"),
        ((*WHITE, "limit"), {"maximum": 8}, "measurements[0].limit.minimum: expected this key, found nothing"),
        (
            (*WHITE, "limit"),
            {"minimum": 9, "maximum": 8},
            "limit: expected a minimum at most the maximum, found 9 and 8",
        ),
        ((*WHITE, "limit", "maximum"), {"not_finite": "nan"}, "limit.maximum: expected a finite number"),
        ((*WHITE, "place"), "TX 4", "phases[1].measurements: expected unique entries, found \"white at 'TX 4'\" twice"),
        ((*NOISE, "findings", 0, "severity"), None, "phases[1].findings[0].severity: expected a finite number"),
        ((*NOISE, "attachments", 0, "base64"), "a", "phases[1].attachments[0].base64: expected base64, found"),
        ((*NOISE, "attachments", 0, "base64"), "YW Jj", "phases[1].attachments[0].base64: expected base64, found"),
        ((*NOISE, "attachments", 0, "base64"), "ä", "phases[1].attachments[0].base64: expected base64, found"),
        ((*NOISE, "a\nb"), 1, "phases[1].'a\\nb': expected a known key"),
    ],
)
def test_each_kind_of_damage_gives_one_error_line(full_record, path, value, expected_text):
    with pytest.raises(ResultFileError) as caught_error:
        parse_json(damage_document(full_record, path, value), "r.json")
    assert str(caught_error.value).startswith("r.json: ")
    assert expected_text in str(caught_error.value)
    assert str(caught_error.value).isprintable()
    assert str(pickle.loads(pickle.dumps(caught_error.value))) == str(caught_error.value)


@pytest.mark.parametrize(
    ("data", "expected_text"),
    [
        (
            b"",
            "r.json: line 1: expected valid JSON, found Expecting value in column 1; is this a complete result file?",
        ),
        (b"[]", "r.json: taxel_test_record: expected 1, found None"),
        (b'{"taxel_test_record": NaN}', "r.json: file: expected JSON, found NaN, which JSON does not have"),
        (
            b'{"taxel_test_record": 1, "taxel_test_record": 1}',
            "expected each key of an object once, found 'taxel_test_record' twice",
        ),
        (b'{"taxel_test_record": 1e999}', "r.json: file: expected numbers of at most 1.8e308, found 1e999"),
        (b"[" * 100_000, "r.json: file: expected JSON of at most 100 levels, found more"),
        (b"9" * 10_000, "r.json: file: expected integers of at most 64 bits, found an integer of 10000 characters"),
        (b'"\xff"', "r.json: line 1: expected UTF-8 text, found byte 0xFF"),
    ],
)
def test_a_file_that_is_not_a_result_file_gives_one_error_line(data, expected_text):
    with pytest.raises(ResultFileError) as caught_error:
        parse_json(data, "r.json")
    assert expected_text in str(caught_error.value)


@settings(deadline=None)
@given(size=st.integers(0, 10_000))
def test_a_truncated_file_is_always_refused(size):
    record = TestRecord("A", "", "", "p", "1", "0" * 64, {}, "", "2026-01-31T09:30:00.000Z", Outcome.SKIP, [], 0.0)
    data = format_json_bytes(record).rstrip()
    if size < len(data):
        with pytest.raises(ResultFileError):
            parse_json(data[:size], "r.json")


def test_a_file_beyond_the_size_limit_is_refused_before_parsing(monkeypatch):
    monkeypatch.setattr("taxel_tools.testing.result_file.JSON_BYTES_MAX", 10)
    with pytest.raises(ResultFileError, match="expected at most 10 bytes, found more than 10 bytes"):
        parse_json(b" " * 11, "r.json")


def test_infinite_seconds_and_severities_are_stored(make_record):
    record = make_record(
        lambda log: log.add_finding("open TX line", "TX 3", "fix it", math.inf),
        now_s=iter([0.0, 0.0, math.inf, math.inf]).__next__,
    )
    parsed = parse_json(format_json_bytes(record), "r.json")
    assert (parsed.findings()[0].severity, parsed.phases[0].seconds, parsed.seconds) == (math.inf, math.inf, math.inf)
