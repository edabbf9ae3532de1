"""Sets of effects, screened by linearised sensitivities: which two or three together could do most.

A search that adds one effect after another begins with the one that does most alone, and that may be a stranger which
resembles the sum of two. What a set could explain is worked out from derivatives alone, so that all pairs can be tried.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Final

import numpy as np

from taxel.gap.chain import Chain, FittedEffect
from taxel.gap.effects.effect import Effect
from taxel.gap.equations import Column
from taxel.gap.fit import start_of
from taxel.gap.identify import linear_left
from taxel.gap.judge import Judge

BEST_PAIRS: Final = 4
"""Pairs to which a third effect is added."""


@dataclass(frozen=True, eq=False)
class Screened:
    """A set of effects. left: share of the squared residual that no values of theirs could explain. forms: in which."""

    names: frozenset[str]
    left: float
    forms: tuple[Effect, ...]


def screened(judge: Judge, forms: Mapping[str, Sequence[Effect]]) -> list[Screened]:
    """All pairs, and triples of the best pairs, best first; of each effect the form that could do most alone."""
    target = np.where(judge.weight > 0, judge.target - judge.state.mean, 0.0)
    whole = float(np.sum(judge.weight * target**2))
    if whole <= 0:
        return []
    best: dict[str, tuple[Effect, tuple[Column, ...]]] = {}
    for name, own in forms.items():
        usable = [form for form in own if not form.unavailable(judge.state)]
        if usable:
            columns = {form: _columns(judge, form) for form in usable}
            form = min(usable, key=lambda one: linear_left(judge, target, columns[one]))
            best[name] = form, columns[form]

    def of(names: tuple[str, ...]) -> Screened:
        left = linear_left(judge, target, [column for name in names for column in best[name][1]])
        return Screened(frozenset(names), left / whole, tuple(best[name][0] for name in names))

    pairs = sorted((of(names) for names in combinations(best, 2)), key=lambda one: one.left)
    triples = {
        one.names | {name}: tuple(sorted(one.names | {name}))
        for one in pairs[:BEST_PAIRS]
        for name in best
        if name not in one.names
    }
    return sorted([*pairs, *(of(names) for names in triples.values())], key=lambda one: one.left)


def _columns(judge: Judge, form: Effect) -> tuple[Column, ...]:
    """Derivatives about a plain case, and what that does itself: most effects are far from linear at nothing."""
    start = start_of(judge.state, Chain((FittedEffect(form, form.typical(judge.state)),)))
    done = np.nan_to_num(start.features - judge.state.mean)
    itself = Column(done, np.zeros(done.shape[::2], np.intp), 1, np.zeros(1))
    return (*start.columns, itself)
