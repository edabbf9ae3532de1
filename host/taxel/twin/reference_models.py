"""Null models of the twin, fitted to its reference: each contact is compared with the other contacts."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from taxel.signal.rest_level import RestLevel
from taxel.twin.live_session import LiveSession
from taxel.twin.null_model import fit_null_models
from taxel.twin.reference import Reference
from taxel.twin.schedule import Condition
from taxel.twin.statistics import Estimates, compute_contact_scores, compute_rest_scores, sum_over_places
from taxel.twin.steps import BINS
from taxel.twin.variance_factors import VarianceFactors


def make_rest_level(reference: Reference) -> RestLevel:
    """Create the tracked counts without contact of a new session.

    The loadings (response of each taxel to the drift of its board) are copied from the reference; the counts are
    unknown until the first step.
    """
    learnt = reference.rest_level
    return RestLevel(
        learnt.noise_variance,
        learnt.board,
        learnt.loading.copy(),
        learnt.loading_variance.copy(),
        settings=learnt.settings,
    )


def fit_reference_models(reference: Reference, progress: Callable[[int, int], None] | None = None) -> VarianceFactors:
    """Fit the null models and variance factors: each contact of the reference is compared with the other contacts.

    progress: called with the number of compared contacts and the number of all contacts.
    """
    samples: list[tuple[Condition | None, Estimates]] = []
    session_level: tuple[int, RestLevel] | None = None
    noise = reference.noise_level
    n = reference.taxels.n
    no_taxel = np.zeros(n, dtype=bool)
    for number, (session, step) in enumerate(reference.steps):
        if session_level is None or session_level[0] != session:
            session_level = (session, make_rest_level(reference))
        scores, _ = compute_rest_scores(step, session_level[1], noise.copy(), no_taxel)
        others = reference.leave_out(step)
        found = compute_contact_scores(step, others, LiveSession.start(np.zeros(BINS), n), no_taxel)
        scores.update(found[0] if found else {})
        condition = step.contact.condition if step.contact is not None else None
        samples.append((condition, sum_over_places(scores, reference)))
        if progress is not None:
            progress(number + 1, len(reference.steps))
    models = fit_null_models([estimates for _, estimates in samples], reference.places.level)
    return VarianceFactors.learn(samples, models, reference.places.level)
