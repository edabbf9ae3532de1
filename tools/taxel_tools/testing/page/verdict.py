"""Header of the page: the verdict, the problems to fix, and the identity of device, operator and station."""

from collections import Counter
from collections.abc import Iterator

from taxel.gap.page.text import format_count
from taxel_tools.testing.page.elements import format_inline_place
from taxel_tools.testing.page.figures import format_duration, format_limit, format_time, format_with_unit
from taxel_tools.testing.page.html_text import escape_name, escape_text, render_bullets, render_folded
from taxel_tools.testing.record import Finding, Measurement, Outcome, PhaseRecord, TestRecord

SHOWN_MAX = 10
"""Number of problems that are not folded."""

_VERDICTS = {
    Outcome.PASS: "passed",
    Outcome.FAIL: "failed",
    Outcome.ERROR: "could not be tested completely",
    Outcome.SKIP: "was not tested",
}
_CHIPS = {Outcome.PASS: "Pass", Outcome.FAIL: "Fail", Outcome.ERROR: "Error", Outcome.SKIP: "Not tested"}
_PHASE_SUMMARIES = {
    Outcome.PASS: "passed",
    Outcome.FAIL: "failed",
    Outcome.ERROR: "ended with an error",
    Outcome.SKIP: "skipped",
}


def format_title(record: TestRecord) -> str:
    """Format the title of the page in one line of HTML: the device and the outcome of the test."""
    device = escape_text(record.serial_number) or "A device without serial number"
    findings = record.findings()
    fault_text = ""
    if findings:
        fault_text = f": {format_count(len(findings), 'fault')} found"
    if len(findings) == 1:
        place = escape_text(findings[0].place)
        fault_text = f": {escape_text(findings[0].fault)}" + (f" at {place}" if place.strip() else "")
    return f"{device} {_VERDICTS[record.outcome]}{fault_text}"


def render_header(record: TestRecord) -> str:
    """Render the header of the page as an HTML element: verdict, device, and what to do."""
    counts = Counter(phase.outcome for phase in record.phases)
    summaries = [
        f"{format_count(count, 'phase')} {text}"
        for outcome, text in _PHASE_SUMMARIES.items()
        if (count := counts[outcome])
    ]
    chips = [f'<li class="chip status {record.outcome}">{_CHIPS[record.outcome]}</li>']
    chips += [f'<li class="chip">{summary}</li>' for summary in summaries]
    plan = f"<b>{escape_text(record.plan_name)}</b>, version {escape_text(record.plan_version)}"
    return (
        f'<header>\n<p class="eyebrow">Hardware test: {plan}</p>\n<h1>{format_title(record)}</h1>\n'
        f'<ul class="chips" aria-label="Verdict">{"".join(chips)}</ul>\n'
        f"{_render_to_do_list(record)}{_render_skipped_list(record)}{_render_identity_list(record)}</header>\n"
    )


def _render_to_do_list(record: TestRecord) -> str:
    """Render the HTML list of a test's problems with their remedies; those beyond `SHOWN_MAX` can be unfolded."""
    problems = list(_list_problems(record))
    if not problems:
        return ""
    details = ""
    if len(problems) > SHOWN_MAX:
        items = "".join(f"<li>{problem}</li>" for problem in problems[SHOWN_MAX:])
        hidden_list = f'<ol class="todo" start="{SHOWN_MAX + 1}">{items}</ol>'
        details = render_folded(f"{len(problems) - SHOWN_MAX:,} more", hidden_list)
    return f"<h2>What to do</h2>{render_bullets(problems[:SHOWN_MAX], 'todo', 'ol')}{details}\n"


def _list_problems(record: TestRecord) -> Iterator[str]:
    """Yield the HTML sentences on the problems of a test.

    Findings first, then violated limits of phases without findings, then errors of phases.
    """
    numbered = list(enumerate(record.phases, start=1))
    findings = [(finding, number) for number, phase in numbered for finding in phase.findings]
    for finding, number in sorted(findings, key=lambda pair: -pair[0].severity):
        yield _format_finding(finding, number)
    for number, phase in numbered:
        if not phase.findings:
            yield from _render_violated_limits(phase, number)
    for number, phase in numbered:
        if phase.problem:
            yield f"{_format_link(phase.title, number)} ended with an error: {escape_text(phase.problem)}"


def _render_skipped_list(record: TestRecord) -> str:
    """Render the HTML list of the phases that were skipped, each with the reason; empty text if there are none."""
    skipped = [
        f"{_format_link(phase.title, number)}: {escape_text('; '.join(phase.notes)) or 'no reason given'}"
        for number, phase in enumerate(record.phases, start=1)
        if phase.outcome is Outcome.SKIP
    ]
    return f"<h2>Skipped</h2>{render_bullets(skipped, 'muted')}\n" if skipped else ""


def _format_finding(finding: Finding, number: int) -> str:
    """Format the HTML text of a fault that was found, with a link to the phase `number` of the report."""
    fault = f'<a href="#phase-{number}"><b>{escape_text(finding.fault)}</b></a>'
    return f"{fault}{format_inline_place(finding.place)} {escape_text(finding.text)}"


def _render_violated_limits(phase: PhaseRecord, number: int) -> Iterator[str]:
    """Yield one HTML sentence for each measurement of a phase beyond its limit, with the worst value."""
    groups: dict[str, list[Measurement]] = {}
    for measurement in phase.measurements:
        if measurement.outcome is Outcome.FAIL:
            groups.setdefault(measurement.name, []).append(measurement)
    for name, group in groups.items():
        worst = max(group, key=_compute_severity)
        place = f" at {escape_text(worst.place)}" if worst.place else ""
        value = format_with_unit(worst.value, worst.unit, worst.limit)
        count = (
            f"{format_count(len(group), 'place')} beyond the limit, the worst"
            if len(group) > 1
            else "beyond the limit:"
        )
        link = f"{_format_link(phase.title, number)}, <b>{escape_name(name)}</b>"
        yield f"{link}: {count} {value}{place} (allowed {format_limit(worst.limit)})"


def _compute_severity(measurement: Measurement) -> float:
    """Compute the factor by which a measurement exceeds its limit; 0 without a limit."""
    return measurement.limit.severity(measurement.value) if measurement.limit else 0.0


def _format_link(title: str, number: int) -> str:
    """Format the HTML link to the section of phase `number` in the page."""
    return f'<a href="#phase-{number}">{escape_text(title)}</a>'


def _render_identity_list(record: TestRecord) -> str:
    """Render the HTML list with the labels of a test: board, operator, station, plan and software."""
    entries = {
        "serial number": escape_text(record.serial_number) or "none",
        **{escape_name(key): escape_text(value) for key, value in record.device.items()},
        "tested": format_time(record.started_utc),
        "duration": format_duration(record.seconds),
        "operator": escape_text(record.operator),
        "station": escape_text(record.station),
        "software": escape_text(record.software_version),
        "plan": f"{escape_text(record.plan_name)}, version {escape_text(record.plan_version)}",
        "plan's SHA-256": f"<code>{escape_text(record.plan_sha256[:16])}...</code>",
    }
    items = "".join(f"<div><dt>{name}</dt><dd>{value}</dd></div>" for name, value in entries.items())
    return f'<dl class="identity">{items}</dl>\n'
