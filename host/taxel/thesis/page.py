"""The HTML page of the reproduction: findings, figures, and tables with reproduced value, printed value and ratio."""

import base64
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Final

from taxel.gap.page.text import ABSENT, escaped, number, words
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
    """Content of the page. description: sentences on how the datasets were made. figures: files by figure number."""

    tables: Sequence[Table]
    findings: Sequence[Finding]
    agreement: DistanceAgreement
    further_results: Sequence[FurtherResult]
    figures: Mapping[str, Path]
    gap: GapSummary | None
    description: Sequence[str]


def write_page(path: Path, content: PageContent) -> None:
    """Write the page with its figures as one file."""
    findings = content.findings
    reproduced = sum(finding.is_reproduced for finding in findings)
    title = f"Reproduction of chapter 5: {reproduced} of {len(findings)} findings reproduced"
    description = "".join(f"<p>{escaped(sentence)}</p>" for sentence in content.description)
    agreement = escaped(content.agreement.summary)
    body = "".join(
        (
            f"<header><h1>{escaped(title)}</h1>{description}</header>",
            _render_findings(findings),
            _render_further_results(content.further_results),
            _render_gap(content.gap),
            _render_figures(content.figures),
            f"<section><h2>Tables</h2><p>Reproduced value, printed value, ratio. {agreement}.</p></section>",
            *(_render_table(table) for table in content.tables),
            _render_inconsistencies(),
        )
    )
    style = (resources.files("taxel.thesis") / "page.css").read_text(encoding="utf-8")
    path.write_text(
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8"/>\n'
        f'<meta http-equiv="Content-Security-Policy" content="{escaped(SECURITY_POLICY)}"/>\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1"/>\n'
        f"<title>{escaped(title)}</title>\n<style>\n{style}</style>\n</head>\n<body>\n{body}</body>\n</html>\n",
        encoding="utf-8",
    )


def _render_findings(findings: Sequence[Finding]) -> str:
    rows = "".join(
        f'<tr class="{"yes" if finding.is_reproduced else "no"}"><td>{finding.number}</td>'
        f"<td>{escaped(finding.statement)}</td>"
        + "".join(f"<td>{_render_number(finding, name, row)}</td>" for row, name in enumerate(finding.numbers))
        + f"<td>{'reproduced' if finding.is_reproduced else 'not reproduced'}</td></tr>"
        for finding in findings
    )
    names = list(findings[0].numbers) if findings else []
    head = "".join(f"<th>{escaped(name)}</th>" for name in names)
    return (
        "<section><h2>Findings</h2><p>A finding is reproduced if it holds for all three objects. The printed number is "
        "in brackets; a number for which the finding does not hold is marked.</p>"
        f'<div class="wide"><table class="findings"><thead><tr><th></th><th>finding</th>{head}<th></th></tr></thead>'
        f"<tbody>{rows}</tbody></table></div></section>"
    )


def _render_number(finding: Finding, name: str, row: int) -> str:
    unit = "" if finding.unit == "1" else f" {finding.unit}"
    text = f"{number(finding.numbers[name])}{unit} ({number(finding.printed[row])})"
    return text if finding.holds[name] else f"<mark>{text}</mark>"


def _render_further_results(results: Sequence[FurtherResult]) -> str:
    rows = "".join(
        f"<tr><td>{escaped(result.title)}</td>"
        + "".join(f"<td>{escaped(value)}</td>" for value in result.numbers.values())
        + f"<td>{escaped(result.printed)}</td></tr>"
        for result in results
    )
    head = "".join(f"<th>{escaped(name)}</th>" for name in (results[0].numbers if results else ()))
    return (
        "<section><h2>Further results, not used to choose settings</h2>"
        f'<div class="wide"><table class="others"><thead><tr><th></th>{head}<th>thesis</th></tr></thead>'
        f"<tbody>{rows}</tbody></table></div></section>"
    )


def _render_gap(gap: GapSummary | None) -> str:
    if gap is None:
        return ""
    shares = "".join(f"<li>{words(name)}: {number(value)} %</li>" for name, value in gap.shares.items())
    steps = "".join(
        f"<tr><td>{escaped(stage)}</td><td>{number(value)}</td><td>{number(printed)}</td></tr>"
        for stage, (value, printed) in gap.steps.items()
    )
    is_largest = "is" if gap.is_largest_cause_found else "is not"
    return (
        f"<section><h2>Gap diagnosis of the same datasets</h2><p>{escaped(gap.headline)}</p>"
        f"<p>Contact propagation {is_largest} the named cause with the largest share. Shares of the named causes in "
        f"the reduction of the gap:</p><ul>{shares}</ul><p>Treatment steps, mean share over the objects, %:</p>"
        '<div class="wide"><table><thead><tr><th>step</th><th>reproduced</th><th>printed</th></tr></thead>'
        f"<tbody>{steps}</tbody></table></div></section>"
    )


def _render_figures(figures: Mapping[str, Path]) -> str:
    parts = []
    for key, path in figures.items():
        data = base64.b64encode(path.read_bytes()).decode()
        caption = f"Figure {key}. {FIGURES[key]}"
        parts.append(
            f'<figure><img alt="{escaped(caption)}" src="data:image/png;base64,{data}"/>'
            f"<figcaption>{escaped(caption)}</figcaption></figure>"
        )
    return f"<section><h2>Figures</h2>{''.join(parts)}</section>"


def _render_table(table: Table) -> str:
    head = "".join(f"<th>{escaped(key)}</th>" for key in table.keys)
    head += "".join(f'<th colspan="3">{escaped(HEADINGS.get(name, name))}</th>' for name in table.columns)
    rows = "".join(f"<tr>{_render_row(table, row)}</tr>" for row in table.rows)
    return (
        f'<section><h3>Table {escaped(table.number)}. {escaped(table.title)}</h3><div class="wide"><table>'
        f"<thead><tr>{head}</tr></thead><tbody>{rows}</tbody></table></div></section>"
    )


def _render_row(table: Table, row: Row) -> str:
    cells = [f"<td>{escaped(key)}</td>" for key in row.key]
    for name in table.columns:
        factor = 1e3 if name in COLUMNS_IN_MM else 1.0
        pair = (row.values.get(name), row.printed_values.get(name))
        value, printed = (None if item is None else factor * item for item in pair)
        ratio = row.ratio(name)
        ratio_text = ABSENT if ratio is None else f"{ratio:.2f}"
        cells.append(f"<td>{number(value)}</td>")
        cells.append(f'<td class="thesis">{number(printed)}</td><td class="ratio">{ratio_text}</td>')
    return "".join(cells)


def _render_inconsistencies() -> str:
    items = "".join(f"<li>{escaped(item)}</li>" for item in INCONSISTENCIES)
    return f"<section><h2>Inconsistencies of the thesis</h2><ul>{items}</ul></section>"
