"""Summary of a gap report on a terminal: in the order of the page, within 24 lines of 80 columns."""

import os
import textwrap
from collections.abc import Mapping, Sequence
from typing import Any, Final

from rich.console import Console

from taxel.gap.page.action import REPORT_FILE, Action, recommend_action
from taxel.gap.page.certainty_section import describe_repeated_searches, list_doubts
from taxel.gap.page.confidence import label_cause, list_shown_causes
from taxel.gap.page.effect_cards import format_parameters
from taxel.gap.page.text import clean_text, format_counts, format_probability, format_shrink, make_readable
from taxel.gap.report.checked_report import CheckedReport

WIDTH: Final = 80
MOST_LINES: Final = 24
"""Numbers of columns and lines of a terminal of the default size (VT100)."""

CAUSE_BAR, GAP_BAR = 12, 40
"""Lengths of the bars for a probability of 1, and for the largest gap, columns."""


def print_summary(console: Console, report: Mapping[str, Any], page: str = "", report_file: str = REPORT_FILE) -> None:
    """Print a summary of a gap report.

    The parts are headline, probabilities of the causes, recommended action, gap before and after, reasons for doubt,
    parameters, notes, and path of the page. report: content of `report.json`, as `json.load` returns it. page: path of
    the page, "" for none. report_file: path of the report.
    """
    checked = CheckedReport(report)
    mark = "\N{FULL BLOCK}" if "utf" in console.encoding.lower() else "#"
    shorter_path = min(report_file, os.path.relpath(report_file), key=len)
    action = recommend_action(checked, shorter_path)
    beginning = [*_format_headline(checked), *_format_confidence(checked, mark)]
    end = [*_format_parameters(checked), *_format_notes(checked), *([f"report: {page}"] if page else [])]
    for lines_of_doubt in (2, 1):  # one line for each doubt only if the sentence of the verdict has no space otherwise
        later_blocks = [
            _format_action(action),
            _format_gap(checked, mark),
            [*_format_doubts(checked, lines_of_doubt), *end],
        ]
        space = MOST_LINES - sum(map(_count_rows, [beginning, *later_blocks]))
        if space > 0:
            break
    sentence = _wrap(clean_text(checked.verdict.text("one_line")), max(space, 1))
    lines = _join_blocks([[*beginning, *sentence], *later_blocks])
    console.print(lines[0], style="bold", highlight=False, markup=False, no_wrap=True, overflow="ignore")
    for line in lines[1:]:
        console.print(line, highlight=False, markup=False, no_wrap=True, overflow="ignore", crop=False)


def _join_blocks(blocks: Sequence[Sequence[str]]) -> list[str]:
    """Return the lines of all blocks, with an empty line between two blocks as long as `MOST_LINES` permits it."""
    filled = [list(block) for block in blocks if block]
    space = MOST_LINES - sum(map(_count_rows, filled))
    lines: list[str] = []
    for number, block in enumerate(filled):
        lines += [""] * (0 < number <= space) + block  # the first `space` gaps between blocks get an empty line
    return lines


