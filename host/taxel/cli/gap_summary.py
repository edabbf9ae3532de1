"""Summary of a gap report on a terminal."""

from collections.abc import Mapping, Sequence
from typing import Any

from rich.console import Console
from rich.table import Table


def print_summary(console: Console, report: Mapping[str, Any]) -> None:
    """Print verdict, gap, floor and shrink, and the parameters of the named effects."""
    console.print(f"\n{report['verdict']['one_line']}\n", style="bold", highlight=False, markup=False)
    table = Table(box=None, pad_edge=False)
    for heading in ("", "counts", "mm"):
        table.add_column(heading, justify="left" if not heading else "right")
    gap, after, mm = report["gap"], report["after"], report["gap"]["mm"]
    table.add_row("gap", _with_interval(gap["value"], gap["ci95"]), _with_interval(mm["value"], mm["ci95"], 2))
    table.add_row("floor", f"{gap['floor']:.1f}", "" if mm["floor"] is None else f"{mm['floor']:.2f}")
    table.add_row("held-out sessions before", f"{after['before']:.1f}", "")
    table.add_row("held-out sessions after", _with_interval(after["value"], after["ci95"]), "")
    console.print(table)
    if report["verdict"]["effects"]:
        text = f"shrink {100 * after['shrink']:.0f} %, predicted {100 * after['predicted_shrink']:.0f} %"
        if after["reducible_shrink"] is not None:
            text += f"; {100 * after['reducible_shrink']:.0f} % of the excess"
        console.print(text, highlight=False, markup=False)
    if (effect_sets := after.get("chosen_inside")) is not None:
        console.print(nested_agreement(effect_sets, report["verdict"]["effects"]), highlight=False, markup=False)
    for entry in report["effects"]:
        if entry["in_verdict"]:
            values = ", ".join(_parameter(name, one) for name, one in list(entry["parameters"].items())[:6])
            console.print(f"{entry['name']}: {values}", highlight=False, markup=False)
    for loss in report["losses"]:
        console.print(f"note: {loss}", highlight=False, markup=False)


def nested_agreement(effect_sets: Sequence[Sequence[str]], effects: Sequence[str]) -> str:
    """How often the search without one session finds the same effects as the search in all sessions.

    effect_sets: effects of each search without a session. effects: effects of the search in all sessions.
    """
    names = set(effects) - {"unknown"}
    same = sum(set(one) == names for one in effect_sets)
    return f"a search without each session finds the same effects in {same} of {len(effect_sets)}"


def _with_interval(value: float, interval: list[float] | None, digits: int = 1) -> str:
    text = f"{value:.{digits}f}"
    return text if interval is None else f"{text} ({interval[0]:.{digits}f} to {interval[1]:.{digits}f})"


def _parameter(name: str, entry: dict[str, object]) -> str:
    value, unit = entry["value"], entry["unit"]
    shown = f"{value:.3g}" if isinstance(value, float) else str(value)
    return f"{name} {shown}" + (f" {unit}" if unit not in ("1", "index", "address") else "")
