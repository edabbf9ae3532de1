"""The recommended action of a report: what to add to the simulator, and which contact to record next."""

import shlex
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from taxel.gap.page.effect_cards import format_parameters
from taxel.gap.page.glossary import DESCRIPTIONS
from taxel.gap.page.locations import format_effect_locations, format_location
from taxel.gap.page.text import clean_text, format_count, is_small, join_words, make_readable
from taxel.gap.report.checked_report import CheckedReport
from taxel.gap.report.report_values import ReportValue

REPORT_FILE: Final = "report.json"
"""The report beside its page."""

EXPORT_COMMAND: Final = "taxel gap export {report} --to python --out skin_effects.py"

PASTE_LINES: Final = (
    "from skin_effects import SkinEffects",
    "effects = SkinEffects()",
    "counts = effects.apply(time_s, counts, force)  # force: newtons or None",
)
"""Lines for the simulator: they import the exported module, make its state once, and change the counts of a frame."""

MIN_SESSIONS: Final = 3
"""Sessions that a verdict needs, as in `taxel.gap.verdict.verdict`, which a page does not import."""

LEAST_SHRINK: Final = 0.01
"""Shrink below which the page shows 0 %, so that a change of the simulator has no visible use."""

CONTACT_CHANGES: Final = frozenset({"pose_error"})
"""Effects that change the contact itself, so that no module can add them to the counts."""


@dataclass(frozen=True)
class Action:
    """What to do, for the page and the summary on a terminal.

    steps: sentences, most important first. command: shell command that writes the Python module which `lines`, the
    lines for the simulator, import; both are empty unless the named effects can be added to counts. next_contact:
    recommended contact with its reason; empty if there is none.
    """

    steps: tuple[str, ...]
    command: str = ""
    lines: tuple[str, ...] = ()
    next_contact: str = ""


def recommend_action(report: CheckedReport, report_file: str = REPORT_FILE) -> Action:
    """Return the action that follows from the number of sessions, the status, the named effects and the recommended
    measurements. Raises GapInputError for a missing or malformed field.

    report_file: path of the report in the shell command.
    """
    effects = [effect for effect in report.effects if effect.flag("in_verdict")]
    contact = _describe_next_contact(report)
    missing = MIN_SESSIONS - _count_sessions(report)
    if missing > 0 and not report.is_no_gap:
        more = format_count(missing, "more session")
        return Action((f"Record {more} with the same contacts, then diagnose again. Change nothing before.",))
    if report.is_no_gap:
        return Action((_describe_agreement(report),))
    if not effects:
        return Action(tuple(_advise_on_unknown(report, contact)), next_contact=contact)
    if report.root.field("inputs").flag("real_real"):
        names = join_words([make_readable(effect.text("name")) for effect in effects])
        return Action(
            (f"Use neither dataset in place of the other before {names} is corrected.",), next_contact=contact
        )
    if _is_ineffective(report):
        names = join_words([make_readable(effect.text("name")) for effect in effects])
        return Action(
            (f"Change nothing yet: {names} added to the simulator would not reduce the gap.",), "", (), contact
        )
    return _add_effects(report, effects, contact, EXPORT_COMMAND.format(report=shlex.quote(report_file)))


def _is_ineffective(report: CheckedReport) -> bool:
    """Return whether the named effects do not reduce the gap of held-out sessions.

    This is the case if the shrink is below `LEAST_SHRINK`, or if its 95 % interval is entirely at or below 0.
    """
    bounds, shrink = report.after.optional_interval("shrink_ci95"), report.after.optional_number("shrink")
    return (shrink is not None and shrink < LEAST_SHRINK) or (bounds is not None and bounds[1] <= 0.0)


def _count_sessions(report: CheckedReport) -> int:
    """Return the number of sessions of the real dataset; `MIN_SESSIONS` for a report without this number."""
    counts = report.root.optional("counts")
    real = counts.optional("real") if counts is not None else None
    value = real.optional("sessions") if real is not None else None
    return MIN_SESSIONS if value is None else value.as_integer(0, 10**9)


def _describe_next_contact(report: CheckedReport) -> str:
    """Return the first recommended contact with its reason; an empty string if the report recommends none."""
    measurements = report.root.optional_list("next_presses")
    if not measurements:
        return ""
    first = measurements[0]
    contact, why = clean_text(first.text("press")), clean_text(first.optional_text("why"))
    separated = join_words([make_readable(name) for name in first.texts("separates")])
    return f"{contact} ({why or f'separates {separated}'})"


def _describe_agreement(report: CheckedReport) -> str:
    """Return the action for a report without a gap: keep the simulator, or use either of two real datasets."""
    if report.root.field("inputs").flag("real_real"):
        return "Use either dataset in place of the other for contacts like the recorded ones."
    return "Keep the simulator as it is for contacts like the recorded ones."


def _advise_on_unknown(report: CheckedReport, contact: str) -> list[str]:
    """Return the steps, one sentence each, for a gap without a named effect.

    contact: recommended contact; empty if there is none. If effects are confounded (not distinguishable in these
    grasps), the step is a further contact; otherwise it is an inspection of the hardware.
    """
    if report.verdict.optional("confounded_with") is not None and report.verdict.field("confounded_with").table():
        decision = "Record the contact below" if contact else "Record further contacts"
        return [f"{decision}, which decides between the possible causes, then diagnose again. Change nothing before."]
    unexplained = report.root.field("unexplained")
    places = []
    if is_small(unexplained.optional_number("p_value")):
        places = [format_location(report, one) for one in unexplained.optional_list("where")[:2]]
    where = f" at {join_words(places)}" if places else ""
    return [
        f"Inspect the hardware{where}: no known effect explains the difference. Do not change the simulator yet.",
        "Describe the cause as an effect of your own, and diagnose again with --effects FILE, if you know the cause.",
    ]


def _add_effects(report: CheckedReport, effects: Sequence[ReportValue], contact: str, command: str) -> Action:
    """Return the action for named effects: steps for each effect, and the command that exports effects for the
    simulator.

    effects: entries of the named effects. contact: recommended contact; empty if there is none. command: shell command
    of the export, which is omitted if none of the effects can be added to counts.
    """
    names = [effect.text("name") for effect in effects]
    steps = [text for effect in effects if (text := _describe_special_step(report, effect))]
    added = [name for name in names if name in DESCRIPTIONS and name not in CONTACT_CHANGES]
    if added:
        what = join_words([make_readable(name) for name in added])
        steps.append(f"Add {what} to the simulator: run the command once, then paste the three lines.")
    return Action(tuple(steps), command if added else "", PASTE_LINES if added else (), contact)


def _describe_special_step(report: CheckedReport, effect: ReportValue) -> str:
    """Return the step for an effect that a change of the simulator's counts does not correct alone: a dropout, a pose
    error, or an effect of a user's file. The string is empty for all other effects.
    """
    name = effect.text("name")
    if name == "dropout":
        places = format_effect_locations(report, effect)
        return f"Repair the hardware if possible: {places}." if places else "Repair the dead parts if possible."
    if name == "pose_error":
        values = format_parameters(report, effect)
        return f"Correct the pose in the simulator: {values}." if values else "Correct the pose in the simulator."
    if name not in DESCRIPTIONS:
        return f"Add {make_readable(name)} with taxel gap apply and its --effects FILE: no module can contain its code."
    return ""
