"""The result file: what is written is read again, what is damaged is one line, what is there stays."""

from __future__ import annotations

import json
import math
import os
import pickle
import xml.etree.ElementTree as ET

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from taxel_tools.testing import whole_file
from taxel_tools.testing.errors import ResultFileError
from taxel_tools.testing.junit import junit_bytes
from taxel_tools.testing.page import page_text
from taxel_tools.testing.record import (
    Attachment,
    Finding,
    Limit,
    Measurement,
    Outcome,
    PhaseRecord,
    TestRecord,
    outcome_of_phase,
    outcome_of_test,
    outcome_of_value,
)
from taxel_tools.testing.result_file import json_bytes, parse_json, read_json, write_json

# Control characters and lone surrogates too; two that make a pair are one character, as in JSON.
TEXT = st.text(st.characters(exclude_categories=()), max_size=12).map(
    lambda text: text.encode("utf-16", "surrogatepass").decode("utf-16", "surrogatepass")
)
NUMBER = st.floats()
FINITE = st.floats(allow_nan=False, allow_infinity=False)


def key(record):
    """Equal where records are: a NaN is not equal to itself, but reads the same."""
    return repr(record)


@st.composite
def limits(draw):
    low, high = draw(st.none() | FINITE), draw(st.none() | FINITE)
    return Limit(low, high) if None in (low, high) else Limit(min(low, high), max(low, high))


@st.composite
def measurements(draw):
    value, limit = draw(NUMBER | TEXT | st.none()), draw(st.none() | limits())
    outcome = outcome_of_value(value, limit)
    return Measurement(draw(TEXT), value, draw(TEXT), limit, draw(TEXT), outcome)


@st.composite
def phases(draw):
    measured = draw(st.lists(measurements(), max_size=3, unique_by=lambda one: (one.name, one.place)))
    found = draw(st.lists(st.builds(Finding, TEXT, TEXT, TEXT, NUMBER), max_size=2))
    problem = draw(st.just("") | TEXT)
    outcome = Outcome.ERROR if problem else outcome_of_phase(measured, found)
    if not problem and not measured and not found and draw(st.booleans()):
        outcome = Outcome.SKIP
    return PhaseRecord(
        name=draw(TEXT),
        title=draw(TEXT),
        outcome=outcome,
        automatic=draw(st.booleans()),
        seconds=draw(NUMBER),
        measurements=measured,
        findings=found,
        attachments=draw(st.lists(st.builds(Attachment, TEXT, TEXT, st.binary(max_size=20), TEXT), max_size=2)),
        notes=draw(st.lists(TEXT, max_size=2)),
        problem=problem,
    )


@st.composite
def records(draw):
    some = draw(st.lists(phases(), max_size=3, unique_by=lambda one: one.name))
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
        outcome=outcome_of_test(some),
        phases=some,
        seconds=draw(NUMBER),
    )


@settings(deadline=None, max_examples=60)
@given(records())
def test_any_record_is_read_as_it_was_written(record):
    data = json_bytes(record)
    assert key(parse_json(data, "r.json")) == key(record)
    assert json_bytes(parse_json(data, "r.json")) == data
    data.decode("utf-8")


@settings(deadline=None, max_examples=60)
@given(records())
def test_any_record_has_a_page_and_a_junit_file(record):
    ET.fromstring(page_text(record).removeprefix("<!DOCTYPE html>\n"))
    ET.fromstring(junit_bytes(record))


def test_a_whole_record_survives_the_file(full_record, tmp_path):
    write_json(full_record, tmp_path / "r.json")
    assert key(read_json(tmp_path / "r.json")) == key(full_record)


def test_the_file_is_plain_json_that_other_programs_read(full_record, tmp_path):
    write_json(full_record, tmp_path / "r.json")

    def refuse(word):
        pytest.fail(f"{word} is no JSON")

    document = json.loads((tmp_path / "r.json").read_bytes(), parse_constant=refuse)
    assert document["taxel_test_record"] == 1
    assert document["operator"] == "Zoë"
    assert document["phases"][1]["measurements"][2]["value"] == {"not_finite": "nan"}
    assert document["phases"][1]["measurements"][3]["value"] is None
    assert "Zoë".encode() in (tmp_path / "r.json").read_bytes()


