"""A test record as JUnit XML, which CI servers show: one test case for each limit and each finding."""

from __future__ import annotations

import os
import re
import xml.etree.ElementTree as ET
from collections import Counter

from taxel_tools.testing.record import Finding, Measurement, Outcome, PhaseRecord, TestRecord
from taxel_tools.testing.whole_file import write_whole

# All that XML 1.0 cannot hold, section 2.2.
_NOT_XML = re.compile("[^\t\n\r\u0020-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


def write_junit(record: TestRecord, path: str | os.PathLike[str], overwrite: bool = False) -> None:
    """Write the XML file. Raises `ResultFileError`: the file exists, or cannot be written."""
    write_whole(path, junit_bytes(record), overwrite)


def junit_bytes(record: TestRecord) -> bytes:
    """One test suite: a case for each measurement that has a limit and for each finding.

    A phase that ended with an error or was skipped is a case of its own, and so is one that holds nothing against a
    limit, so that none is lost. Characters that XML cannot hold become U+FFFD.
    """
    cases = [case for phase in record.phases for case in _cases(record, phase)]
    counts = Counter(child.tag for case in cases for child in case)
    totals = {
        "name": _clean(" ".join(word for word in (record.plan_name, record.serial_number) if word)),
        "tests": str(len(cases)),
        "failures": str(counts["failure"]),
        "errors": str(counts["error"]),
        "skipped": str(counts["skipped"]),
        "time": f"{record.seconds:.3f}",
    }
    root = ET.Element("testsuites", totals)
    suite = ET.SubElement(root, "testsuite", totals)
    suite.set("timestamp", _clean(record.started_utc))
    suite.set("hostname", _clean(record.station))
    properties = ET.SubElement(suite, "properties")
    for name, value in _properties(record).items():
        ET.SubElement(properties, "property", name=_clean(name), value=_clean(value))
    suite.extend(cases)
    ET.indent(root)
    document: bytes = ET.tostring(root, encoding="utf-8", xml_declaration=True)
    return document + b"\n"


def _properties(record: TestRecord) -> dict[str, str]:
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


def _cases(record: TestRecord, phase: PhaseRecord) -> list[ET.Element]:
    kind = f"{record.plan_name}.{phase.name}".replace(" ", "_")
    cases = [_measured(kind, one) for one in phase.measurements if one.limit is not None]
    cases += [_found(kind, one) for one in phase.findings]
    if phase.outcome in (Outcome.ERROR, Outcome.SKIP) or not cases:
        whole = _case(kind, phase.title)
        if phase.outcome is Outcome.ERROR:
            _add(whole, "error", phase.problem)
        elif phase.outcome is Outcome.SKIP:
            _add(whole, "skipped", "; ".join(phase.notes))
        cases.append(whole)
    # The time is the phase's, and its cases share it: readers add them up.
    for case in cases:
        case.set("time", f"{phase.seconds / len(cases):.3f}")
    return cases


def _measured(kind: str, one: Measurement) -> ET.Element:
    case = _case(kind, f"{one.name} at {one.place}" if one.place else one.name)
    if one.outcome is Outcome.FAIL:
        value = "no value" if one.value is None else f"{one.value} {one.unit}".strip()
        _add(case, "failure", f"{value}, allowed {one.limit}")
    return case


def _found(kind: str, one: Finding) -> ET.Element:
    case = _case(kind, f"{one.fault} at {one.place}" if one.place else one.fault)
    _add(case, "failure", one.text or one.fault)
    return case


def _case(kind: str, name: str) -> ET.Element:
    return ET.Element("testcase", classname=_clean(kind), name=_clean(name))


def _add(case: ET.Element, tag: str, message: str) -> None:
    ET.SubElement(case, tag, message=_clean(message)).text = _clean(message)


def _clean(text: str) -> str:
    return _NOT_XML.sub("\N{REPLACEMENT CHARACTER}", text)
