"""Which effects these presses can tell apart, judged by the simulation alone: sensitivities and their angles.

What an effect does to the features is a vector v, each entry over what scatters there. Another effect with free
parameters spans a subspace about its plain case; so do the nuisances (how the frames of two recordings fell). The angle
between v and the nearest that the other can do, and the squared length of what it cannot do, say whether anybody could
tell the two apart on these presses.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
from scipy.linalg import solve_triangular
from scipy.linalg.lapack import dpstrf

from taxel.gap.effects.catalogue import LIKE
from taxel.gap.effects.effect import Effect
from taxel.gap.effects.latency import Latency
from taxel.gap.fitting.composite import CompositeModel, FittedEffect
from taxel.gap.fitting.cores import in_copies, in_threads
from taxel.gap.fitting.equations import Column, Problem, gradient_of, system_of
from taxel.gap.fitting.fit import fit, start_of, started
from taxel.gap.fitting.judge import REFITS, Judge
from taxel.types import FloatArray

EXCITED, CLEAR = 1.0, 25.0
"""Squared length of what an effect does, or of what sets it off from another: one and five standard deviations."""

NEAR_DEG: Final = 40.0
"""Angle below which the linear answer is checked by fitting the other effect in full."""

LEAST_PIVOT: Final = 1e-7
"""Of a scaled system, below which a column adds nothing to those before it."""

SAME_DEG: Final = 8.0
"""Angle (cosine 0.99) below which two effects look the same, however large they are: two models of one contact differ
by more."""


@dataclass(frozen=True)
class Similarity:
    """How well `other` can do what `name` does. degrees: of the angle between them. left: squared length of what it
    cannot do, in units of what scatters.
    """

    name: str
    other: str
    degrees: float
    left: float

    @property
    def is_confounded(self) -> bool:
        """Nobody could tell them apart here."""
        return _is_near(self.left, self.degrees)

    def to_json(self) -> dict[str, Any]:
        """For the report."""
        return {"effect": self.name, "other": self.other, "degrees": self.degrees, "left": self.left}


def identifiability(
    name: str,
    judge: Judge,
    forms: Mapping[str, Sequence[Effect]],
    likes: Sequence[Similarity],
    confounded: Mapping[str, Sequence[str]],
) -> str:
    """How well these presses tell an effect, whether it is there or not: the report page's words.

    confounded: what was found, and what cannot be told from it.
    """
    own = forms[name]
    if not own:  # what does not answer is seen wherever something was expected
        return "identifiable"
    possible = [form for form in own if not form.unavailable(judge.state)]
    if not possible:
        return "unavailable"
    most = max(seen(judge, form) for form in possible)
    if most < EXCITED:
        return "not_excited"
    if name in confounded or any(name in others for others in confounded.values()):
        return "confounded"
    if any(one.name == name and one.is_confounded for one in likes):
        return "confounded"
    return "weak" if most < CLEAR else "identifiable"


def seen(judge: Judge, effect: Effect) -> float:
    """Squared length of what a plain case of an effect does."""
    return _length2(judge, _plain(judge, effect))


def compute_similarities(
    judge: Judge, forms: Mapping[str, Sequence[Effect]], links: Sequence[FittedEffect] = ()
) -> list[Similarity]:
    """Of every effect against every other.

    forms: the catalogue. links: effects that were found, with their values; the others are taken in a plain case, in
    the form that is seen best. What was found is checked with full fits of what comes near it.
    """
    state = judge.state
    usable = {
        name: [form for form in (*own, *LIKE.get(name, ())) if not form.unavailable(state)]
        for name, own in forms.items()
    }
    nuisance = start_of(state, CompositeModel((started(state, Latency("hand")),))).columns
    own_spaces = in_threads(
        state,
        lambda own: [
            Subspace(judge, [*nuisance, *start_of(state, CompositeModel((_typical_link(judge, form),))).columns])
            for form in own
        ],
        usable.values(),
    )
    spaces = dict(zip(usable, own_spaces, strict=True))
    found = {link.effect.name: link for link in links}

    def rows_of(name: str) -> list[Similarity]:
        plain = [_plain(judge, form) for form in usable[name]]
        vector = _of_link(judge, found[name]) if name in found else max(plain, key=lambda v: _length2(judge, v))
        whole = _length2(judge, vector)
        if whole < EXCITED:
            return []
        rows = []
        for other, own in spaces.items():
            if other == name or not own:
                continue
            left = min(space.left(vector) for space in own)
            if name in found and _degrees(left, whole) < NEAR_DEG:
                left = min(left, *(_fitted_left(judge, vector, form) for form in usable[other]))
            rows.append(Similarity(name, other, _degrees(left, whole), left))
        return rows

    return [row for rows in in_copies(state, rows_of, [name for name, own in usable.items() if own]) for row in rows]


def is_confounded(left: float, whole: float) -> bool:
    """Whether nobody could tell apart what has a squared length `whole` from what can do all of it but `left`."""
    return _is_near(left, _degrees(left, whole))


def _is_near(left: float, degrees: float) -> bool:
    return left < CLEAR or degrees < SAME_DEG


def _degrees(left: float, whole: float) -> float:
    return float(np.degrees(np.arcsin(np.sqrt(np.clip(left / whole, 0.0, 1.0)))))


def _typical_link(judge: Judge, form: Effect) -> FittedEffect:
    return FittedEffect(form, form.typical(judge.state))


def _plain(judge: Judge, form: Effect) -> FloatArray:
    return _of_link(judge, _typical_link(judge, form))


def _of_link(judge: Judge, link: FittedEffect) -> FloatArray:
    return np.nan_to_num(CompositeModel((link,)).features(judge.state) - judge.state.mean)


def _length2(judge: Judge, vector: FloatArray) -> float:
    return float(np.sum(judge.weight * vector**2))


class Subspace:
    """What the blocks of some columns can do, on what a judge counts. Priors do not count: what could be is asked."""

    def __init__(self, judge: Judge, columns: Sequence[Column]) -> None:
        self._judge = judge
        self._columns = [replace(one, precision=0.0 * one.precision) for one in columns]
        system = system_of(Problem(judge.state, judge.state.mean, judge.weight), self._columns)
        self._scale = np.sqrt(np.maximum(np.diag(system), 1e-300))
        factor, order, rank, _ = dpstrf(system / np.outer(self._scale, self._scale), tol=LEAST_PIVOT, lower=1)
        self._factor, self._kept = factor[:rank, :rank], order[:rank] - 1

    def left(self, vector: FloatArray) -> float:
        """Squared length of what it leaves of a vector, f64[C, F, n]."""
        problem = Problem(self._judge.state, vector, self._judge.weight)
        gradient = gradient_of(problem, self._columns, np.zeros_like(vector)) / self._scale
        done = solve_triangular(self._factor, gradient[self._kept], lower=True, check_finite=False)
        return max(_length2(self._judge, vector) - float(done @ done), 0.0)


def linear_left(judge: Judge, vector: FloatArray, columns: Sequence[Column]) -> float:
    """Squared length of what a subspace leaves of a vector, for one that is asked once."""
    return Subspace(judge, columns).left(vector)


def _fitted_left(judge: Judge, vector: FloatArray, form: Effect) -> float:
    problem = Problem(judge.state, judge.state.mean + vector, judge.weight)
    return fit(problem, CompositeModel((started(judge.state, form),)), iterations=2 * REFITS).cost
