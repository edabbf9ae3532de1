"""Section on earlier tests of the same device: numbers that have moved, and earlier results."""

from collections.abc import Sequence

from taxel.gap.page.text import ABSENT, format_count
from taxel_tools.testing.drift import Change
from taxel_tools.testing.history import Summary
from taxel_tools.testing.page.elements import format_place, render_scrolled
from taxel_tools.testing.page.figures import format_figure, format_time, format_with_unit
from taxel_tools.testing.page.html_text import (
    Column,
    Section,
    escape_name,
    escape_text,
    render_folded,
    render_paragraph,
    render_table,
)
from taxel_tools.testing.record import PhaseRecord

RUNS_MAX = 10
MOVED_MAX = 12

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


def render_earlier_section(
    phases: Sequence[PhaseRecord], changes: Sequence[Change], earlier: Sequence[Summary]
) -> Section | None:
    """Render the section of the page that compares a test with earlier tests of the same device; None without earlier
    tests.
    """
    if not changes and not earlier:
        return None
    titles = {phase.name: phase.title for phase in phases}
    moved = sorted((change for change in changes if change.has_moved), key=lambda change: -change.shift)
    parts = []
    if moved:
        text = (
            f"{len(moved):,} of {format_count(len(changes), 'number')} moved more than expected from the earlier tests."
        )
        parts += [
            render_paragraph(text),
            _render_changes(moved[:MOVED_MAX], titles, "Moved values, in order of decreasing shift"),
        ]
    elif changes:
        parts.append(render_paragraph(f"None of {format_count(len(changes), 'number')} moved more than expected."))
    if len(changes) > min(len(moved), MOVED_MAX):
        full_table = _render_changes(changes, titles, "All numbers, now and before")
        parts.append(render_folded(f"All {format_count(len(changes), 'number')}, now and before", full_table))
    if earlier:
        parts.append(_render_runs(earlier))
    return Section("earlier", "Earlier tests", "".join(parts))


def _render_changes(changes: Sequence[Change], titles: dict[str, str], caption: str) -> str:
    """Render the HTML table of measurements compared with earlier tests."""
    rows = (
        (
            f"{escape_name(change.measurement)} "
            f'<span class="phase">{escape_text(titles.get(change.phase, change.phase))}</span>',
            format_place(change.place),
            format_with_unit(change.value, change.unit),
            format_figure(change.last),
            format_figure(change.median),
            f"{change.runs:,}",
            '<b class="moved">moved</b>' if change.has_moved else "",
        )
        for change in changes
    )
    return render_scrolled(render_table(_CHANGES, rows, caption, "measured"), caption)


def _render_runs(earlier: Sequence[Summary]) -> str:
    """Render the HTML table of the earlier tests of the board."""
    rows = (
        (
            format_time(run.started_utc),
            f'<b class="{run.outcome}">{run.outcome}</b>',
            escape_text(f"{run.plan_name}, version {run.plan_version}"),
            escape_text(run.operator),
            escape_text("; ".join(run.faults)) or ABSENT,
        )
        for run in earlier[:RUNS_MAX]
    )
    hidden_count = len(earlier) - RUNS_MAX
    remark = (
        render_paragraph(f"{format_count(hidden_count, 'older test')} not shown.", "small") if hidden_count > 0 else ""
    )
    return render_scrolled(render_table(_RUNS, rows, "Earlier tests", "runs"), "Earlier tests") + remark
