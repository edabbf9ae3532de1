"""The head of the page: the verdict in one line, what was compared, and the way to the sections."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import PureWindowsPath

from taxel.gap.page.fields import Value
from taxel.gap.page.glossary import STATUSES
from taxel.gap.page.report import Report
from taxel.gap.page.tables import Section, bullets, paragraph
from taxel.gap.page.text import escaped, plural, words

AGREE = (
    "The two recordings agree as well as repeats of the same grasp do. The pictures below are those of every report; "
    "here they show how noise happens to fall, and no place in them asks for attention."
)
SMALL = (
    "What differs is hardly chance, yet less than what two good simulators of the same hand differ by. The pictures "
    "below show where it lies; no place in them asks for attention."
)


def header(report: Report, sections: Sequence[Section]) -> str:
    """The head as an element. Raises GapInputError."""
    inputs = report.root.field("inputs")
    names = [f"<b>{escaped(file_name(inputs.field(side).text('path')))}</b>" for side in ("real", "sim")]
    links = bullets((f'<a href="#{section.anchor}">{section.title}</a>' for section in sections), "links")
    note = paragraph(SMALL if report.gap.flag("significant") else AGREE, "calm") if report.no_gap else ""
    return (
        f'<header>\n<p class="eyebrow">Sim-to-real gap: {names[0]} against {names[1]}</p>\n'
        f"<h1>{escaped(report.verdict.text('one_line'))}</h1>\n"
        f"{_chips(report)}\n{note}{_counts(report)}\n"
        f'<nav aria-label="Sections">{links}</nav>\n</header>\n'
    )


def _chips(report: Report) -> str:
    effects = [words(name) for name in report.verdict.texts("effects") if name != report.status]
    chips = [f'<li class="chip status {report.status}">{STATUSES[report.status]}</li>']
    chips += [f'<li class="chip">{effect}</li>' for effect in effects]
    return f'<ul class="chips" aria-label="Verdict and causes, strongest first">{"".join(chips)}</ul>'


def _counts(report: Report) -> str:
    counts = report.root.maybe("counts")
    if counts is None or not counts.table():
        return ""
    real, sim = counts.maybe("real"), counts.maybe("sim")
    parts = [f"{_one(real, 'grasps', 'grasp')} on the hand" if real else ""]
    parts += [f"in {_one(real, 'sessions', 'session')}" if real and real.maybe("sessions") else ""]
    text = " ".join(part for part in parts if part)
    more = [f"{_one(sim, 'grasps', 'grasp')} in the simulator" if sim else ""]
    more += [f"{_one(counts, 'cells', 'approach', 'approaches')} in common" if counts.maybe("cells") else ""]
    return paragraph(", ".join(part for part in (text, *more) if part) + ".", "muted")


def _one(entry: Value, key: str, noun: str, many: str = "") -> str:
    count = entry.field(key).as_integer(0, 10**9)
    return plural(count, noun, many)


def file_name(path: str) -> str:
    """The last part of a path of any system."""
    return PureWindowsPath(path).name or path
