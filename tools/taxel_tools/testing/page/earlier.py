"""The same device before: which numbers have moved, and how its earlier tests came out."""

from __future__ import annotations

from collections.abc import Sequence

from taxel.gap.page.tables import Column, Section, folded, paragraph, table
from taxel.gap.page.text import ABSENT, escaped, plural, words
from taxel_tools.testing.drift import Change
from taxel_tools.testing.history import Summary
from taxel_tools.testing.page.elements import place_words, scrolled
from taxel_tools.testing.page.figures import figure, time_words, with_unit
from taxel_tools.testing.record import PhaseRecord

MOST_RUNS = 10
MOST_MOVED = 12

_CHANGES = (
    Column("measurement"),
    Column("place"),
    Column("now", "n"),
    Column("last", "n"),
    Column("median", "n"),
    Column("tests", "n"),
    Column("", "verdict"),
)
_RUNS = (Column("tested"), Column("", "verdict"), Column("plan"), Column("operator"), Column("faults"))


def earlier_section(
    phases: Sequence[PhaseRecord], changes: Sequence[Change], earlier: Sequence[Summary]
) -> Section | None:
    """What the history says; None where it says nothing."""
    if not changes and not earlier:
        return None
    titles = {phase.name: phase.title for phase in phases}
    moved = sorted((one for one in changes if one.moved), key=lambda one: -one.shift)
    parts = []
    if moved:
        told = f"{len(moved):,} of {plural(len(changes), 'number')} moved more than the earlier tests let expect."
        parts += [paragraph(told), _table(moved[:MOST_MOVED], titles, "What moved, most first")]
    elif changes:
        parts.append(paragraph(f"None of {plural(len(changes), 'number')} moved more than is usual."))
    if len(changes) > min(len(moved), MOST_MOVED):
        whole = _table(changes, titles, "All numbers, now and before")
        parts.append(folded(f"All {plural(len(changes), 'number')}, now and before", whole))
    if earlier:
        parts.append(_runs(earlier))
    return Section("earlier", "Earlier tests", "".join(parts))


def _table(changes: Sequence[Change], titles: dict[str, str], caption: str) -> str:
    rows = (
        (
            f'{words(one.measurement)} <span class="says">{escaped(titles.get(one.phase, one.phase))}</span>',
            place_words(one.place),
            with_unit(one.value, one.unit),
            figure(one.last),
            figure(one.median),
            f"{one.runs:,}",
            '<b class="moved">moved</b>' if one.moved else "",
        )
        for one in changes
    )
    return scrolled(table(_CHANGES, rows, caption, "measured"), caption)


def _runs(earlier: Sequence[Summary]) -> str:
    rows = (
        (
            time_words(one.started_utc),
            f'<b class="{one.outcome}">{one.outcome}</b>',
            escaped(f"{one.plan_name}, version {one.plan_version}"),
            escaped(one.operator),
            escaped("; ".join(one.faults)) or ABSENT,
        )
        for one in earlier[:MOST_RUNS]
    )
    more = len(earlier) - MOST_RUNS
    rest = paragraph(f"And {plural(more, 'older test')}.", "small") if more > 0 else ""
    return scrolled(table(_RUNS, rows, "Earlier tests", "runs"), "Earlier tests") + rest
