"""The result file: a test record as JSON, which other programs read without this one."""

from __future__ import annotations

import base64
import binascii
import json
import os
import re
from collections import Counter
from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Final, NoReturn

from taxel.hand.errors import format_path, format_value
from taxel_tools.testing.errors import ResultFileError
from taxel_tools.testing.fields import Field, written
from taxel_tools.testing.record import (
    Attachment,
    Finding,
    Limit,
    Measurement,
    Outcome,
    PhaseRecord,
    TestRecord,
    Value,
    outcome_of_phase,
    outcome_of_test,
    outcome_of_value,
)
from taxel_tools.testing.whole_file import write_whole

VERSION: Final = 1
LARGEST_BYTES: Final = 2**28
"""256 MiB: a test with a hundred pictures takes a tenth of it."""

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
    """Write a result file, whole or not at all. Raises `ResultFileError`: the file exists, or cannot be written."""
    write_whole(path, json_bytes(record), overwrite)


def json_bytes(record: TestRecord) -> bytes:
    """A record as UTF-8 JSON; the same record gives the same bytes."""
    plain: dict[str, Any] = {"taxel_test_record": VERSION, **asdict(record)}
    plain["seconds"] = written(record.seconds)
    for phase in plain["phases"]:
        phase["seconds"] = written(phase["seconds"])
        for measurement in phase["measurements"]:
            if isinstance(measurement["value"], float):
                measurement["value"] = written(measurement["value"])
        for finding in phase["findings"]:
            finding["severity"] = written(finding["severity"])
        for attachment in phase["attachments"]:
            attachment["base64"] = base64.b64encode(attachment.pop("data")).decode()
    # A lone surrogate (of a badly decoded name) has no UTF-8; with a backslash it is what JSON writes for it.
    text = json.dumps(plain, ensure_ascii=False, allow_nan=False, indent=1)
    return text.encode("utf-8", "backslashreplace") + b"\n"


def read_json(path: str | os.PathLike[str]) -> TestRecord:
    """Read and check a result file. Raises `ResultFileError` of one line for the first defect, OSError never."""
    top = Field(format_path(path), None)
    try:
        with Path(path).open("rb") as stream:
            data = stream.read(LARGEST_BYTES + 1)
    except OSError as error:
        top.fail("a result file that can be read", "check its name", error.strerror or type(error).__name__)
    return parse_json(data, top.file)


def parse_json(data: bytes, source: str) -> TestRecord:
    """A record from the bytes of a result file, which nobody trusts. Raises `ResultFileError` as `read_json` does."""
    top = Field(source, _parsed(data, Field(source, None)))
    version = top.content.get("taxel_test_record") if isinstance(top.content, dict) else None
    if type(version) is not int or version != VERSION:
        remedy = "is it a result file of this release?"
        raise ResultFileError(source, "taxel_test_record", str(VERSION), format_value(version), remedy)
    fields = top.table(_TEST_KEYS)
    phases = [_phase(item) for item in fields["phases"].items()]
    _check_once(fields["phases"], [phase.name for phase in phases])
    return TestRecord(
        serial_number=fields["serial_number"].text(),
        operator=fields["operator"].text(),
        station=fields["station"].text(),
        plan_name=fields["plan_name"].text(),
        plan_version=fields["plan_version"].text(),
        plan_sha256=_sha256(fields["plan_sha256"]),
        device={key: field.text() for key, field in fields["device"].entries()},
        software_version=fields["software_version"].text(),
        started_utc=_time(fields["started_utc"]),
        outcome=_outcome(fields["outcome"], outcome_of_test(phases)),
        phases=phases,
        seconds=fields["seconds"].number(),
    )