def test_a_badly_decoded_name_does_not_cost_the_result(record_of, tmp_path):
    write_json(record_of(operator="Zo\udceb"), tmp_path / "r.json")
    assert read_json(tmp_path / "r.json").operator == "Zo\udceb"


def test_a_file_that_is_there_is_kept_unless_told_otherwise(full_record, record_of, tmp_path):
    path = tmp_path / "r.json"
    write_json(full_record, path)
    other = record_of()
    with pytest.raises(ResultFileError, match=r"r\.json: file: expected a new file, found an existing one; choose"):
        write_json(other, path)
    assert key(read_json(path)) == key(full_record)
    write_json(other, path, overwrite=True)
    assert key(read_json(path)) == key(other)


def test_a_file_that_appears_meanwhile_is_kept(full_record, tmp_path, monkeypatch):
    path = tmp_path / "r.json"

    def sync(handle):
        path.write_text("of another station")

    monkeypatch.setattr(os, "fsync", sync)
    with pytest.raises(ResultFileError, match="found an existing one"):
        write_json(full_record, path)
    assert path.read_text() == "of another station"
    assert os.listdir(tmp_path) == ["r.json"]


def test_a_file_system_without_hard_links_will_do(full_record, tmp_path, monkeypatch):
    def link(source, target):
        raise PermissionError(1, "Operation not permitted")

    monkeypatch.setattr(os, "link", link)
    write_json(full_record, tmp_path / "r.json")
    assert os.listdir(tmp_path) == ["r.json"]
    with pytest.raises(ResultFileError, match="found an existing one"):
        write_json(full_record, tmp_path / "r.json")


class PowerCutError(Exception):
    """The program ends here, whatever it was about to do."""


@pytest.mark.parametrize("step", ["fsync", "replace"])
def test_a_power_cut_leaves_the_old_file_whole(full_record, record_of, tmp_path, monkeypatch, step):
    path, old = tmp_path / "r.json", record_of()
    write_json(old, path)

    def cut(*arguments):
        raise PowerCutError

    monkeypatch.setattr(whole_file.os, step, cut)
    with pytest.raises(PowerCutError):
        write_json(full_record, path, overwrite=True)
    assert key(read_json(path)) == key(old)


def test_the_content_is_on_the_disk_before_the_name(full_record, tmp_path, monkeypatch):
    done = []
    sync, link = os.fsync, os.link
    monkeypatch.setattr(os, "fsync", lambda handle: (done.append("fsync"), sync(handle)))
    monkeypatch.setattr(os, "link", lambda source, target: (done.append("link"), link(source, target)))
    write_json(full_record, tmp_path / "r.json")
    assert done == ["fsync", "link", "fsync"]


def test_a_place_that_cannot_be_written_is_one_line(full_record, tmp_path):
    with pytest.raises(ResultFileError, match="expected a file that can be written, found No such file or directory"):
        write_json(full_record, tmp_path / "none" / "r.json")
    with pytest.raises(ResultFileError, match="found an existing one"):
        write_json(full_record, tmp_path, overwrite=True)


def test_a_file_that_cannot_be_read_is_one_line(tmp_path):
    with pytest.raises(ResultFileError, match=r"r\.json: file: expected a result file that can be read, found No such"):
        read_json(tmp_path / "r.json")


def damaged(record, path, value):
    """The document with one place changed; `...` takes it out."""
    document = json.loads(json_bytes(record))
    place = document
    for part in path[:-1]:
        place = place[part]
    if value is ...:
        del place[path[-1]]
    else:
        place[path[-1]] = value
    return json.dumps(document).encode()


NOISE = ("phases", 1)
WHITE = (*NOISE, "measurements", 0)


