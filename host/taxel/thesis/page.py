"""The HTML page of the reproduction: skill, findings, settings, figures, and tables with printed values."""

import base64
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Any, Final

from taxel.gap.page.rendering import render
from taxel.gap.page.text import ABSENT, format_number, make_readable
from taxel.output import write_whole
from taxel.thesis.figures import FIGURES
from taxel.thesis.gap_summary import GapSummary
from taxel.thesis.printed import INCONSISTENCIES
from taxel.thesis.settings import SEARCH_SEEDS, SEARCHED
from taxel.thesis.skill import ALL_STATISTICS, GROUPS, SkillReport
from taxel.thesis.statements import NOT_TESTED
from taxel.thesis.summary import SCORED_COLUMNS, FindingSummary, Spread, Summary
from taxel.thesis.tables import Row, Table

SECURITY_POLICY: Final = "default-src 'none'; style-src 'unsafe-inline'; img-src data:"

COLUMNS_IN_MM: Final = ("rms_m", "max_m", "mean_m", "std_m")
HEADINGS: Final = {
    "rms_m": "RMS, mm",
    "max_m": "largest, mm",
    "mean_m": "mean, mm",
    "std_m": "std, mm",
    "removed_percent": "removed, %",
    "share_percent": "share, %",
    "real_points": "real points",
    "sim_points": "simulated points",
    "real_over_sim": "real over simulated",
    "n": "N",
    "n_sigma": "nSigma",
}


@dataclass(frozen=True)
class PageContent:
    """Content of the page of the reproduction.

    summary: results of all seeds. tables: tables of the shown seed. figures: image files of the shown seed by figure
    number. gap: summary of the gap diagnosis; None: not diagnosed. description: sentences on how the datasets of the
    shown seed were made.
    """

    summary: Summary
    tables: Sequence[Table]
    figures: Mapping[str, Path]
    gap: GapSummary | None
    description: Sequence[str]


def write_page(path: Path, content: PageContent) -> None:
    """Write the page of the reproduction, with its figures, as one HTML file."""
    style = (resources.files("taxel.thesis") / "page.css").read_text(encoding="utf-8")
    context = _build_context(content)
    text = render("thesis.html", package="taxel.thesis", policy=SECURITY_POLICY, style=style, **context)
    write_whole(path, text)


def _build_context(content: PageContent) -> dict[str, Any]:
    """Return the variables of the page's template: strings, numbers, and lists and dictionaries of them."""
    summary = content.summary
    skills = summary.skills[summary.shown]
    return {
        "title": f"Reproduction of chapter 5: {describe_findings(summary)}",
        "description": [describe_seeds(summary), *content.description],
        "object_names": [result.printed_name for result in summary.shown_results],
        "seeds": len(summary.seeds),
        "findings": [_finding_context(item) for item in summary.summarise_findings()],
        "not_tested": NOT_TESTED,
        "skill_headings": list(ALL_STATISTICS.values()),
        "skills": [_skill_context(summary, group) for group in GROUPS],
        "shapes": [
            (f"{group}, {models} models", _format_spread(spread, len(summary.seeds), " %"))
            for (group, models), spread in summary.summarise_shapes().items()
        ],
        "searched": SEARCHED,
        "search_seeds": ", ".join(str(seed) for seed in SEARCH_SEEDS),
        "gap": None if content.gap is None else _gap_context(content.gap),
        "figures": [_figure_context(number, path) for number, path in content.figures.items()],
        "tables": [_table_context(table, skills) for table in content.tables],
        "inconsistencies": INCONSISTENCIES,
    }


def describe_findings(summary: Summary) -> str:
    """State the number of reproduced findings in one phrase; for several seeds, the median and the worst number."""
    counts = summary.reproduced
    if len(summary.seeds) == 1:
        return f"{counts.median:g} of {summary.counted} findings reproduced"
    return (
        f"{counts.median:g} of {summary.counted} findings reproduced, median of {len(summary.seeds)} seeds "
        f"(worst {counts.worst:g})"
    )


def describe_seeds(summary: Summary) -> str:
    """State in sentences the seeds of the results, whether settings were searched with them, and which seed is
    shown.
    """
    seeds = [str(result.seed) for result in summary.seeds if result.seed is not None]
    if not seeds:
        return "Existing datasets: one result, without median and worst."
    searched = ", ".join(str(seed) for seed in SEARCH_SEEDS)
    if summary.unseen:
        origin = f"not used in the search of settings (which used {searched})"
    else:
        origin = f"not an unseen one: the search of settings used {searched}"
    if len(seeds) == 1:
        return f"Seed {seeds[0]}, {origin}. One seed: the numbers have no median and worst."
    shown = summary.seeds[summary.shown].seed
    return (
        f"Seeds {', '.join(seeds)}, {origin}. Numbers are medians over the seeds, the worst in brackets. Figures, "
        f"tables and the skills of single tables are those of seed {shown}, the median one by number of findings."
    )


