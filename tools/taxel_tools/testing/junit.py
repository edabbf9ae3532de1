"""A test record as JUnit XML for CI servers: one test case for each limit and each finding."""

import os
import re
import xml.etree.ElementTree as ET
from collections import Counter

from taxel_tools.testing.record import Finding, Measurement, Outcome, PhaseRecord, TestRecord
from taxel_tools.testing.whole_file import write_whole

# Characters outside section 2.2 of XML 1.0.
_NOT_XML = re.compile("[^\t\n\r\u0020-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


def write_junit(record: TestRecord, path: str | os.PathLike[str], overwrite: bool = False) -> None:
    """Write a test record as JUnit XML. Raises `ResultFileError` if the file exists or is not writable."""
    write_whole(path, format_junit(record), overwrite)


def format_junit(record: TestRecord) -> bytes:
    """Format a test record as a JUnit suite, with a case for each measurement that has a limit and for each finding.

    A phase that ended with an error, was skipped, or has no limits is an additional case, so that every phase is
    listed. Characters that XML cannot contain become U+FFFD.
    """
    cases = [case for phase in record.phases for case in _build_cases(record, phase)]
    counts = Counter(child.tag for case in cases for child in case)
    totals = {
        "name": _replace_invalid(" ".join(part for part in (record.plan_name, record.serial_number) if part)),
        "tests": str(len(cases)),
        "failures": str(counts["failure"]),
        "errors": str(counts["error"]),
        "skipped": str(counts["skipped"]),
        "time": f"{record.seconds:.3f}",
    }
    root = ET.Element("testsuites", totals)
    suite = ET.SubElement(root, "testsuite", totals)
    suite.set("timestamp", _replace_invalid(record.started_utc))
    suite.set("hostname", _replace_invalid(record.station))
    properties = ET.SubElement(suite, "properties")
    for name, value in _list_properties(record).items():
        ET.SubElement(properties, "property", name=_replace_invalid(name), value=_replace_invalid(value))
    suite.extend(cases)
    ET.indent(root)
    document: bytes = ET.tostring(root, encoding="utf-8", xml_declaration=True)
    return document + b"\n"


def _list_properties(record: TestRecord) -> dict[str, str]:
    """List the properties of the JUnit suite: labels of the test and fields of the device."""
    return {
        "serial_number": record.serial_number,
        "operator": record.operator,
        "station": record.station,
        "plan_name": record.plan_name,
        "plan_version": record.plan_version,
        "plan_sha256": record.plan_sha256,
        "software_version": record.software_version,
        "outcome": record.outcome,
        **{f"device.{key}": value for key, value in record.device.items()},
    }


def _build_cases(record: TestRecord, phase: PhaseRecord) -> list[ET.Element]:
    """Build the JUnit cases of a phase of a test: measurements with limits, findings, or the phase itself."""
    kind = f"{record.plan_name}.{phase.name}".replace(" ", "_")
    cases = [
        _build_measurement_case(kind, measurement)
        for measurement in phase.measurements
        if measurement.limit is not None
    ]
    cases += [_build_finding_case(kind, finding) for finding in phase.findings]
    if phase.outcome in (Outcome.ERROR, Outcome.SKIP) or not cases:
        phase_case = _build_case(kind, phase.title)
        if phase.outcome is Outcome.ERROR:
            _add_result(phase_case, "error", phase.problem)
        elif phase.outcome is Outcome.SKIP:
            _add_result(phase_case, "skipped", "; ".join(phase.notes))
        cases.append(phase_case)
    # The cases share the time of the phase, because readers add up the times of all cases.
    for case in cases:
        case.set("time", f"{phase.seconds / len(cases):.3f}")
    return cases


def _build_measurement_case(kind: str, measurement: Measurement) -> ET.Element:
    """Build the JUnit test case of a measurement; a failure states the value and the limit.

    kind: class name of the case.
    """
    case = _build_case(kind, f"{measurement.name} at {measurement.place}" if measurement.place else measurement.name)
    if measurement.outcome is Outcome.FAIL:
        value = "no value" if measurement.value is None else f"{measurement.value} {measurement.unit}".strip()
        _add_result(case, "failure", f"{value}, allowed {measurement.limit}")
    return case


def _build_finding_case(kind: str, finding: Finding) -> ET.Element:
    """Build the JUnit test case of a fault that was found; always a failure. kind: class name of the case."""
    case = _build_case(kind, f"{finding.fault} at {finding.place}" if finding.place else finding.fault)
    _add_result(case, "failure", finding.text or finding.fault)
    return case


def _build_case(kind: str, name: str) -> ET.Element:
    """Build the JUnit test case without a failure. kind: class name of the case."""
    return ET.Element("testcase", classname=_replace_invalid(kind), name=_replace_invalid(name))


def _add_result(case: ET.Element, tag: str, message: str) -> None:
    """Add a failure, an error or a skip to a JUnit test case. tag: XML tag of the result."""
    ET.SubElement(case, tag, message=_replace_invalid(message)).text = _replace_invalid(message)


def _replace_invalid(text: str) -> str:
    """Replace the characters of a text that XML cannot contain."""
    return _NOT_XML.sub("\N{REPLACEMENT CHARACTER}", text)
