"""Result file: a test record as JSON, for other programs."""

import base64
import binascii
import json
import os
import re
from dataclasses import asdict
from datetime import UTC, datetime
from typing import Any, Final

from taxel.hand.errors import format_path, format_value
from taxel.input_files import TextError, read_regular_file
from taxel.input_files import parse_json as parse_json_text
from taxel.input_files.json_text import JSON_BYTES_MAX
from taxel_tools.testing.errors import ResultFileError
from taxel_tools.testing.fields import Field, encode_number
from taxel_tools.testing.record import (
    Attachment,
    Finding,
    Limit,
    Measurement,
    Outcome,
    PhaseRecord,
    TestRecord,
    Value,
    judge_phase,
    judge_test,
    judge_value,
)
from taxel_tools.testing.whole_file import write_whole

VERSION: Final = 1
_TEST_KEYS = (
    "taxel_test_record", "serial_number", "operator", "station", "plan_name", "plan_version", "plan_sha256",
    "device", "software_version", "started_utc", "outcome", "phases", "seconds",
)  # fmt: skip
_PHASE_KEYS = (
    "name", "title", "outcome", "automatic", "seconds", "measurements", "findings", "attachments", "notes", "problem",
)  # fmt: skip
_MEASUREMENT_KEYS = ("name", "value", "unit", "limit", "place", "outcome")
_FINDING_KEYS = ("fault", "place", "text", "severity")
_ATTACHMENT_KEYS = ("name", "media_type", "caption", "base64")


def write_json(record: TestRecord, path: str | os.PathLike[str], overwrite: bool = False) -> None:
    """Write a test record as JSON completely or not at all. Raises `ResultFileError` if the file exists or is not
    writable.
    """
    write_whole(path, format_json_bytes(record), overwrite)


def format_json_bytes(record: TestRecord) -> bytes:
    """Format a test record as UTF-8 JSON; equal records give equal bytes."""
    document: dict[str, Any] = {"taxel_test_record": VERSION, **asdict(record)}
    document["seconds"] = encode_number(record.seconds)
    for phase in document["phases"]:
        phase["seconds"] = encode_number(phase["seconds"])
        for measurement in phase["measurements"]:
            if isinstance(measurement["value"], float):
                measurement["value"] = encode_number(measurement["value"])
        for finding in phase["findings"]:
            finding["severity"] = encode_number(finding["severity"])
        for attachment in phase["attachments"]:
            attachment["base64"] = base64.b64encode(attachment.pop("data")).decode()
    # UTF-8 cannot encode a lone surrogate (of a badly decoded name); `backslashreplace` gives its JSON escape.
    text = json.dumps(document, ensure_ascii=False, allow_nan=False, indent=1)
    return text.encode("utf-8", "backslashreplace") + b"\n"


def read_json(path: str | os.PathLike[str]) -> TestRecord:
    """Read and check a result file. Raises `ResultFileError` as one line for the first defect, never OSError."""
    top = Field(format_path(path), None)
    try:
        data = read_regular_file(path, JSON_BYTES_MAX)
    except OSError as error:
        top.fail("a readable result file", "check the file name", error.strerror or type(error).__name__)
    return parse_json(data, top.file)


def parse_json(data: bytes, source: str) -> TestRecord:
    """Parse the bytes of an untrusted result file. Raises `ResultFileError` as `read_json` does."""
    try:
        top = Field(source, parse_json_text(data, JSON_BYTES_MAX, permits_surrogates=True))
    except TextError as error:
        remedy = "is this a complete result file?"
        raise ResultFileError(source, error.position, error.expected, error.found, remedy) from None
    version = top.content.get("taxel_test_record") if isinstance(top.content, dict) else None
    if type(version) is not int or version != VERSION:
        remedy = "is this a result file of this release?"
        raise ResultFileError(source, "taxel_test_record", str(VERSION), format_value(version), remedy)
    fields = top.table(_TEST_KEYS)
    phases = [_parse_phase(item) for item in fields["phases"].items()]
    _check_unique(fields["phases"], [phase.name for phase in phases])
    return TestRecord(
        serial_number=fields["serial_number"].text(),
        operator=fields["operator"].text(),
        station=fields["station"].text(),
        plan_name=fields["plan_name"].text(),
        plan_version=fields["plan_version"].text(),
        plan_sha256=_check_sha256(fields["plan_sha256"]),
        device={key: field.text() for key, field in fields["device"].entries()},
        software_version=fields["software_version"].text(),
        started_utc=_check_time(fields["started_utc"]),
        outcome=_check_outcome(fields["outcome"], judge_test(phases)),
        phases=phases,
        seconds=fields["seconds"].number(),
    )


