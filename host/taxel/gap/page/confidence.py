"""The line of confidence: the most probable causes with their probabilities as bars."""

from collections.abc import Mapping
from typing import Any, Final

from taxel.gap.calibration.calibration import NAMED_PROBABILITY, NO_GAP
from taxel.gap.page.bars import Axis, build_share_bar
from taxel.gap.page.text import format_probability, make_readable
from taxel.gap.report.checked_report import CheckedReport

MOST_CAUSES: Final = 4
"""Causes in one line of a wide page."""

MIN_SHOWN: Final = 0.05
"""Probability below which a cause shares one line with the others."""

_LABELS: Final[Mapping[str, str]] = {"unknown": "unknown cause", "no_gap": "no cause"}


def rank_causes(report: CheckedReport) -> list[tuple[str, float]]:
    """Return effects, "unknown" and "no_gap" with their probabilities, largest first; empty for a report of version 1,
    which has no probabilities.
    """
    table = report.verdict.optional("probabilities")
    if table is None:
        return []
    return sorted(((name, value.as_number()) for name, value in table.entries()), key=lambda pair: -pair[1])


def list_shown_causes(report: CheckedReport) -> list[tuple[str, float]]:
    """Return the causes that the line of confidence shows, with their probabilities, largest first.

    These are at most `MOST_CAUSES` causes with a probability of at least `MIN_SHOWN`, otherwise the most probable
    cause. The list is empty if the report has no probabilities, or if "no_gap" is most probable but the verdict is not
    "no gap" (too few sessions).
    """
    ranked = rank_causes(report)
    if ranked and ranked[0][0] == NO_GAP and not report.is_no_gap:
        return []
    shown = [pair for pair in ranked if pair[1] >= MIN_SHOWN][:MOST_CAUSES]
    return shown or ranked[:1]


def label_cause(name: str) -> str:
    """Return the name of a cause in words."""
    return _LABELS.get(name) or make_readable(name)


def build_confidence(report: CheckedReport) -> list[dict[str, Any]]:
    """Return the template variables of the line of confidence, one dictionary for each shown cause.

    The variables are label, bar, percentage, and whether the verdict names causes with this probability.
    """
    axis = Axis(0.0, 1.0)
    return [
        {
            "label": label_cause(name),
            "bar": build_share_bar(axis, value, value >= NAMED_PROBABILITY),
            "percent": format_probability(value),
            "is_named": value >= NAMED_PROBABILITY,
        }
        for name, value in list_shown_causes(report)
    ]
