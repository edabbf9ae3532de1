"""The head of the page: the verdict, what to do about it, and which device was tested by whom."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

from taxel.gap.page.tables import bullets, folded
from taxel.gap.page.text import escaped, plural, words
from taxel_tools.testing.page.elements import placed
from taxel_tools.testing.page.figures import allowed, seconds_words, time_words, with_unit
from taxel_tools.testing.record import Finding, Measurement, Outcome, PhaseRecord, TestRecord

MOST_SHOWN = 10
"""Things to do that are shown at once."""

_VERDICTS = {
    Outcome.PASS: "passed",
    Outcome.FAIL: "failed",
    Outcome.ERROR: "could not be tested to the end",
    Outcome.SKIP: "was not tested",
}
_CHIPS = {Outcome.PASS: "Pass", Outcome.FAIL: "Fail", Outcome.ERROR: "Error", Outcome.SKIP: "Not tested"}
_COUNTED = {
    Outcome.PASS: "passed",
    Outcome.FAIL: "failed",
    Outcome.ERROR: "ended with an error",
    Outcome.SKIP: "skipped",
}


def title_of(record: TestRecord) -> str:
    """The verdict in one line, escaped."""
    who = escaped(record.serial_number) or "A device without serial number"
    found = record.findings()
    told = ""
    if found:
        told = f": {plural(len(found), 'fault')} found"
    if len(found) == 1:
        told = f": {escaped(found[0].fault)}" + (f" at {escaped(found[0].place)}" if found[0].place.strip() else "")
    return f"{who} {_VERDICTS[record.outcome]}{told}"


def header(record: TestRecord) -> str:
    """The head as an element."""
    counts = Counter(phase.outcome for phase in record.phases)
    told = [f"{plural(count, 'phase')} {_COUNTED[one]}" for one in _COUNTED if (count := counts[one])]
    chips = [f'<li class="chip status {record.outcome}">{_CHIPS[record.outcome]}</li>']
    chips += [f'<li class="chip">{one}</li>' for one in told]
    plan = f"<b>{escaped(record.plan_name)}</b>, version {escaped(record.plan_version)}"
    return (
        f'<header>\n<p class="eyebrow">Hardware test: {plan}</p>\n<h1>{title_of(record)}</h1>\n'
        f'<ul class="chips" aria-label="Verdict">{"".join(chips)}</ul>\n'
        f"{_to_do(record)}{_skipped(record)}{_identity(record)}</header>\n"
    )


def _to_do(record: TestRecord) -> str:
    things = list(_things(record))
    if not things:
        return ""
    more = ""
    if len(things) > MOST_SHOWN:
        rest = "".join(f"<li>{one}</li>" for one in things[MOST_SHOWN:])
        more = folded(f"{len(things) - MOST_SHOWN:,} more", f'<ol class="todo" start="{MOST_SHOWN + 1}">{rest}</ol>')
    return f"<h2>What to do</h2>{bullets(things[:MOST_SHOWN], 'todo', 'ol')}{more}\n"


def _things(record: TestRecord) -> Iterator[str]:
    """Findings first, then limits of phases without findings, then what ended with an error."""
    numbered = list(enumerate(record.phases, start=1))
    found = [(finding, number) for number, phase in numbered for finding in phase.findings]
    for finding, number in sorted(found, key=lambda pair: -pair[0].severity):
        yield _finding(finding, number)
    for number, phase in numbered:
        if not phase.findings:
            yield from _beyond(phase, number)
    for number, phase in numbered:
        if phase.problem:
            yield f"{_link(phase.title, number)} ended with an error: {escaped(phase.problem)}"


def _skipped(record: TestRecord) -> str:
    skipped = [
        f"{_link(phase.title, number)}: {escaped('; '.join(phase.notes)) or 'no reason given'}"
        for number, phase in enumerate(record.phases, start=1)
        if phase.outcome is Outcome.SKIP
    ]
    return f"<h2>Skipped</h2>{bullets(skipped, 'muted')}\n" if skipped else ""


def _finding(finding: Finding, number: int) -> str:
    fault = f'<a href="#phase-{number}"><b>{escaped(finding.fault)}</b></a>'
    return f"{fault}{placed(finding.place)} {escaped(finding.text)}"


def _beyond(phase: PhaseRecord, number: int) -> Iterator[str]:
    groups: dict[str, list[Measurement]] = {}
    for one in phase.measurements:
        if one.outcome is Outcome.FAIL:
            groups.setdefault(one.name, []).append(one)
    for name, group in groups.items():
        worst = max(group, key=lambda one: one.limit.severity(one.value) if one.limit else 0.0)
        place = f" at {escaped(worst.place)}" if worst.place else ""
        value = with_unit(worst.value, worst.unit, worst.limit)
        count = f"{plural(len(group), 'place')} beyond the limit, the worst" if len(group) > 1 else "beyond the limit:"
        link = f"{_link(phase.title, number)}, <b>{words(name)}</b>"
        yield f"{link}: {count} {value}{place} (allowed {allowed(worst.limit)})"


def _link(title: str, number: int) -> str:
    return f'<a href="#phase-{number}">{escaped(title)}</a>'


def _identity(record: TestRecord) -> str:
    entries = {
        "serial number": escaped(record.serial_number) or "none",
        **{words(key): escaped(value) for key, value in record.device.items()},
        "tested": time_words(record.started_utc),
        "duration": seconds_words(record.seconds),
        "operator": escaped(record.operator),
        "station": escaped(record.station),
        "software": escaped(record.software_version),
        "plan": f"{escaped(record.plan_name)}, version {escaped(record.plan_version)}",
        "plan's SHA-256": f"<code>{escaped(record.plan_sha256[:16])}...</code>",
    }
    items = "".join(f"<div><dt>{name}</dt><dd>{value}</dd></div>" for name, value in entries.items())
    return f'<dl class="identity">{items}</dl>\n'
