"""What the report was made from, what these files lack, and further notes."""

from __future__ import annotations

from taxel.gap.page.report import Report
from taxel.gap.page.tables import Column, Section, bullets, table
from taxel.gap.page.text import escaped, number, plural

_COLUMNS = (Column("Input"), Column("File"), Column("SHA-256"))


def inputs_section(report: Report) -> Section:
    """The section. Raises GapInputError."""
    inputs = report.root.field("inputs")
    rows = []
    for label, side in (("Hand", "real"), ("Simulator", "sim")):
        entry = inputs.field(side)
        digest = f"<code>{escaped(entry.text('sha256'))}</code>"
        rows.append((label, f"<code>{escaped(entry.text('path'))}</code>", digest))
    seed = report.root.field("seed").as_integer(-(2**255), 2**255)
    run = f"Seed {seed}; {plural_seconds(report.root.maybe_number('runtime_s'))}."
    parts = [table(_COLUMNS, rows, "Inputs", "inputs"), f"<p>{run}</p>"]
    for title, key in (("What these files lack", "losses"), ("Notes", "notes")):
        texts = [escaped(text) for text in report.root.texts(key)]
        parts += [f"<h3>{title}</h3>{bullets(texts)}"] if texts else []
    return Section("inputs", "Inputs", "\n".join(parts))


def plural_seconds(seconds: float | None) -> str:
    """A run time in words."""
    if seconds is None:
        return "run time not stated"
    minutes = int(seconds // 60)
    text = f"{plural(minutes, 'minute')} {seconds - 60 * minutes:.0f}\N{NO-BREAK SPACE}s" if minutes else ""
    return f"diagnosed in {text or f'{number(seconds)}{chr(160)}s'}"