@pytest.mark.parametrize(
    ("path", "value", "line"),
    [
        (("taxel_test_record",), 2, "taxel_test_record: expected 1, found 2; is it a result file of this release?"),
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
        (("outcome",), "pass", "outcome: expected error, as its values say, found 'pass'"),
        (("outcome",), "good", "outcome: expected error, as its values say, found 'good'"),
        (("seconds",), "4", "seconds: expected a finite number, found '4'"),
        (("seconds",), True, "seconds: expected a finite number, found true"),
        (("seconds",), 10**400, "seconds: expected a finite number, found an integer of 1329 bits"),
        (("phases",), {}, "phases: expected a list, found a table"),
        (NOISE, 1, "phases[1]: expected a table, found 1"),
        ((*NOISE, "name"), "identity", "phases: expected each once, found 'identity' twice"),
        ((*NOISE, "automatic"), "yes", "phases[1].automatic: expected true or false, found 'yes'"),
        ((*NOISE, "outcome"), "pass", "phases[1].outcome: expected fail, as its values say, found 'pass'"),
        (("phases", 2, "problem"), "", "phases[2].outcome: expected pass or skip, as its values say, found 'error'"),
        (("phases", 3, "notes"), [1], "phases[3].notes[0]: expected a string, found 1"),
        ((*WHITE, "value"), 3.0, "phases[1].measurements[0].outcome: expected pass, as its values say, found 'fail'"),
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
        ((*WHITE, "place"), "TX 4", "phases[1].measurements: expected each once, found \"white at 'TX 4'\" twice"),
        ((*NOISE, "findings", 0, "severity"), None, "phases[1].findings[0].severity: expected a finite number"),
        ((*NOISE, "attachments", 0, "base64"), "a", "phases[1].attachments[0].base64: expected base64, found"),
        ((*NOISE, "attachments", 0, "base64"), "YW Jj", "phases[1].attachments[0].base64: expected base64, found"),
        ((*NOISE, "attachments", 0, "base64"), "ä", "phases[1].attachments[0].base64: expected base64, found"),
        ((*NOISE, "a\nb"), 1, "phases[1].'a\\nb': expected a known key"),
    ],
)
def test_each_damage_is_one_line(full_record, path, value, line):
    with pytest.raises(ResultFileError) as caught:
        parse_json(damaged(full_record, path, value), "r.json")
    assert str(caught.value).startswith("r.json: ")
    assert line in str(caught.value)
    assert str(caught.value).isprintable()
    assert str(pickle.loads(pickle.dumps(caught.value))) == str(caught.value)


@pytest.mark.parametrize(
    ("data", "line"),
    [
        (
            b"",
            "r.json: file: expected JSON, found Expecting value in line 1, column 1; is it a result file, and whole?",
        ),
        (b"[]", "r.json: taxel_test_record: expected 1, found None"),
        (b'{"taxel_test_record": NaN}', "r.json: file: expected JSON, found NaN, which is none"),
        (
            b'{"taxel_test_record": 1, "taxel_test_record": 1}',
            "expected each key once, found 'taxel_test_record' twice",
        ),
        (b'{"taxel_test_record": 1e999}', "r.json: taxel_test_record: expected 1, found inf"),
        (b"[" * 100_000, "r.json: file: expected JSON of a few levels, found hundreds"),
        (b"9" * 10_000, "r.json: file: expected JSON, found an integer of thousands of digits"),
        (b'"\xff"', "r.json: file: expected UTF-8 text, found byte 0xFF at 1"),
    ],
)
def test_what_is_no_result_file_is_one_line(data, line):
    with pytest.raises(ResultFileError) as caught:
        parse_json(data, "r.json")
    assert line in str(caught.value)


@settings(deadline=None)
@given(cut=st.integers(0, 10_000))
def test_a_file_that_is_cut_is_never_read_as_whole(cut):
    record = TestRecord("A", "", "", "p", "1", "0" * 64, {}, "", "2026-01-31T09:30:00.000Z", Outcome.SKIP, [], 0.0)
    data = json_bytes(record).rstrip()
    if cut < len(data):
        with pytest.raises(ResultFileError):
            parse_json(data[:cut], "r.json")


def test_too_large_a_file_is_refused_before_it_is_parsed(monkeypatch):
    monkeypatch.setattr("taxel_tools.testing.result_file.LARGEST_BYTES", 10)
    with pytest.raises(ResultFileError, match="expected at most 10 bytes, found more"):
        parse_json(b" " * 11, "r.json")


def test_infinite_seconds_and_severities_survive(record_of):
    record = record_of(
        lambda log: log.finding("open TX line", "TX 3", "mend it", math.inf),
        now_s=iter([0.0, 0.0, math.inf, math.inf]).__next__,
    )
    found = parse_json(json_bytes(record), "r.json")
    assert (found.findings()[0].severity, found.phases[0].seconds, found.seconds) == (math.inf, math.inf, math.inf)