def _format_spread(spread: Spread | None, seeds: int, unit: str = "") -> str:
    """Format the median, followed by the worst value in brackets if there are several seeds; a dash for None."""
    if spread is None:
        return ABSENT
    text = f"{format_number(spread.median)}{unit}"
    return text if seeds == 1 else f"{text} ({format_number(spread.worst)}{unit})"


def _skill_context(summary: Summary, group: str) -> dict[str, Any]:
    """Return the template variables for the skills of one group of tables: number of entries, and one text per
    statistic.

    A skill is 1 for a perfect reproduction of the printed values, and 0 if the reproduced values are as good as one
    constant for all printed values.
    """
    skills = summary.skills[summary.shown].groups
    entries = next(skill.entries for (name, _), skill in skills.items() if name == group)
    texts = []
    for column in SCORED_COLUMNS:
        spread = summary.get_skill(group, column)
        is_negative = spread is not None and spread.median <= 0.0
        texts.append({"text": _format_spread(spread, len(summary.seeds)), "is_negative": is_negative})
    return {"group": group, "entries": entries, "texts": texts}


def _finding_context(item: FindingSummary) -> dict[str, Any]:
    """Return the template variables for one finding: statement, number and outcome for each object, verdict, reason."""
    finding = item.finding
    unit = "" if finding.statement.unit == "1" else f" {finding.statement.unit}"
    entries = []
    for name, value in item.numbers.items():
        printed = f" ({format_number(finding.printed[name])})" if name in finding.printed else ""
        text = f"{format_number(value)}{unit}{printed}"
        entries.append({"text": text, "holds": finding.holds[name], "counts": name in finding.counted})
    if not finding.is_counted:
        verdict = "not counted"
    else:
        verdict = "reproduced" if item.is_reproduced else "not reproduced"
        if item.seeds > 1:
            verdict += f", {item.reproduced} of {item.seeds} seeds"
    return {
        "number": finding.number,
        "statement": finding.statement.text,
        "source": finding.statement.source,
        "criterion": finding.statement.criterion,
        "entries": entries,
        "verdict": verdict,
        "reason": item.reason,
        "css": "out" if not finding.is_counted else "yes" if item.is_reproduced else "no",
    }


def _gap_context(gap: GapSummary) -> dict[str, Any]:
    """Return the variables of the page's template for the gap diagnosis."""
    return {
        "headline": gap.headline,
        "is_largest_cause_found": gap.is_largest_cause_found,
        "shares": [(make_readable(name), format_number(share)) for name, share in gap.shares.items()],
        "steps": [(step, format_number(value), format_number(printed)) for step, (value, printed) in gap.steps.items()],
    }


def _figure_context(figure_number: str, path: Path) -> dict[str, str]:
    """Return the variables of the page's template for one figure: caption and image in base64."""
    caption = f"Figure {figure_number}. {FIGURES[figure_number]}"
    return {"caption": caption, "base64": base64.b64encode(path.read_bytes()).decode()}


def _table_context(table: Table, skills: SkillReport) -> dict[str, Any]:
    """Return the template variables for one table. skills: skills of the shown seed."""
    values = [
        f"{name} {format_number(skill.value)}"
        for column, name in ALL_STATISTICS.items()
        if (skill := skills.tables.get((table.number, column))) is not None and skill.value is not None
    ]
    return {
        "number": table.number,
        "title": table.title,
        "skills": ", ".join(values),
        "row_keys": table.keys,
        "headings": [HEADINGS.get(name, name) for name in table.columns],
        "rows": [
            {"key": row.key, "entries": [_entry_context(row, column) for column in table.columns]} for row in table.rows
        ],
    }


def _entry_context(row: Row, column: str) -> dict[str, str]:
    """Format the reproduced value, the printed value and their ratio in one column of a row; distances in
    millimetres.
    """
    factor = 1e3 if column in COLUMNS_IN_MM else 1.0
    value, printed = (
        None if item is None else factor * item for item in (row.values.get(column), row.printed_values.get(column))
    )
    ratio = row.ratio(column)
    return {
        "value": format_number(value),
        "printed": format_number(printed),
        "ratio": ABSENT if ratio is None else f"{ratio:.2f}",
    }
