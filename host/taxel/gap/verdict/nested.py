"""Repeated comparison without each session, so that the selected effects are independent of the evaluated session."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

import numpy as np

from taxel.gap.calibration.calibration import UNKNOWN
from taxel.gap.comparison.compare import compare_sets
from taxel.gap.effects.catalogue import Forms
from taxel.gap.errors import GapInputError
from taxel.gap.fitting.composite import CompositeModel
from taxel.gap.fitting.fit_data import FitData
from taxel.gap.verdict.explanation import fit_explanation
from taxel.gap.verdict.verdict import list_causes

MIN_SESSIONS: Final = 4
"""Smallest number of sessions for `--nested`. Three sessions must remain for an estimate of the variance between
sessions."""


def select_composites_without_session(
    fit_data: FitData, forms: Forms, seed: int, progress: Callable[[int, int], None]
) -> tuple[CompositeModel, ...]:
    """Return for each session the fitted model of the effects that a comparison without this session names.

    seed: seed of the comparison. progress: called with the number of finished sessions and the number of sessions.
    Raises GapInputError if there are fewer than `MIN_SESSIONS` sessions.
    """
    count = fit_data.sessions.value.shape[1]
    if count < MIN_SESSIONS:
        expected = f"at least {MIN_SESSIONS} sessions"
        raise GapInputError("--nested", expected, str(count), "omit --nested, or record more sessions")
    composites = []
    for session in range(count):
        progress(session, count)
        other_sessions = fit_data.sessions.select_sessions(np.arange(count) != session)
        comparison = compare_sets(FitData(fit_data.state, other_sessions, fit_data.layout), forms, seed)
        causes = list_causes(comparison.compute_probabilities())
        composites.append(fit_explanation(comparison, [name for name in causes if name != UNKNOWN]).composite)
    progress(count, count)
    return tuple(composites)
