"""The header of the page: the verdict, the inputs and the links to the sections."""

from pathlib import PureWindowsPath
from typing import Any

from taxel.gap.page.confidence import build_confidence
from taxel.gap.page.text import clean_text, format_count
from taxel.gap.report.checked_report import CheckedReport
from taxel.gap.report.report_values import ReportValue

AGREEMENT = (
    "Hand and simulator agree within the variance between repeats of the same grasp. The following figures and "
    "pictures show noise; none of the locations needs attention."
)
SMALL_GAP = (
    "The difference between hand and simulator is hardly due to chance, but it is smaller than the difference between "
    "two good simulators of the same hand. The following figures and pictures show where it lies; none of the "
    "locations needs attention."
)


def build_header_context(report: CheckedReport) -> dict[str, Any]:
    """Return the variables of the header in the template of the page. Raises GapInputError for a missing or malformed
    field.
    """
    inputs = report.root.field("inputs")
    note = ""
    if report.is_no_gap:
        note = SMALL_GAP if report.gap.flag("significant") else AGREEMENT
    return {
        "real": clean_text(get_file_name(inputs.field("real").text("path"))),
        "sim": clean_text(get_file_name(inputs.field("sim").text("path"))),
        "kind": "Difference of two sensors" if inputs.flag("real_real") else "Sim-to-real gap",
        "confidence": build_confidence(report),
        "headline": clean_text(report.verdict.optional_text("headline") or report.verdict.text("one_line")),
        "verdict": clean_text(report.verdict.text("one_line")),
        "note": note,
        "counts": _format_sizes(report),
    }


def get_file_name(path: str) -> str:
    """Return the last component of a path of any operating system; the path itself if there is none."""
    return PureWindowsPath(path).name or path


def _format_sizes(report: CheckedReport) -> str:
    """Return the numbers of grasps, sessions and common conditions as a sentence; empty if the report has none."""
    counts = report.root.optional("counts")
    if counts is None or not counts.table():
        return ""
    real, sim = counts.optional("real"), counts.optional("sim")
    phrases = []
    if real:
        sessions = f" in {_format_field_count(real, 'sessions', 'session')}" if real.optional("sessions") else ""
        phrases.append(f"{_format_field_count(real, 'grasps', 'grasp')} on the hand{sessions}")
    if sim:
        phrases.append(f"{_format_field_count(sim, 'grasps', 'grasp')} in the simulator")
    if counts.optional("cells"):
        phrases.append(f"{_format_field_count(counts, 'cells', 'condition')} in common")
    return ", ".join(phrases) + "."


def _format_field_count(entry: ReportValue, key: str, noun: str) -> str:
    return format_count(entry.field(key).as_integer(0, 10**9), noun)
