"""The phases of a test: one line each, then a section each."""

from __future__ import annotations

from collections.abc import Sequence

from taxel.gap.page.tables import Column, Section, bullets, paragraph, table
from taxel.gap.page.text import ABSENT, escaped
from taxel_tools.testing.page.attachments import attachments_html
from taxel_tools.testing.page.elements import placed, scrolled
from taxel_tools.testing.page.figures import seconds_words
from taxel_tools.testing.page.measurements import measurements_html
from taxel_tools.testing.record import Finding, Outcome, PhaseRecord

_COLUMNS = (
    Column("phase"),
    Column("", "verdict"),
    Column("held against limits", "n"),
    Column("beyond", "n"),
    Column("faults", "n"),
    Column("time", "n"),
)


def phases_section(phases: Sequence[PhaseRecord]) -> Section:
    """All phases in a table."""
    rows = [_row(number, phase) for number, phase in enumerate(phases, start=1)]
    if not rows:
        return Section("phases", "Phases", paragraph("The plan has no phase for this kind of device."))
    caption = "The phases and how they came out"
    return Section("phases", "Phases", scrolled(table(_COLUMNS, rows, caption, "overview"), caption))


def phase_section(number: int, phase: PhaseRecord) -> Section:
    """One phase: what it found, measured, attached and noted."""
    chip = f'<span class="chip status {phase.outcome}">{phase.outcome}</span>'
    who = "" if phase.automatic else ", with an operator"
    skipped = phase.outcome is Outcome.SKIP
    parts = [] if skipped else [paragraph(f"{seconds_words(phase.seconds)}{who}", "small")]
    if phase.problem:
        parts.append(paragraph(escaped(phase.problem), "problem"))
    if phase.findings:
        found = sorted(phase.findings, key=lambda one: -one.severity)
        parts.append(bullets((_finding(one) for one in found), "findings"))
    parts.append(measurements_html(phase.title, phase.measurements))
    parts.append(attachments_html(phase.attachments))
    if phase.notes:
        parts.append(bullets(map(escaped, phase.notes), "notes"))
    return Section(f"phase-{number}", f"{escaped(phase.title)} {chip}", "".join(parts))


def _finding(one: Finding) -> str:
    return f"<b>{escaped(one.fault)}</b>{placed(one.place)} {escaped(one.text)}"


def _row(number: int, phase: PhaseRecord) -> tuple[str, ...]:
    limited = [one for one in phase.measurements if one.limit is not None]
    failed = sum(one.outcome is Outcome.FAIL for one in limited)
    skipped = phase.outcome is Outcome.SKIP
    return (
        f'<a href="#phase-{number}">{escaped(phase.title)}</a>',
        f'<b class="{phase.outcome}">{phase.outcome}</b>',
        ABSENT if skipped else f"{len(limited):,}",
        ABSENT if skipped else _count(failed),
        ABSENT if skipped else _count(len(phase.findings)),
        ABSENT if skipped else seconds_words(phase.seconds),
    )


def _count(count: int) -> str:
    return f'<b class="fail">{count:,}</b>' if count else "0"