def _parse_phase(field: Field) -> PhaseRecord:
    """Parse one phase of a result file; its outcome must agree with its measurements and findings."""
    fields = field.table(_PHASE_KEYS)
    measurements = [_parse_measurement(item) for item in fields["measurements"].items()]
    _check_unique(
        fields["measurements"], [f"{measurement.name} at '{measurement.place}'" for measurement in measurements]
    )
    findings = [_parse_finding(item) for item in fields["findings"].items()]
    problem = fields["problem"].text()
    expected = [Outcome.ERROR if problem else judge_phase(measurements, findings)]
    if not problem and not measurements and not findings:
        expected.append(Outcome.SKIP)
    return PhaseRecord(
        name=fields["name"].text(),
        title=fields["title"].text(),
        outcome=_check_outcome(fields["outcome"], *expected),
        automatic=fields["automatic"].flag(),
        seconds=fields["seconds"].number(),
        measurements=measurements,
        findings=findings,
        attachments=[_parse_attachment(item) for item in fields["attachments"].items()],
        notes=[item.text() for item in fields["notes"].items()],
        problem=problem,
    )


def _parse_measurement(field: Field) -> Measurement:
    """Parse one measurement of a result file; its outcome must agree with value and limit."""
    fields = field.table(_MEASUREMENT_KEYS)
    value = _parse_value(fields["value"])
    limit = _parse_limit(fields["limit"])
    return Measurement(
        name=fields["name"].text(),
        value=value,
        unit=fields["unit"].text(),
        limit=limit,
        place=fields["place"].text(),
        outcome=_check_outcome(fields["outcome"], judge_value(value, limit)),
    )


def _parse_value(field: Field) -> Value:
    """Parse the measured value in a result file: a number, a text, or None."""
    if field.content is None or isinstance(field.content, str):
        return field.content
    return field.number()


def _parse_limit(field: Field) -> Limit | None:
    """Parse the limit of a measurement in a result file, or None. Fails if the minimum is above the maximum."""
    if field.content is None:
        return None
    fields = field.table(("minimum", "maximum"))
    low, high = (None if bound.content is None else bound.finite() for bound in (fields["minimum"], fields["maximum"]))
    if low is not None and high is not None and low > high:
        field.fail("a minimum at most the maximum", found=f"{low:g} and {high:g}")
    return Limit(low, high)


def _parse_finding(field: Field) -> Finding:
    """Parse a fault that the test has found, from its table in a result file."""
    fields = field.table(_FINDING_KEYS)
    fault, place, text = (fields[key].text() for key in ("fault", "place", "text"))
    return Finding(fault, place, text, fields["severity"].number())


def _parse_attachment(field: Field) -> Attachment:
    """Parse an attachment from its table in a result file, where its bytes are coded as base64."""
    fields = field.table(_ATTACHMENT_KEYS)
    name, media_type, caption = (fields[key].text() for key in ("name", "media_type", "caption"))
    try:
        data = base64.b64decode(fields["base64"].text(), validate=True)
    except (binascii.Error, ValueError) as error:
        fields["base64"].fail("base64", found=str(error))
    return Attachment(name, media_type, data, caption)


def _check_outcome(field: Field, *possible: Outcome) -> Outcome:
    """Check an outcome in a result file. possible: outcomes that follow from the measurements and findings in the
    file.

    Returns the outcome; raises ResultFileError for another one.
    """
    outcome = field.text()
    if outcome not in possible:
        field.fail(f"{' or '.join(possible)}, as its values require")
    return Outcome(outcome)


def _check_time(field: Field) -> str:
    """Check that a field is a time in UTC that ends with "Z". Returns its text."""
    text = field.text()
    try:
        zone = datetime.fromisoformat(text).tzinfo
    except ValueError:
        zone = None
    if zone is not UTC or not text.endswith("Z"):
        field.fail("a time such as 2026-01-31T09:30:00.000Z")
    return text


def _check_sha256(field: Field) -> str:
    """Check that a field has the format of a SHA-256 sum, 64 hexadecimal digits. Returns its text."""
    text = field.text()
    if not re.fullmatch(r"[0-9a-f]{64}", text):
        field.fail("64 hexadecimal digits")
    return text


def _check_unique(field: Field, names: list[str]) -> None:
    """Check that no name occurs twice; fails at `field` otherwise."""
    known_names: set[str] = set()
    for name in names:
        if name in known_names:
            field.fail("unique entries", found=f"{format_value(name)} twice")
        known_names.add(name)
