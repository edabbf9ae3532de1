"""The score sheet as a page of Markdown."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final

from taxel.blind.asked import CLEAR

ASKED: Final = (
    ("single effect named first", "single_first", "at least 95 %", 0.95, True),
    ("false alarms on worlds without effect", "false_alarms", "at most 2 %", 0.02, False),
    ("outside or deleted from the catalogue: reported unknown", "unknown", "at least 85 %", 0.85, True),
    ("the same: confidently misnamed", "misnamed", "at most 5 %", 0.05, False),
    ("silent board or open line that was loaded, found by place", "places", "100 %", 1.0, True),
    ("same verdict over ten analysis seeds", "seeds", "at least 98 %", 0.98, True),
)  # fmt: skip
"""Figures that are shares: title, key, demand, bound, whether more is better."""

LEAST_INTERVALS: Final = 10
"""Of fewer no share lies between 90 and 99 %: they cannot tell whether as many hold as should."""


def sheet(score: Mapping[str, Any], told: str) -> str:
    """The page. told: when and by which command, a line."""
    lines = ["# Blind check: score sheet", "", told, ""]
    lines += [
        "Worlds whose causes nobody chose, diagnosed by a process that cannot see them ([how](gap-diagnosis.md)).",
        f"What is asked for is asked of worlds whose gap is at least {CLEAR:g} times the floor, unless said otherwise;",
        "intervals are Wilson's, 95 %.",
        "",
    ]
    for title, key in (("A rig of four boards", "rig4"), ("The whole hand", "full_hand")):
        part = score.get(key)
        if part:
            lines += [f"## {title}", "", *_part(part)]
    return "\n".join(lines)


def _part(part: Mapping[str, Any]) -> list[str]:
    counts = (f"{own['worlds']} {kind} ({own['clear']} clear)" for kind, own in part["counts"].items())
    hidden = (f"{kind}, {number} worlds" for kind, number in part["blindfold"].items())
    lines = [f"Worlds: {', '.join(counts)}.", f"What hid the truth from the diagnosis: {'; '.join(hidden)}.", ""]
    lines += _asked(part)
    sections = {
        "Named first, by gap over floor": _table({_bounds(row): row for row in part["single_by_ratio"]}, "gap / floor"),
        "Named first, by the emulator's form": _table(part["single_each_form"], "form"),
        "Outside the catalogue: reported unknown": _table(part["unknown_outside_each"], "form"),
        "Deleted from the catalogue: reported unknown": _table(part["unknown_withheld_each"], "effect"),
        "Parameters": _parameters(part["parameters"]["each"]),
        "Truth against what was named first": _confusion(part["confusion"]),
        "Simpler diagnosers": _simpler(part),
        "Worlds that gave no report": [f"- {text}" for text in part["errors"]],
    }
    for heading, own in sections.items():
        lines += ["", f"### {heading}", "", *own] if own else []
    return [*lines, ""]


def _asked(part: Mapping[str, Any]) -> list[str]:
    lines = ["| figure | asked | found | of | interval | |", "|---|---|---|---|---|---|"]
    for title, key, demand, bound, more in ASKED:
        own = part[key]
        held = own["share"] is not None and (own["share"] >= bound if more else own["share"] <= bound)
        lines.append(_row(title, demand, _percent(own["share"], 1), own["of"], held, _interval(own)))
    several, each = part["several_f1"], part["parameters"]["each"].values()
    f1 = several["f1"]
    found = f"{f1:.2f}" if several["worlds"] else ""
    lines.append(_row("pairs and triples, micro-F1", "at least 0.85", found, several["worlds"], f1 >= 0.85))
    error, of = part["parameters"]["asked"], sum(own["of"] for own in each if own["asked"])
    if error is not None:
        title = "parameters in counts, s, mm, deg, log_std: median relative error"
        lines.append(_row(title, "at most 10 %", _percent(error, 1), of, error <= 0.1))
    points, of = part["shrink"]["mean_points"], part["shrink"]["of"]
    if points is not None:
        title = "predicted against measured shrink, mean difference"
        lines.append(_row(title, "at most 5 points", f"{points:.1f}", of, points <= 5.0))
    cover = part["coverage"]
    held = 0.9 <= cover["share"] <= 0.99 if cover["of"] >= LEAST_INTERVALS else None
    title = "coverage of 95 % intervals"
    lines.append(_row(title, "90 to 99 %", _percent(cover["share"], 1), cover["of"], held, _interval(cover)))
    return lines + _told(part)


def _told(part: Mapping[str, Any]) -> list[str]:
    """Figures of which nothing is asked."""
    shares = {
        "single effect named first with another one deleted": part["decoy_first"],
        "outside, but acts like an effect of the catalogue: unknown, or that effect": part["lookalike"],
    }
    lines = [_row(title, "", _percent(own["share"]), own["of"], None, _interval(own)) for title, own in shares.items()]
    time = part["runtime_s"]
    if time["median"] is not None:
        found = ", ".join(f"{time[key]:.1f}" for key in ("median", "p90", "max"))
        lines.append(_row("seconds a diagnosis: median, 90 %, most", "", found, "", None))
    return lines


def _row(title: str, demand: str, found: str, of: int | str, held: bool | None, interval: str = "") -> str:
    mark = "" if not of or held is None else _mark(held)
    return f"| {title} | {demand} | {found} | {of} | {interval} | {mark} |"


def _mark(held: bool) -> str:
    return "holds" if held else "**missed**"


def _bounds(row: Mapping[str, Any]) -> str:
    return f"above {row['from']:g}" if row["to"] is None else f"{row['from']:g} to {row['to']:g}"


def _parameters(rows: Mapping[str, Mapping[str, Any]]) -> list[str]:
    heads = ["| form: parameter | unit | against | of | median relative error |", "|---|---|---|---|---|"]
    return (heads if rows else []) + [
        f"| {name} | {own['unit']} | {own['against']} | {own['of']} | {_percent(own['median_relative_error'])} |"
        for name, own in rows.items()
    ]


def _percent(share: float | None, decimals: int = 0) -> str:
    return "" if share is None else f"{100 * share:.{decimals}f} %"


def _interval(own: Mapping[str, Any]) -> str:
    return f"{100 * own['ci95'][0]:.0f} to {100 * own['ci95'][1]:.0f} %" if own["of"] else ""


def _table(rows: Mapping[str, Mapping[str, Any]], heading: str) -> list[str]:
    lines = [f"| {heading} | right | of | interval |", "|---|---|---|---|"] if rows else []
    return lines + [
        f"| {name} | {_percent(own['share'])} | {own['of']} | {_interval(own)} |" for name, own in rows.items()
    ]


def _confusion(table: Mapping[str, Mapping[str, int]]) -> list[str]:
    heads = sorted({said for row in table.values() for said in row})
    lines = [f"| truth | {' | '.join(heads)} |", "|---" * (len(heads) + 1) + "|"]
    for truth in sorted(table):
        lines.append(f"| {truth} | {' | '.join(_count(table[truth].get(said, 0)) for said in heads)} |")
    return lines


def _count(number: int) -> str:
    return str(number) if number else ""


_SIMPLER: Sequence[tuple[str, str]] = (
    ("rules", "a check list (largest disagreement first): single effects named"),
    ("effect_blind", "one that knows only that there is a gap: single effects named"),
    (
        "shuffled_says_unknown_or_no_gap",
        "the whole diagnosis with simulations of other presses: says unknown or no gap",
    ),
)


def _simpler(part: Mapping[str, Any]) -> list[str]:
    return [
        f"- {title}: {_percent(part['simpler'][key]['share'])} of {part['simpler'][key]['of']}."
        for key, title in _SIMPLER
        if part["simpler"][key]["of"]
    ]
