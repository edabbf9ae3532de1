"""The score sheet of a blind check as a Markdown page."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

from taxel.blind.scoring_rules import MIN_CLEAR_RATIO

LIMITS: Final = (
    ("single effect named first", "single_first", "at least 95 %", 0.95, True),
    ("false alarms in worlds without a cause", "false_alarms", "at most 2 %", 0.02, False),
    ("cause outside or removed from the catalogue: reported unknown", "unknown", "at least 85 %", 0.85, True),
    ("the same: named without an unknown cause", "misnamed", "at most 5 %", 0.05, False),
    ("loaded location of a failed board or open line reported", "places", "100 %", 1.0, True),
    ("same verdict for ten analysis seeds", "seeds", "at least 98 %", 0.98, True),
)  # fmt: skip
"""Figures that are shares: title, key, limit as text, limit, whether the limit is a lower one."""

MIN_INTERVALS: Final = 10
"""Smallest number of intervals for a judgement of their coverage: of fewer, no share lies between 90 and 99 %."""


_KINDS: Final = {
    "none": "no cause",
    "single": "one cause",
    "several": "two or three causes",
    "outside": "a cause outside the catalogue",
    "lookalike": "a cause that resembles an effect of the catalogue",
}
"""Description of each kind of world."""


@dataclass(frozen=True)
class Provenance:
    """Origin of the score of a blind check.

    worlds, full_hand: options of the command. added: number of results of further runs. reports: number of worlds with
    a report. versions: versions of the diagnosis.
    """

    worlds: int
    full_hand: int
    added: int
    reports: int
    versions: Sequence[str]

    def text(self) -> str:
        """Return the paragraph of the score sheet that states the command, the reports and the diagnosis version."""
        full_hand = f" --full-hand-worlds {self.full_hand}" if self.full_hand else ""
        added = f", with {self.added} worlds of --add-answers" if self.added else ""
        versions = " and ".join(sorted(self.versions)) or "none"
        return (
            "This page states how often the diagnosis finds hidden causes that it has not seen before. It was written "
            f"by `taxel gap blind --worlds {self.worlds}{full_hand}`{added}; {self.reports} worlds gave a report. "
            f"Measured version of the diagnosis: {versions} (fingerprint of the Python sources of `taxel.gap`, with "
            "their comments)."
        )


def score_sheet(score: Mapping[str, Any], provenance: str) -> str:
    """Format the score sheet of a blind check as a Markdown page.

    provenance: a paragraph with the command and the version of the diagnosis.
    """
    lines = ["# Blind check: score sheet", "", provenance, ""]
    lines += [
        "Each world of the check is a pair of datasets with hidden causes that were sampled at random, without access",
        "of the [diagnosis](glossary.md#diagnosis) ([method](gap-diagnosis.md#the-blind-check)). Unless stated",
        "otherwise, the figures refer to clear worlds: worlds in which the [gap](glossary.md#gap) is at least",
        f"{MIN_CLEAR_RATIO:g} times the [floor](glossary.md#floor). Intervals are 95 % Wilson intervals.",
        "",
    ]
    for title, key in (("A rig of four boards", "rig4"), ("The whole hand", "full_hand")):
        part = score.get(key)
        if part:
            lines += [f"## {title}", "", *_format_part(part)]
    return "\n".join(lines)


def _format_part(part: Mapping[str, Any]) -> list[str]:
    """Format the lines of the score sheet for one group of worlds. part: figures of the rig or of the whole hand."""
    counts = (f"{_KINDS[kind]} in {count['worlds']} ({count['clear']} clear)" for kind, count in part["counts"].items())
    isolation = (f"{mechanism}, {number} worlds" for mechanism, number in part["blindfold"].items())
    lines = [
        f"Number of worlds by their hidden causes: {', '.join(counts)}.",
        f"A world is clear if its gap is at least {MIN_CLEAR_RATIO:g} times its floor.",
        f"The diagnosing process was isolated from the hidden causes by: {'; '.join(isolation)}.",
        "",
    ]
    lines += _main_table(part)
    sections = {
        "Named first, by gap over floor": _share_table(
            {_bounds(row): row for row in part["single_by_ratio"]}, "gap / floor"
        ),
        "Named first, by emulator effect": _share_table(part["single_each_form"], "emulator effect"),
        "Cause outside the catalogue: reported unknown": _share_table(part["unknown_outside_each"], "emulator effect"),
        "Effect removed from the catalogue: reported unknown": _share_table(part["unknown_withheld_each"], "effect"),
        "Parameters": _parameter_table(part["parameters"]["each"]),
        "Truth (rows) and effect named first (columns)": _confusion_table(part["confusion"]),
        "Simple reference diagnosers": _baseline_list(part),
        "Worlds without a report": [f"- {text}" for text in part["errors"]],
    }
    for heading, content in sections.items():
        lines += ["", f"### {heading}", "", *content] if content else []
    return [*lines, ""]


def _main_table(part: Mapping[str, Any]) -> list[str]:
    """Format the main table of the score sheet: all figures with a limit, then the figures without a limit."""
    lines = ["| figure | limit | measured | of | interval | |", "|---|---|---|---|---|---|"]
    for title, key, limit_text, limit, is_lower in LIMITS:
        figure = part[key]
        is_met = figure["share"] is not None and (figure["share"] >= limit if is_lower else figure["share"] <= limit)
        lines.append(_row(title, limit_text, _percent(figure["share"], 1), figure["of"], is_met, _interval(figure)))
    several, parameters = part["several_f1"], part["parameters"]["each"].values()
    f1 = several["f1"]
    measured = f"{f1:.2f}" if several["worlds"] else ""
    lines.append(_row("two or three causes, micro-F1", "at least 0.85", measured, several["worlds"], f1 >= 0.85))
    error, of = part["parameters"]["asked"], sum(row["of"] for row in parameters if row["asked"])
    if error is not None:
        title = "parameters in counts, s, mm, deg, log_std: median relative error"
        lines.append(_row(title, "at most 10 %", _percent(error, 1), of, error <= 0.1))
    points, of = part["shrink"]["mean_points"], part["shrink"]["of"]
    if points is not None:
        title = "predicted and measured shrink, mean absolute difference"
        lines.append(_row(title, "at most 5 points", f"{points:.1f}", of, points <= 5.0))
    coverage = part["coverage"]
    is_covered = 0.9 <= coverage["share"] <= 0.99 if coverage["of"] >= MIN_INTERVALS else None
    row = _percent(coverage["share"], 1), coverage["of"], is_covered, _interval(coverage)
    lines.append(_row("coverage of 95 % intervals", "90 to 99 %", *row))
    return lines + _rows_without_limit(part)


def _rows_without_limit(part: Mapping[str, Any]) -> list[str]:
    """Format the table rows of the score's figures that have no limit. part: figures of one group of worlds."""
    shares = {
        "single effect named first with another one removed": part["decoy_first"],
        "lookalike of an effect: reported unknown or as this effect": part["lookalike"],
    }
    lines = [
        _row(title, "", _percent(figure["share"]), figure["of"], None, _interval(figure))
        for title, figure in shares.items()
    ]
    time = part["runtime_s"]
    if time["median"] is not None:
        measured = ", ".join(f"{time[key]:.1f}" for key in ("median", "p90", "max"))
        lines.append(_row("seconds per diagnosis: median, 90 % quantile, maximum", "", measured, "", None))
    return lines


