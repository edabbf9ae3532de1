"""Phases of a test: an overview table, then one section for each phase."""

from collections.abc import Sequence

from taxel.gap.page.text import ABSENT
from taxel_tools.testing.page.attachments import render_attachments
from taxel_tools.testing.page.elements import format_inline_place, render_scrolled
from taxel_tools.testing.page.figures import format_duration
from taxel_tools.testing.page.html_text import (
    Column,
    Section,
    escape_text,
    render_bullets,
    render_paragraph,
    render_table,
)
from taxel_tools.testing.page.measurements import render_measurements
from taxel_tools.testing.record import Finding, Outcome, PhaseRecord

_COLUMNS = (
    Column("phase"),
    Column("", "verdict"),
    Column("limits checked", "n"),
    Column("beyond", "n"),
    Column("faults", "n"),
    Column("time", "n"),
)


def render_phases_section(phases: Sequence[PhaseRecord]) -> Section:
    """Render the section of the page with the overview table of all phases of a test."""
    rows = [_render_row(number, phase) for number, phase in enumerate(phases, start=1)]
    if not rows:
        return Section("phases", "Phases", render_paragraph("The plan has no phase for this kind of device."))
    caption = "Phases and their results"
    return Section("phases", "Phases", render_scrolled(render_table(_COLUMNS, rows, caption, "overview"), caption))


def render_phase_section(number: int, phase: PhaseRecord) -> Section:
    """Render the section of the page for one phase: findings, measurements, attachments and notes."""
    chip = f'<span class="chip status {phase.outcome}">{phase.outcome}</span>'
    manual = "" if phase.automatic else ", with an operator"
    is_skipped = phase.outcome is Outcome.SKIP
    parts = [] if is_skipped else [render_paragraph(f"{format_duration(phase.seconds)}{manual}", "small")]
    if phase.problem:
        parts.append(render_paragraph(escape_text(phase.problem), "problem"))
    if phase.findings:
        findings = sorted(phase.findings, key=lambda finding: -finding.severity)
        parts.append(render_bullets((_format_finding(finding) for finding in findings), "findings"))
    parts.append(render_measurements(phase.title, phase.measurements))
    parts.append(render_attachments(phase.attachments))
    if phase.notes:
        parts.append(render_bullets(map(escape_text, phase.notes), "notes"))
    return Section(f"phase-{number}", f"{escape_text(phase.title)} {chip}", "".join(parts))


def _format_finding(finding: Finding) -> str:
    """Format the HTML text of a fault that was found, with its place."""
    return f"<b>{escape_text(finding.fault)}</b>{format_inline_place(finding.place)} {escape_text(finding.text)}"


def _render_row(number: int, phase: PhaseRecord) -> tuple[str, ...]:
    """Render the HTML cells of one phase in the overview.

    They are the outcome, the numbers of limits, failures and findings, and the duration.
    """
    limited = [measurement for measurement in phase.measurements if measurement.limit is not None]
    failed = sum(measurement.outcome is Outcome.FAIL for measurement in limited)
    is_skipped = phase.outcome is Outcome.SKIP
    return (
        f'<a href="#phase-{number}">{escape_text(phase.title)}</a>',
        f'<b class="{phase.outcome}">{phase.outcome}</b>',
        ABSENT if is_skipped else f"{len(limited):,}",
        ABSENT if is_skipped else _format_count(failed),
        ABSENT if is_skipped else _format_count(len(phase.findings)),
        ABSENT if is_skipped else format_duration(phase.seconds),
    )


def _format_count(count: int) -> str:
    """Format the HTML text of a number of failures, bold unless it is 0."""
    return f'<b class="fail">{count:,}</b>' if count else "0"
