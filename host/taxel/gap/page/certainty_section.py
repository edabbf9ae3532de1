"""The certainty of the verdict: what supports it, reasons for doubt, decisive conditions, faulty grasps."""

from typing import Any

from taxel.gap.calibration.calibration import NAMED_PROBABILITY
from taxel.gap.page.cells import SectionData
from taxel.gap.page.confidence import label_cause, list_shown_causes, rank_causes
from taxel.gap.page.text import (
    SPACE,
    clean_text,
    format_counts,
    format_p_equation,
    format_percent,
    format_probability,
    format_shrink,
    format_shrink_interval,
    is_small,
    join_words,
    make_readable,
)
from taxel.gap.report.checked_report import CheckedReport


def build_certainty_section(report: CheckedReport) -> SectionData:
    """Return the section "Certainty". Raises GapInputError for a missing or malformed field."""
    shown = {name for name, _ in list_shown_causes(report)}
    context: dict[str, Any] = {
        "calibration": _describe_calibration(report),
        "support": list_support(report),
        "doubts": list_doubts(report),
        "small": join_words([label_cause(name) for name, _ in rank_causes(report) if name not in shown]),
        "influence": _describe_influence(report),
        "problems": [
            f"{clean_text(one.text('grasp'))}: {clean_text(one.text('problem'))} ({clean_text(one.text('handled'))})"
            for one in report.root.field("inputs").optional_list("problems")
        ],
    }
    return SectionData("certainty", "Certainty", "certainty", context)


def list_support(report: CheckedReport) -> list[str]:
    """Return the facts that support the verdict, one sentence each."""
    after, p = report.after, report.gap.optional_number("p_value")
    support = []
    if report.is_no_gap:
        if (bound := report.gap.optional_number("bound")) is not None:
            size = format_counts(bound)
            support.append(f"A difference above the floor of more than {size} is improbable (5{SPACE}%).")
        return support
    if is_small(p):
        support.append(f"The gap is hardly due to chance ({format_p_equation(p)}).")
    if report.named_effects:
        bounds = after.optional_interval("shrink_ci95")
        interval = f" (95{SPACE}% interval {format_shrink_interval(bounds)})" if bounds else ""
        shrink = format_shrink(after.optional_number("shrink"))
        support.append(f"The gap shrinks by {shrink}{interval} in sessions that were not used for the fit.")
    return [*support, *describe_repeated_searches(report)]


def describe_repeated_searches(report: CheckedReport) -> list[str]:
    """Return a sentence that states how many searches without one session find the same effects as the search with all
    sessions. The list has one sentence; it is empty if no searches without a session were made.

    The cause "unknown" is not compared: it stands for an unexplained part of the gap, and a search does not return it.
    """
    searches = report.after.optional_list("chosen_inside")
    if not searches:
        return []
    names = set(report.verdict.texts("effects")) - {"unknown"}
    agreeing = sum({name.as_text() for name in search.items()} == names for search in searches)
    return [f"{agreeing} of {len(searches)} searches without one session find the same effects."]


def list_doubts(report: CheckedReport) -> list[str]:
    """Return the reasons for doubt, one sentence each: the reasons in the verdict, results of significance tests, and
    effects that these contacts do not distinguish from a named effect.
    """
    doubts = [_as_sentence(text) for text in report.verdict.texts("reasons")]
    if report.named_effects:
        p, rest = report.gap.optional_number("p_value"), report.root.field("unexplained").optional_number("p_value")
        if p is not None and not is_small(p):
            doubts.append(f"The mean over all sessions shows no significant gap ({format_p_equation(p)}).")
        if is_small(rest):
            doubts.append(f"A part of the gap is not explained ({format_p_equation(rest)}).")
    table = report.verdict.optional("confounded_with")
    for name, value in table.entries() if table is not None else ():
        others = [make_readable(other.as_text()) for other in value.items()]
        if others:
            doubts.append(f"These contacts do not distinguish {make_readable(name)} from {join_words(others, 'or')}.")
    return doubts


def _as_sentence(text: str) -> str:
    """Return a text with a capital letter at its beginning and a full stop at its end."""
    clean = clean_text(text)
    return f"{clean[:1].upper()}{clean[1:]}" + ("" if clean.endswith((".", "!", "?")) else ".")


def _describe_calibration(report: CheckedReport) -> str:
    """Return a sentence that explains the largest probability; an empty string if the report has no probabilities or if
    none of them reaches `NAMED_PROBABILITY`.
    """
    ranked = rank_causes(report)
    if not ranked or ranked[0][1] < NAMED_PROBABILITY:
        return ""
    percent = format_probability(ranked[0][1])
    return f"Of all statements with a probability of {percent}, {percent} are true."


def _describe_influence(report: CheckedReport) -> list[str]:
    """Return for each named effect a text with the conditions that contribute most of its evidence, with shares."""
    shares: dict[str, list[str]] = {}
    for entry in report.root.optional_list("influence"):
        place = f"{clean_text(entry.text('object'))} {clean_text(entry.text('approach'))}"
        text = f"{make_readable(place)} ({format_percent(entry.number('share'))})"
        shares.setdefault(entry.text("effect"), []).append(text)
    return [f"{make_readable(name)}: {', '.join(texts)}" for name, texts in shares.items()]
