"""Strict measures of a diagnosis from its probabilities and the hidden causes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from taxel.blind.hidden import UNKNOWN
from taxel.gap.calibration.calibration import NAMED_PROBABILITY, NO_GAP
from taxel.gap.verdict.verdict import list_causes
from taxel.types import FloatArray

CONFIDENT: Final = 0.8
"""Probability from which the statement that a cause is present is treated as confident (gap report, version 2)."""

BINS: Final = 10
"""Number of bins of the reliability diagram."""

SMALLEST: Final = 1e-4
"""Smallest probability in the log score; probabilities are clipped to this value and to one minus this value."""


@dataclass(frozen=True)
class ScoredAnswer:
    """The answer of a diagnosis for one world, with the truth.

    truth: names of the hidden causes; empty: none. kind, family: kind and family of the world. probabilities:
    probability of each cause in the answer. ratio: gap of the world divided by its floor. seconds: run time of the
    diagnosis.
    """

    truth: frozenset[str]
    kind: str
    family: str
    probabilities: Mapping[str, float]
    ratio: float
    seconds: float

    @property
    def causes(self) -> list[str]:
        """Causes in the answer in order of descending probability, without "no_gap"."""
        names = [name for name in self.probabilities if name != NO_GAP]
        return sorted(names, key=lambda name: -self.probabilities[name])

    @property
    def probable(self) -> frozenset[str]:
        """Causes with a probability of at least `NAMED_PROBABILITY`."""
        return frozenset(name for name in self.causes if self.probabilities[name] >= NAMED_PROBABILITY)

    @property
    def listed(self) -> frozenset[str]:
        """Causes that the verdict names (`taxel.gap.verdict.verdict.list_causes`); none for an empty answer."""
        return frozenset(list_causes({NO_GAP: 0.0, **self.probabilities})) if self.causes else frozenset()


def score_answers(answers: Sequence[ScoredAnswer]) -> dict[str, Any]:
    """Compute all measures of one diagnosis by name (docs/gap-benchmark.md); a measure without worlds is None.

    Clear worlds have a gap of at least two floors. `ScoredAnswer.causes` are the named causes in order of descending
    probability, and `ScoredAnswer.listed` those that the verdict names.
    """
    clear = [one for one in answers if one.ratio >= 2.0]
    weak = [one for one in answers if 1.0 <= one.ratio < 2.0 and one.kind == "single"]
    single = [one for one in clear if one.kind == "single"]
    several = [one for one in clear if one.kind == "several"]
    outside = [one for one in clear if one.kind == "outside"]
    none = [one for one in answers if one.kind == "none"]
    confident = [(one, name) for one in answers for name in one.causes if one.probabilities[name] >= CONFIDENT]
    probability, is_true = _collect_statements(answers)
    return {
        "worlds": len(answers),
        "clear": len(clear),
        "single: named first": _share([bool(one.causes[:1]) and one.causes[0] in one.truth for one in single]),
        "single: exact set": _share([one.listed == one.truth for one in single]),
        "several: micro-F1": _compute_f1(several),
        "several: exact set": _share([one.listed == one.truth for one in several]),
        "gap of 1 to 2 floors: named first or second": _share([bool(one.truth & set(one.causes[:2])) for one in weak]),
        "none: any cause at 0.5": _share([bool(one.probable) for one in none]),
        "outside: unknown listed": _share([UNKNOWN in one.listed for one in outside]),
        "outside: unknown alone": _share([one.listed == {UNKNOWN} for one in outside]),
        "outside: effect at 0.8": _share(
            [any(one.probabilities[name] >= CONFIDENT for name in one.causes if name != UNKNOWN) for one in outside]
        ),
        "statements at 0.8": len(confident),
        "wrong at 0.8": _share([name not in one.truth for one, name in confident]),
        "calibration error": _compute_calibration_error(probability, is_true),
        "Brier score": float(np.mean((probability - is_true) ** 2)) if len(probability) else None,
        "log score": _compute_log_score(probability, is_true),
        "seconds, median": float(np.median([one.seconds for one in answers])) if answers else None,
    }


def _share(values: Sequence[bool]) -> float | None:
    """Compute the share of true values; None without values."""
    return float(np.mean(values)) if values else None


def _compute_f1(answers: Sequence[ScoredAnswer]) -> float | None:
    """Compute the micro-averaged F1 of the causes that the verdicts name; None without answers."""
    hits = sum(len(one.listed & one.truth) for one in answers)
    total = sum(len(one.listed) + len(one.truth) for one in answers)
    return 2.0 * hits / total if total else None


def _collect_statements(answers: Sequence[ScoredAnswer]) -> tuple[FloatArray, FloatArray]:
    """Return the probabilities of all statements "X is a cause" in all answers, and whether each is true (1) or not
    (0).

    X: every cause that occurs in an answer or in a truth; a cause that an answer does not contain has probability 0.
    """
    names = sorted({name for one in answers for name in (*one.causes, *one.truth)})
    pairs = [(one.probabilities.get(name, 0.0), name in one.truth) for one in answers for name in names]
    probability, is_true = np.array(pairs, np.float64).reshape(-1, 2).T
    return probability, is_true


def _compute_calibration_error(probability: FloatArray, is_true: FloatArray) -> float | None:
    """Compute the expected calibration error in `BINS` bins of equal width (Naeini et al. 2015); None without
    statements.
    """
    if not len(probability):
        return None
    number = np.minimum((probability * BINS).astype(int), BINS - 1)
    error = 0.0
    for index in np.unique(number):
        in_bin = number == index
        error += in_bin.mean() * abs(float(probability[in_bin].mean() - is_true[in_bin].mean()))
    return float(error)


def _compute_log_score(probability: FloatArray, is_true: FloatArray) -> float | None:
    """Compute the mean log probability that was assigned to the true outcome; None without statements."""
    if not len(probability):
        return None
    limited = probability.clip(SMALLEST, 1.0 - SMALLEST)
    return float(np.mean(is_true * np.log(limited) + (1.0 - is_true) * np.log1p(-limited)))