def _parsed(data: bytes, top: Field) -> object:
    def fail(expected: str, found: str) -> NoReturn:
        top.fail(expected, "is it a result file, and whole?", found)

    def refuse(word: str) -> NoReturn:
        fail("JSON", f"{word}, which is none")

    def unique(pairs: list[tuple[str, object]]) -> dict[str, object]:
        table = dict(pairs)
        if len(table) != len(pairs):
            counts = Counter(key for key, _ in pairs)
            fail("each key once", f"{format_value(counts.most_common(1)[0][0])} twice")
        return table

    if len(data) > LARGEST_BYTES:
        fail(f"at most {LARGEST_BYTES} bytes", "more")
    try:
        return json.loads(data.decode("utf-8"), parse_constant=refuse, object_pairs_hook=unique)
    except UnicodeDecodeError as error:
        fail("UTF-8 text", f"byte 0x{data[error.start]:02X} at {error.start}")
    except RecursionError:
        fail("JSON of a few levels", "hundreds")
    except json.JSONDecodeError as error:
        fail("JSON", f"{error.msg} in line {error.lineno}, column {error.colno}")
    except ResultFileError:
        raise
    except ValueError:  # Python's own refusal of an integer of thousands of digits
        fail("JSON", "an integer of thousands of digits")


def _phase(field: Field) -> PhaseRecord:
    fields = field.table(_PHASE_KEYS)
    measurements = [_measurement(item) for item in fields["measurements"].items()]
    _check_once(fields["measurements"], [f"{one.name} at '{one.place}'" for one in measurements])
    findings = [_finding(item) for item in fields["findings"].items()]
    problem = fields["problem"].text()
    expected = [Outcome.ERROR if problem else outcome_of_phase(measurements, findings)]
    if not problem and not measurements and not findings:
        expected.append(Outcome.SKIP)
    return PhaseRecord(
        name=fields["name"].text(),
        title=fields["title"].text(),
        outcome=_outcome(fields["outcome"], *expected),
        automatic=fields["automatic"].flag(),
        seconds=fields["seconds"].number(),
        measurements=measurements,
        findings=findings,
        attachments=[_attachment(item) for item in fields["attachments"].items()],
        notes=[item.text() for item in fields["notes"].items()],
        problem=problem,
    )


def _measurement(field: Field) -> Measurement:
    fields = field.table(_MEASUREMENT_KEYS)
    value = _value(fields["value"])
    limit = _limit(fields["limit"])
    return Measurement(
        name=fields["name"].text(),
        value=value,
        unit=fields["unit"].text(),
        limit=limit,
        place=fields["place"].text(),
        outcome=_outcome(fields["outcome"], outcome_of_value(value, limit)),
    )


def _value(field: Field) -> Value:
    if field.content is None or isinstance(field.content, str):
        return field.content
    return field.number()


def _limit(field: Field) -> Limit | None:
    if field.content is None:
        return None
    fields = field.table(("minimum", "maximum"))
    low, high = (None if one.content is None else one.finite() for one in (fields["minimum"], fields["maximum"]))
    if low is not None and high is not None and low > high:
        field.fail("a minimum at most the maximum", found=f"{low:g} and {high:g}")
    return Limit(low, high)


def _finding(field: Field) -> Finding:
    fields = field.table(_FINDING_KEYS)
    fault, place, text = (fields[key].text() for key in ("fault", "place", "text"))
    return Finding(fault, place, text, fields["severity"].number())


def _attachment(field: Field) -> Attachment:
    fields = field.table(_ATTACHMENT_KEYS)
    name, media_type, caption = (fields[key].text() for key in ("name", "media_type", "caption"))
    try:
        data = base64.b64decode(fields["base64"].text(), validate=True)
    except (binascii.Error, ValueError) as error:
        fields["base64"].fail("base64", found=str(error))
    return Attachment(name, media_type, data, caption)


def _outcome(field: Field, *possible: Outcome) -> Outcome:
    """What the file says, if that can be: an outcome that its own values contradict was changed by hand."""
    found = field.text()
    if found not in possible:
        field.fail(f"{' or '.join(possible)}, as its values say")
    return Outcome(found)


def _time(field: Field) -> str:
    text = field.text()
    try:
        zone = datetime.fromisoformat(text).tzinfo
    except ValueError:
        zone = None
    if zone is not UTC or not text.endswith("Z"):
        field.fail("a time such as 2026-01-31T09:30:00.000Z")
    return text


def _sha256(field: Field) -> str:
    text = field.text()
    if not re.fullmatch(r"[0-9a-f]{64}", text):
        field.fail("64 hexadecimal digits")
    return text


def _check_once(field: Field, names: list[str]) -> None:
    seen: set[str] = set()
    for name in names:
        if name in seen:
            field.fail("each once", found=f"{format_value(name)} twice")
        seen.add(name)
