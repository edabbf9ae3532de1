"""Summary of a gap report on a terminal."""

from collections.abc import Mapping, Sequence
from typing import Any

from rich.console import Console
from rich.table import Table

from taxel.gap.page.effect_cards import format_parameters
from taxel.gap.page.text import clean_text, make_readable
from taxel.gap.report.checked_report import CheckedReport

MIN_SHOWN = 0.05
"""Probability from which the summary states a cause."""


def print_summary(console: Console, report: Mapping[str, Any]) -> None:
    """Print a summary of a gap report: verdict, gap, floor, shrink, and the parameters of the named effects.

    report: content of `report.json`, as `json.load` returns it.
    """
    verdict = report["verdict"]
    _print_line(console, f"\n{verdict['headline']}", style="bold")
    _print_line(console, f"{verdict['one_line']}\n")
    _print_line(console, format_probabilities(verdict["probabilities"]))
    for reason in verdict["reasons"]:
        _print_line(console, f"reason for doubt: {clean_text(reason)}")
    console.print(_gap_table(report))
    after = report["after"]
    if report["verdict"]["effects"]:
        _print_line(console, shrink_text(after))
    for entry in report.get("resimulated", ()):
        names = ", ".join(make_readable(name) for name in entry["effects"])
        gap = f"{entry['before']:.1f} to {entry['after']:.1f} counts"
        _print_line(console, f"simulated again with {names}: gap from {gap}, shrink {100 * entry['shrink']:.0f} %")
    if (effect_sets := after.get("chosen_inside")) is not None:
        _print_line(console, format_nested_agreement(effect_sets, report["verdict"]["effects"]))
    checked = CheckedReport(report)
    for effect in checked.effects:
        if effect.flag("in_verdict"):
            parameters = format_parameters(checked, effect)
            _print_line(console, make_readable(effect.text("name")) + (f": {parameters}" if parameters else ""))
    for problem in report["inputs"]["problems"]:
        text = f"{problem['grasp']}: {problem['problem']} ({problem['handled']})"
        _print_line(console, f"faulty grasp of the simulator: {clean_text(text)}")
    for loss in report["losses"]:
        _print_line(console, f"note: {clean_text(loss)}")


def format_probabilities(probabilities: Mapping[str, float]) -> str:
    """Format the probabilities of the causes, of an unknown cause and of no gap, largest first, as one line."""
    names = sorted(probabilities, key=lambda name: -probabilities[name])
    shown = [
        f"{make_readable(name)} {100 * probabilities[name]:.0f} %" for name in names if probabilities[name] >= MIN_SHOWN
    ]
    return f"probabilities: {', '.join(shown)}"


def shrink_text(after: Mapping[str, Any]) -> str:
    """Format the relative reduction of the gap by the named effects as one line. after: the report's field "after"."""
    text = (
        f"shrink of the gap of held-out sessions: {100 * after['shrink']:.0f} %"
        f" (predicted: {100 * after['predicted_shrink']:.0f} %)"
    )
    if after["reducible_shrink"] is not None:
        text += f"; reduction of the excess above the floor: {100 * after['reducible_shrink']:.0f} %"
    return text


def format_nested_agreement(effect_sets: Sequence[Sequence[str]], effects: Sequence[str]) -> str:
    """Format a sentence that states how many leave-one-session-out searches find the effects of the full search.

    effect_sets: effects of each leave-one-session-out search. effects: effects of the verdict. "unknown" is not
    compared, because it marks a remainder without a catalogue effect and is not the result of a search.
    """
    names = set(effects) - {"unknown"}
    agreeing = sum(set(effect_set) == names for effect_set in effect_sets)
    return f"searches without one session that find the same effects: {agreeing} of {len(effect_sets)}"


def _gap_table(report: Mapping[str, Any]) -> Table:
    """Make a table of gap and floor, in counts and millimetres, from the content of a gap report."""
    table = Table(box=None, pad_edge=False)
    for heading in ("", "counts", "mm"):
        table.add_column(heading, justify="left" if not heading else "right")
    gap, after, mm = report["gap"], report["after"], report["gap"]["mm"]
    gap_mm = "" if mm["value"] is None else _with_interval(mm["value"], mm["ci95"], 2)
    table.add_row("gap", _with_interval(gap["value"], gap["ci95"]), gap_mm)
    table.add_row("floor", f"{gap['floor']:.1f}", "" if mm["floor"] is None else f"{mm['floor']:.2f}")
    table.add_row("gap of held-out sessions, before", f"{after['before']:.1f}", "")
    table.add_row("gap of held-out sessions, after", _with_interval(after["value"], after["ci95"]), "")
    return table


def _print_line(console: Console, text: str, style: str | None = None) -> None:
    """Print text without interpreting markup or highlighting numbers."""
    console.print(text, style=style, highlight=False, markup=False)


def _with_interval(value: float, interval: Sequence[float] | None, digits: int = 1) -> str:
    """Format a value with its 95 % interval in parentheses; None: no interval. digits: decimal places."""
    text = f"{value:.{digits}f}"
    return text if interval is None else f"{text} ({interval[0]:.{digits}f} to {interval[1]:.{digits}f})"
