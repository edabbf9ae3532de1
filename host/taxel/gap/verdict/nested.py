"""The comparison once more without each session: what it chooses is independent of the session that evaluates it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

import numpy as np

from taxel.gap.calibration.calibration import UNKNOWN
from taxel.gap.comparison.compare import compare_sets
from taxel.gap.effects.catalogue import Forms
from taxel.gap.errors import GapInputError
from taxel.gap.fitting.composite import CompositeModel
from taxel.gap.fitting.judge import Judge
from taxel.gap.verdict.explanation import explain
from taxel.gap.verdict.verdict import list_causes

MIN_SESSIONS: Final = 4
"""Three sessions must remain for a variance between sessions."""


def choose_without_sessions(
    judge: Judge, forms: Forms, seed: int, progress: Callable[[int, int], None]
) -> tuple[CompositeModel, ...]:
    """The named effects without each session in turn, as fitted chains. Raises GapInputError for too few sessions."""
    count = judge.sessions.value.shape[1]
    if count < MIN_SESSIONS:
        expected = f"at least {MIN_SESSIONS} sessions"
        raise GapInputError("--nested", expected, str(count), "omit --nested, or record more sessions")
    composites = []
    for session in range(count):
        progress(session, count)
        rest = judge.sessions.only(np.arange(count) != session)
        comparison = compare_sets(Judge(judge.state, rest, judge.layout), forms, seed)
        causes = list_causes(comparison.compute_probabilities())
        composites.append(explain(comparison, [name for name in causes if name != UNKNOWN]).composite)
    progress(count, count)
    return tuple(composites)
