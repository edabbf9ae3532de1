"""The HTML page of the reproduction: findings, figures, and tables with reproduced value, printed value and ratio."""

import base64
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Any, Final

from taxel.gap.page.rendering import render
from taxel.gap.page.text import ABSENT, format_number, make_readable
from taxel.thesis.distance_agreement import DistanceAgreement
from taxel.thesis.figures import FIGURES
from taxel.thesis.findings import Finding, FurtherResult
from taxel.thesis.gap_summary import GapSummary
from taxel.thesis.printed import INCONSISTENCIES
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

    description: sentences on how the datasets were made. figures: files by figure number.
    """

    tables: Sequence[Table]
    findings: Sequence[Finding]
    agreement: DistanceAgreement
    further_results: Sequence[FurtherResult]
    figures: Mapping[str, Path]
    gap: GapSummary | None
    description: Sequence[str]


def write_page(path: Path, content: PageContent) -> None:
    """Write the page of the reproduction, with its figures, as one HTML file."""
    style = (resources.files("taxel.thesis") / "page.css").read_text(encoding="utf-8")
    context = _build_context(content)
    text = render("thesis.html", package="taxel.thesis", policy=SECURITY_POLICY, style=style, **context)
    path.write_text(text, encoding="utf-8")


def _build_context(content: PageContent) -> dict[str, Any]:
    """Return the variables of the page's template; all values are text, names or lists of them."""
    findings = content.findings
    reproduced = sum(finding.is_reproduced for finding in findings)
    return {
        "title": f"Reproduction of chapter 5: {reproduced} of {len(findings)} findings reproduced",
        "description": content.description,
        "object_names": list(findings[0].numbers) if findings else [],
        "findings": [_finding_context(finding) for finding in findings],
        "further_results": content.further_results,
        "gap": None if content.gap is None else _gap_context(content.gap),
        "figures": [_figure_context(number, path) for number, path in content.figures.items()],
        "agreement": content.agreement.summary,
        "tables": [_table_context(table) for table in content.tables],
        "inconsistencies": INCONSISTENCIES,
    }


def _finding_context(finding: Finding) -> dict[str, Any]:
    """Return the variables of the page's template for one finding."""
    unit = "" if finding.unit == "1" else f" {finding.unit}"
    entries = [
        {"text": f"{format_number(value)}{unit} ({format_number(printed)})", "holds": finding.holds[name]}
        for (name, value), printed in zip(finding.numbers.items(), finding.printed, strict=False)
    ]
    return {
        "number": finding.number,
        "statement": finding.statement,
        "entries": entries,
        "is_reproduced": finding.is_reproduced,
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


def _table_context(table: Table) -> dict[str, Any]:
    """Return the variables of the page's template for one table."""
    return {
        "number": table.number,
        "title": table.title,
        "row_keys": table.keys,
        "headings": [HEADINGS.get(name, name) for name in table.columns],
        "rows": [
            {"key": row.key, "entries": [_entry_context(row, column) for column in table.columns]} for row in table.rows
        ],
    }


def _entry_context(row: Row, column: str) -> dict[str, str]:
    """Format the reproduced value, printed value and their ratio of a table entry; distances in millimetres."""
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
