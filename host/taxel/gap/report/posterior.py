"""What the presses leave open of the fitted values: draws from their posterior, linear about the fit.

A slide along a face, or a bracket that stands farther back, changes next to nothing that is recorded: fits without a
session or a press all end where the prior draws them, and would seem to know.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from scipy.linalg import cholesky, solve_triangular

from taxel.gap.effects.baseline_drift import BaselineDrift
from taxel.gap.effects.noise import Noise
from taxel.gap.fitting.composite import CompositeModel, FittedEffect
from taxel.gap.fitting.equations import system_of
from taxel.gap.fitting.fit import free_links, moved, start_of
from taxel.gap.fitting.judge import Judge

SCATTERS: Final = (Noise.name, BaselineDrift.name)
"""Effects that are variances: at zero such a one has no derivative, and how far it is known its sessions tell."""

DRAWS: Final = 400
SEED: Final = 20
"""Of the draws: a report is the same each time."""

JITTER: Final = 1e-9
"""Relative, on the diagonal: nothing is known better."""


def draws_of(judge: Judge, composite: CompositeModel, fixed: Sequence[str]) -> dict[str, list[FittedEffect]]:
    """Links as they may be as well, by the names of the effects but those in `fixed`. chain: fitted.

    Sessions scatter and a good simulator errs by so much as the judge's weights say, each feature for itself; a value
    of which nothing else is known lies somewhere within its bounds.
    """
    fixed = (*fixed, *SCATTERS)
    free = free_links(composite, fixed)
    if not free:
        return {}
    start = start_of(judge.state, composite, fixed)
    system = system_of(judge.problem(), start.columns)
    links = [composite.links[index] for index in free]
    within = [
        np.full(link.values.shape[1], (one.high - one.low) ** -2) for link in links for one in link.effect.parameters()
    ]
    system[np.diag_indices_from(system)] += np.concatenate(within)
    scale = np.sqrt(np.diag(system))
    scaled = system / np.outer(scale, scale)
    scaled[np.diag_indices_from(scaled)] += JITTER
    normal = np.random.default_rng(SEED).standard_normal((len(scaled), DRAWS))
    steps = solve_triangular(cholesky(scaled, lower=False, check_finite=False), normal) / scale[:, None]
    drawn = [moved(composite, free, step) for step in steps.T]
    return {composite.links[index].effect.name: [one.links[index] for one in drawn] for index in free}
