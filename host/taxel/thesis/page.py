"""One HTML page: the findings, the figures, and every table with ours, the thesis's figure and the ratio."""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from importlib import resources
from pathlib import Path

from taxel.gap.page.text import ABSENT, escaped, number, words
from taxel.thesis.figures import FIGURES
from taxel.thesis.findings import Finding, Other
from taxel.thesis.gap_beside import Beside
from taxel.thesis.nearness import Nearness
from taxel.thesis.printed import INCONSISTENT
from taxel.thesis.tables import Row, Table

_POLICY = "default-src 'none'; style-src 'unsafe-inline'; img-src data:"

IN_MM = ("rms_m", "max_m", "mean_m", "std_m")
HEADINGS = {
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


def write_page(
    path: Path,
    tables: Sequence[Table],
    found: Sequence[Finding],
    near: Nearness,
    besides: Sequence[Other],
    figures: Mapping[str, Path],
    gap: Beside | None,
    made: Sequence[str],
) -> None:
    """Everything in one file. made: sentences on how the data were made."""
    title = f"The thesis once more: {sum(one.reproduced for one in found)} of {len(found)} findings reproduced"
    body = "".join(
        (
            f"<header><h1>{escaped(title)}</h1>{''.join(f'<p>{escaped(one)}</p>' for one in made)}</header>",
            _findings(found),
            _others(besides),
            _gap(gap),
            _figures(figures),
            f"<section><h2>Tables</h2><p>Ours, the thesis's, and the ratio. {escaped(near.one_line)}.</p></section>",
            *(_table(one) for one in tables),
            _inconsistent(),
        )
    )
    style = (resources.files("taxel.thesis") / "page.css").read_text(encoding="utf-8")
    path.write_text(
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8"/>\n'
        f'<meta http-equiv="Content-Security-Policy" content="{escaped(_POLICY)}"/>\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1"/>\n'
        f"<title>{escaped(title)}</title>\n<style>\n{style}</style>\n</head>\n<body>\n{body}</body>\n</html>\n",
        encoding="utf-8",
    )


def _findings(found: Sequence[Finding]) -> str:
    rows = "".join(
        f'<tr class="{"yes" if one.reproduced else "no"}"><td>{one.number}</td><td>{escaped(one.says)}</td>'
        + "".join(f"<td>{_figure(one, name, place)}</td>" for place, name in enumerate(one.numbers))
        + f"<td>{'reproduced' if one.reproduced else 'not reproduced'}</td></tr>"
        for one in found
    )
    names = list(found[0].numbers) if found else []
    head = "".join(f"<th>{escaped(name)}</th>" for name in names)
    return (
        "<section><h2>Findings</h2><p>Each must hold for all three objects. The thesis's own number is in brackets; a "
        "number that breaks the finding is marked.</p>"
        f'<div class="wide"><table class="findings"><thead><tr><th></th><th>finding</th>{head}<th></th></tr></thead>'
        f"<tbody>{rows}</tbody></table></div></section>"
    )


def _figure(one: Finding, name: str, place: int) -> str:
    unit = "" if one.unit == "1" else f" {one.unit}"
    text = f"{number(one.numbers[name])}{unit} ({number(one.thesis[place])})"
    return text if one.holds[name] else f"<mark>{text}</mark>"


def _others(besides: Sequence[Other]) -> str:
    rows = "".join(
        f"<tr><td>{escaped(one.says)}</td>"
        + "".join(f"<td>{escaped(value)}</td>" for value in one.numbers.values())
        + f"<td>{escaped(one.thesis)}</td></tr>"
        for one in besides
    )
    head = "".join(f"<th>{escaped(name)}</th>" for name in (besides[0].numbers if besides else ()))
    return (
        "<section><h2>Beside them, never fitted</h2>"
        f'<div class="wide"><table class="others"><thead><tr><th></th>{head}<th>thesis</th></tr></thead>'
        f"<tbody>{rows}</tbody></table></div></section>"
    )


def _gap(gap: Beside | None) -> str:
    if gap is None:
        return ""
    shares = "".join(f"<li>{words(name)}: {number(value)} %</li>" for name, value in gap.shares.items())
    steps = "".join(
        f"<tr><td>{escaped(stage)}</td><td>{number(ours)}</td><td>{number(theirs)}</td></tr>"
        for stage, (ours, theirs) in gap.steps.items()
    )
    largest = "It finds" if gap.finds_largest else "It does not find"
    return (
        f"<section><h2>The gap diagnosis of the same data</h2><p>{escaped(gap.one_line)}</p>"
        f"<p>{largest} contact propagation as the largest cause. Shares of what the named causes take from the gap:</p>"
        f"<ul>{shares}</ul><p>The treatment's steps, mean share over the objects, %:</p>"
        '<div class="wide"><table><thead><tr><th>step</th><th>ours</th><th>thesis</th></tr></thead>'
        f"<tbody>{steps}</tbody></table></div></section>"
    )


def _figures(figures: Mapping[str, Path]) -> str:
    parts = []
    for key, path in figures.items():
        data = base64.b64encode(path.read_bytes()).decode()
        caption = f"Figure {key}. {FIGURES[key]}"
        parts.append(
            f'<figure><img alt="{escaped(caption)}" src="data:image/png;base64,{data}"/>'
            f"<figcaption>{escaped(caption)}</figcaption></figure>"
        )
    return f"<section><h2>Figures</h2>{''.join(parts)}</section>"


def _table(table: Table) -> str:
    head = "".join(f"<th>{escaped(key)}</th>" for key in table.keys)
    head += "".join(f'<th colspan="3">{escaped(HEADINGS.get(name, name))}</th>' for name in table.columns)
    rows = "".join(f"<tr>{_row(table, row)}</tr>" for row in table.rows)
    return (
        f'<section><h3>Table {escaped(table.number)}. {escaped(table.title)}</h3><div class="wide"><table>'
        f"<thead><tr>{head}</tr></thead><tbody>{rows}</tbody></table></div></section>"
    )


def _row(table: Table, row: Row) -> str:
    cells = [f"<td>{escaped(key)}</td>" for key in row.key]
    for name in table.columns:
        factor = 1e3 if name in IN_MM else 1.0
        ours, thesis = (None if v is None else factor * v for v in (row.ours.get(name), row.thesis.get(name)))
        ratio = row.ratio(name)
        told = ABSENT if ratio is None else f"{ratio:.2f}"
        cells.append(f'<td>{number(ours)}</td><td class="thesis">{number(thesis)}</td><td class="ratio">{told}</td>')
    return "".join(cells)


def _inconsistent() -> str:
    items = "".join(f"<li>{escaped(one)}</li>" for one in INCONSISTENT)
    return f"<section><h2>Where the thesis contradicts itself</h2><ul>{items}</ul></section>"
