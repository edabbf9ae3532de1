"""The input files, limitations of the data and further notes."""

from taxel.gap.page.cells import SectionData
from taxel.gap.page.text import SPACE, clean_text, format_count, format_number
from taxel.gap.report.checked_report import CheckedReport


def build_inputs_section(report: CheckedReport) -> SectionData:
    """Return the section with input files, limitations of the data and notes. Raises GapInputError for a missing or
    malformed field.
    """
    inputs = report.root.field("inputs")
    files = [
        {
            "label": label,
            "path": clean_text(inputs.field(side).text("path")),
            "sha256": clean_text(inputs.field(side).text("sha256")),
        }
        for label, side in (("Hand", "real"), ("Simulator", "sim"))
    ]
    context = {
        "files": files,
        "seed": report.root.field("seed").as_integer(-(2**255), 2**255),
        "runtime": format_runtime(report.root.optional_number("runtime_s")),
        "losses": [clean_text(text) for text in report.root.texts("losses")],
        "notes": [clean_text(text) for text in report.root.texts("notes")],
    }
    return SectionData("inputs", "Inputs", "inputs", context)


def format_runtime(seconds: float | None) -> str:
    """Return a run time as text. seconds: None if the report does not state it."""
    if seconds is None:
        return "run time not stated"
    minutes, rest = divmod(round(seconds), 60)  # rounded first: 119.7 s are 2 minutes 0 s
    text = f"{format_count(minutes, 'minute')} {rest}" if minutes else format_number(seconds)
    return f"run time {text}{SPACE}s"