def _count_rows(lines: Sequence[str]) -> int:
    """Count the terminal rows that the lines fill; a line longer than `WIDTH`, such as a command, fills several."""
    return sum(max(1, -(-len(line) // WIDTH)) for line in lines)


def _wrap(text: str, most: int, first: str = "") -> list[str]:
    """Wrap a string to at most `most` lines; an ellipsis at the end shows that the remainder is left out.

    first: start of the first line, such as "doubt: "; further lines are indented by its length.
    """
    indent = " " * len(first)
    plain = text.replace("\N{NO-BREAK SPACE}", " ")
    return textwrap.wrap(
        plain,
        WIDTH,
        initial_indent=first,
        subsequent_indent=indent,
        max_lines=most,
        placeholder=" \N{HORIZONTAL ELLIPSIS}",
    )


def _format_headline(report: CheckedReport) -> list[str]:
    return _wrap(clean_text(report.verdict.optional_text("headline") or report.verdict.text("one_line")), 2)


def _format_confidence(report: CheckedReport, mark: str) -> list[str]:
    """Return one line with the probabilities of the causes as bars, as many as fit; empty without causes.

    mark: character of the bars.
    """
    line = ""
    for name, value in list_shown_causes(report):
        bar = mark * round(CAUSE_BAR * value)
        text = f"{label_cause(name)} {bar}{' ' * bool(bar)}{format_probability(value)}"
        line_with = f"{line}   {text}" if line else text
        if len(line_with) > WIDTH:
            break
        line = line_with
    return [line.replace("\N{NO-BREAK SPACE}", " ")] if line else []


def _format_action(action: Action) -> list[str]:
    """Return the lines of the recommended action: its steps, its command and the contact to record next."""
    steps = _wrap(" ".join(action.steps), 2)
    command = [f"  $ {action.command}"] if action.command else []
    contact = _wrap(f"{action.next_contact}.", 2, "Record next: ") if action.next_contact else []
    return [*steps, *command, *(f"  {line}"[:WIDTH] for line in action.lines), *contact]


def _format_gap(report: CheckedReport, mark: str) -> list[str]:
    """Return the lines with the gap before and after the diagnosed effects are added, and the floor, as bars.

    The line "gap after" also states the shrink (relative reduction of the gap). A report without effects has no such
    line. mark: character of the bars.
    """
    after = report.after
    has_effects = any(name != "unknown" for name in report.verdict.texts("effects"))
    rows = [("gap before" if has_effects else "gap", after.number("before"), "")]
    if has_effects:
        rows.append(("gap after", after.number("value"), f" (shrink {format_shrink(after.number('shrink'))})"))
    rows.append(("floor", after.number("floor"), ""))
    top = max(value for _, value, _ in rows) or 1.0
    lines = []
    for label, value, note in rows:
        size = "not measured" if label == "floor" and value == 0.0 else format_counts(value)
        lines.append(f"{label:<11}{mark * round(GAP_BAR * value / top):<{GAP_BAR}} {size}{note}")
    return [line.replace("\N{NO-BREAK SPACE}", " ") for line in lines]


def _format_doubts(report: CheckedReport, most: int) -> list[str]:
    """Return the lines of the first two reasons for doubt or faulty grasps, and the number of the others.

    If there are no others, the last line states how many searches without one session find the same effects. most:
    largest number of lines for each reason.
    """
    doubts = list_doubts(report)
    for problem in report.root.field("inputs").optional_list("problems"):
        grasp, fault, handled = (clean_text(problem.text(key)) for key in ("grasp", "problem", "handled"))
        doubts.append(f"Faulty grasp of the simulator: {grasp}: {fault} ({handled}).")
    lines = [line for doubt in doubts[:2] for line in _wrap(doubt, most, "doubt: ")]
    more = len(doubts) - 2
    last = [f"doubt: {more} more on the page"] if more > 0 else describe_repeated_searches(report)
    return [*lines, *last]


def _format_parameters(report: CheckedReport) -> list[str]:
    """Return up to two lines with the fitted parameters of the named effects.

    If the simulator was run again with effects, the second line states the gap without and with these effects, counts.
    """
    texts = []
    for effect in report.effects:
        if effect.flag("in_verdict") and (parameters := format_parameters(report, effect)):
            texts.append(f"{make_readable(effect.text('name'))}: {parameters}")
    lines = _wrap("; ".join(texts), 2)
    for entry in report.root.optional_list("resimulated")[:1]:
        names = ", ".join(make_readable(name) for name in entry.texts("effects"))
        change = f"{entry.number('before'):.1f} to {entry.number('after'):.1f} counts"
        lines = [*lines[:1], *_wrap(f"simulated again with {names}: {change}", 1)]
    return lines


def _format_notes(report: CheckedReport) -> list[str]:
    """Return one line with the first note on the data and the number of further notes; empty without notes."""
    notes = [clean_text(text) for text in report.root.texts("losses")]
    if not notes:
        return []
    more = f" ({len(notes) - 1} more on the page)" if len(notes) > 1 else ""
    (line,) = textwrap.wrap(f"note: {notes[0]}", WIDTH - len(more), max_lines=1, placeholder=" \N{HORIZONTAL ELLIPSIS}")
    return [f"{line}{more}"]