def _row(title: str, limit: str, measured: str, of: int | str, is_met: bool | None, interval: str = "") -> str:
    """Format one row of the main Markdown table.

    of: number of cases. is_met: whether the limit is met; None: no limit.
    """
    mark = "" if not of or is_met is None else _mark(is_met)
    return f"| {title} | {limit} | {measured} | {of} | {interval} | {mark} |"


def _mark(is_met: bool) -> str:
    """Return the text of the score sheet for a limit that is met or missed."""
    return "met" if is_met else "**missed**"


def _bounds(row: Mapping[str, Any]) -> str:
    """Format a range of the ratio of gap to floor as text, such as "2 to 4" or "above 8"."""
    return f"above {row['from']:g}" if row["to"] is None else f"{row['from']:g} to {row['to']:g}"


def _parameter_table(rows: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """Format a Markdown table of the relative errors of parameters; no lines without rows."""
    head = [
        "| emulator effect: parameter | unit | compared with | of | median relative error |",
        "|---|---|---|---|---|",
    ]
    return (head if rows else []) + [
        f"| {name} | {row['unit']} | {row['against']} | {row['of']} | {_percent(row['median_relative_error'])} |"
        for name, row in rows.items()
    ]


def _percent(share: float | None, decimals: int = 0) -> str:
    """Format a share between 0 and 1 in percent; an empty text for None."""
    return "" if share is None else f"{100 * share:.{decimals}f} %"


def _interval(figure: Mapping[str, Any]) -> str:
    """Format the 95 % interval of a share in percent; an empty text if no case was counted."""
    return f"{100 * figure['ci95'][0]:.0f} to {100 * figure['ci95'][1]:.0f} %" if figure["of"] else ""


def _share_table(rows: Mapping[str, Mapping[str, Any]], heading: str) -> list[str]:
    """Format a Markdown table of shares with their intervals; no lines without rows. heading: of the first column."""
    lines = [f"| {heading} | correct | of | interval |", "|---|---|---|---|"] if rows else []
    return lines + [
        f"| {name} | {_percent(row['share'])} | {row['of']} | {_interval(row)} |" for name, row in rows.items()
    ]


def _confusion_table(table: Mapping[str, Mapping[str, int]]) -> list[str]:
    """Format a Markdown table of the number of worlds by true effect (rows) and effect named first (columns)."""
    columns = sorted({column for row in table.values() for column in row})
    lines = [f"| truth | {' | '.join(columns)} |", "|---" * (len(columns) + 1) + "|"]
    for truth in sorted(table):
        lines.append(f"| {truth} | {' | '.join(_count(table[truth].get(column, 0)) for column in columns)} |")
    return lines


def _count(number: int) -> str:
    """Format one entry of the confusion table, a number of worlds; an empty text for 0."""
    return str(number) if number else ""


_BASELINES: Final = (
    (
        "rules",
        "A check list that names the effect of the largest disagreement, instead of the diagnosis, is correct in "
        "{share} of {of} worlds with a single effect.",
    ),
    (
        "effect_blind",
        "An effect selected at random whenever there is a gap, instead of the diagnosis, is correct in {share} of {of} "
        "worlds with a single effect.",
    ),
    (
        "shuffled_says_unknown_or_no_gap",
        "The diagnosis with the simulations of other indentations, which do not match the data of the hand, reports "
        "an unknown cause or no gap in {share} of {of} worlds.",
    ),
)


def _baseline_list(part: Mapping[str, Any]) -> list[str]:
    """Format a Markdown list with the share of correct answers of each simple reference diagnoser."""
    return [
        "- " + text.format(share=_percent(part["simpler"][key]["share"]), of=part["simpler"][key]["of"])
        for key, text in _BASELINES
        if part["simpler"][key]["of"]
    ]
