"""One round of the search: which further effect gains most on cells that were left out, and whether that counts."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
from numpy.typing import NDArray

from taxel.gap.catalogue import DROPOUT
from taxel.gap.chain import Chain, Link
from taxel.gap.cores import in_copies
from taxel.gap.dropped import find_dropped
from taxel.gap.effects.baseline_drift import BaselineDrift
from taxel.gap.effects.dropout import Dropout
from taxel.gap.effects.effect import HAND, Effect
from taxel.gap.effects.noise import Noise
from taxel.gap.fit import ITERATIONS, started
from taxel.gap.judge import Judge, Score
from taxel.gap.trial import LEVEL, Round, Trial

Array = NDArray[np.float64]

SHORTLIST: Final = 4
"""Forms that are cross-validated in a round: those that gain most where they were fitted."""

GLANCE: Final = 4
"""Iterations of the fits that make the short list."""

SECOND_LOOK: Final = 3.0
"""Squared floors above which what is left may hide an effect that the earlier ones have taken for their own: it is
looked for once more, while they are fitted with it.
"""

LEAST_SHARE: Final = 0.03
"""Of the whole score, and of the excess in counts^2, that the first effect must explain to be named."""

NEXT_SHARE: Final = 0.05
"""The same for a further one: what the first one's form leaves is no effect of its own."""

MOST_OF_LEFT: Final = 0.55
"""Share of what the effects before have left, from which on a further one counts however small it is beside them."""

PLAIN_LEVEL: Final = 0.05
"""Level that will do for such a one: with four sessions even what is plain hardly comes below the other."""

PLAIN_SHARE: Final = 0.4
"""Share of the whole score that an effect explains on left-out cells, from which on counts^2 are not asked for: they
hang on the few taxels that are pressed hardest."""

PLAIN_BESIDE: Final = 0.2
"""The same beside another effect, if it also does most of what that has left where they were fitted."""

PLAIN_FLOORS: Final = 2.0
"""Squared floors that an effect takes from the gap, from which on it is material however large the gap is."""

SIMPLER: Final = 0.01
"""Share of the whole score by which a form with values for each board or taxel must be better than one for the hand."""

FIXED: Final = (DROPOUT,)
"""Links that are found, not fitted with the others."""

Forms = Mapping[str, tuple[Effect, ...]]


@dataclass(frozen=True, eq=False)
class Standing:
    """Where a search stands. judge: of what is still open. chain: found so far; features: with it, where it was
    fitted; held: on left-out cells; base: score of these; start: score without anything; parts: fits without each part.
    """

    judge: Judge
    chain: Chain
    features: Array
    held: Array
    base: Score
    start: Score
    parts: tuple[Chain, ...] = ()

    @staticmethod
    def of(judge: Judge) -> Standing:
        """Nothing was found yet."""
        start, mean = judge.score(judge.state.mean), judge.state.mean
        return Standing(judge, Chain(), mean, mean, start, start)

    @cached_property
    def fitted(self) -> Score:
        """Of `features`: where the chain was fitted."""
        return self.judge.score(self.features)

    def after(self, found: Trial) -> Standing:
        """One effect more. What does not answer says nothing of other effects, and is so large that they would look
        small beside it: from here on the rest alone is judged.
        """
        assert found.held is not None
        assert found.held_features is not None
        judge, start, base = self.judge, self.start, found.held
        if found.name == DROPOUT:
            alone = Chain(tuple(link for link in found.chain.links if link.effect.name == DROPOUT))
            judge = judge.without(alone.features(judge.state) != judge.state.mean)
            start, base = judge.score(judge.state.mean), judge.score(found.held_features)
        return Standing(judge, found.chain, found.features, found.held_features, base, start, found.parts)


def next_round(standing: Standing, forms: Forms) -> Round:
    """Try every effect that was not found yet. forms: the catalogue."""
    chain, judge = standing.chain, standing.judge
    found = _round(standing, forms, (*FIXED, *chain.names))
    fitted = set(chain.names) - set(FIXED)
    if found.accepted or not fitted or judge.excess(standing.features) <= SECOND_LOOK * judge.floor2:
        return found
    again = _round(standing, forms, FIXED)
    if not again.accepted or again.best is None or _most_gone(standing, again.best) <= MOST_OF_LEFT:
        return found
    return again


def _round(standing: Standing, forms: Forms, fixed: tuple[str, ...]) -> Round:
    """fixed: effects that keep their values while the short list is made."""
    judge, base, start = standing.judge, standing.base, standing.start
    least, noticeable = (NEXT_SHARE, judge.noticeable) if standing.chain.links else (LEAST_SHARE, np.zeros(5))
    # The longest first: nobody waits for it at the end.
    jobs = sorted(_jobs(standing, forms), key=lambda job: -job[1].values.size)
    trials = in_copies(judge.state, lambda job: _glanced(judge, job[0], standing.chain, job[1], fixed), jobs)
    trials = [trial for trial in trials if not trial.link.effect.is_idle(judge.state, trial.link.values)]
    trials.sort(key=lambda trial: trial.inside.value)
    worthy = [
        trial
        for trial in trials
        if trial.inside.share_of(start, base, noticeable) > 0.5 * least
        or trial.inside.gone_of(standing.fitted) > MOST_OF_LEFT
    ]
    # What does not answer is found by looking, not by a fit that could beat others: it is always weighed.
    chosen = worthy[:SHORTLIST] + [trial for trial in worthy[SHORTLIST:] if trial.name == DROPOUT]
    held = in_copies(judge.state, lambda trial: cross_validated(judge, tried(judge, trial.name, trial.chain)), chosen)
    every = held + [trial for trial in trials if trial not in chosen]
    best_of = _best_forms(every, SIMPLER * start.value)
    known = (trial for trial in best_of.values() if trial.held is not None)
    ranked = sorted(known, key=lambda trial: (not _is_evident(trial), *_rank(trial)))
    names_tried = len({trial.name for trial in held})
    found = Round(base, tuple(best_of.values()), None, 0.0, 1.0, False)
    for place, trial in enumerate(ranked):
        assert trial.held is not None
        gain, p_value = trial.held.better_than(base)
        p_value = min(1.0, p_value * names_tried)
        share = trial.held.share_of(start, base, noticeable)
        level = PLAIN_LEVEL if trial.held.gone_of(base) > MOST_OF_LEFT else LEVEL
        worth_it = p_value < level and (share > least or _most_gone(standing, trial) > MOST_OF_LEFT)
        accepted = worth_it and _is_material(standing, trial, least, gain / start.value)
        if place == 0 or accepted:
            found = Round(base, tuple(best_of.values()), trial, gain, p_value, accepted)
        if accepted:
            break
    return found


def _jobs(standing: Standing, forms: Forms) -> list[tuple[str, Link]]:
    """Effects at the values where their search begins."""
    judge = standing.judge
    jobs: list[tuple[str, Link]] = []
    for name in forms:
        if name in standing.chain.names:
            continue
        if name == DROPOUT:
            dropped = find_dropped(judge.state, judge.sessions, standing.features)
            if dropped.found:
                effect = Dropout(dropped)
                jobs.append((name, Link(effect, effect.found_values(judge.state))))
            continue
        jobs += [(name, started(judge.state, form)) for form in forms[name] if not form.unavailable(judge.state)]
    return jobs


def _is_material(standing: Standing, trial: Trial, least: float, gain: float) -> bool:
    """Whether an effect takes counts from the gap, not only from what scatters least; or so much that it need not."""
    assert trial.held is not None
    judge = standing.judge
    large = not judge.is_partial or bool((standing.base.families - trial.held.families > judge.noticeable).any())
    if trial.name == DROPOUT or (large and gain > PLAIN_SHARE):
        return True
    if standing.chain.links and _is_plain_beside(standing, trial):
        return True
    counts2 = min(before - after for before, after in _excesses(standing, trial))
    # What is noise in the gap is no measure of an effect on drops: it must not hide what else is there.
    noise = Chain(tuple(link for link in standing.chain.links if link.effect.name == Noise.name))
    whole = max(judge.excess(noise.features(judge.state)), judge.floor2)
    enough = min(least * whole, PLAIN_FLOORS * judge.floor2)
    # Beside what does not answer the rest is a gap of its own: what would be none alone is none here.
    return counts2 > (max(enough, judge.floor2) if judge.is_partial else enough)


def _excesses(standing: Standing, trial: Trial) -> tuple[tuple[float, float], ...]:
    """Counts^2 before and after, both where it was not fitted and where it was: a model with a value for each taxel may
    leave much of the first to another, and nothing of the second.
    """
    assert trial.held_features is not None
    pairs = ((standing.held, trial.held_features), (standing.features, trial.features))
    return tuple((standing.judge.excess(before), standing.judge.excess(after)) for before, after in pairs)


def _most_gone(standing: Standing, trial: Trial) -> float:
    """Share of what the earlier effects have left that is gone with this one, of the score or of counts^2, whichever is
    more; the second where they have left many: beside a proximity of thousands of standard deviations, counts are what
    still tells.
    """
    assert trial.held is not None
    least = SECOND_LOOK * standing.judge.floor2
    counts2 = min(1.0 - after / before if before > least else 0.0 for before, after in _excesses(standing, trial))
    return max(trial.held.gone_of(standing.base), counts2)


def _is_plain_beside(standing: Standing, trial: Trial) -> bool:
    """Whether an effect does much of what the earlier ones have left, both where it was fitted and where not."""
    assert trial.held is not None
    inside = trial.inside.gone_of(standing.fitted)
    whole = (standing.base.value - trial.held.value) / standing.start.value
    return inside > MOST_OF_LEFT and whole > PLAIN_BESIDE


def _best_forms(trials: list[Trial], worth: float) -> dict[str, Trial]:
    """Each effect's best form: one for the whole hand, unless another is better by `worth`."""
    best: dict[str, Trial] = {}
    for trial in sorted(trials, key=_rank):
        first = best.setdefault(trial.name, trial)
        known = (trial.held is None) == (first.held is None)
        simpler = trial.link.effect.scope == HAND != first.link.effect.scope
        if known and simpler and _rank(trial)[1] - _rank(first)[1] < worth:
            best[trial.name] = trial
    return best


def _is_evident(trial: Trial) -> bool:
    """Whether it says of a line that it is broken, and that is seen: a value for each taxel would fit that as well, and
    more, and afterwards nobody would look for it.
    """
    effect = trial.link.effect
    return isinstance(effect, Dropout) and effect.dropped.evident


def _rank(trial: Trial) -> tuple[bool, float]:
    """Those that were cross-validated first."""
    return (trial.held is None, trial.inside.value if trial.held is None else trial.held.value)


def tried(judge: Judge, name: str, chain: Chain, iterations: int = ITERATIONS) -> Trial:
    """A chain with all its effects fitted, as a trial of one of them."""
    fitted = judge.in_sample(chain, FIXED, iterations)
    return Trial(name, fitted.chain, fitted.features, judge.score(fitted.features))


def _glanced(judge: Judge, name: str, chain: Chain, link: Link, fixed: tuple[str, ...]) -> Trial:
    """One more effect, after a few iterations."""
    fitted = judge.in_sample(chain.with_link(link), fixed, GLANCE)
    return Trial(name, fitted.chain, fitted.features, judge.score(fitted.features))


def cross_validated(judge: Judge, trial: Trial) -> Trial:
    """The same trial with what each part is predicted to be by the others."""
    held, parts = judge.cross_validated(trial.chain, FIXED)
    alone = all(name in (DROPOUT, Noise.name, BaselineDrift.name) for name in trial.chain.names)
    if trial.name == DROPOUT and not alone and not _is_evident(trial):
        held = _found_elsewhere(judge, trial.chain, held)
    return Trial(trial.name, trial.chain, trial.features, trial.inside, judge.score(held), held, parts)


def _found_elsewhere(judge: Judge, chain: Chain, held: Array) -> Array:
    """Each part with what does not answer in the others: beside another effect on drops, what does not answer in one
    press alone may be what that effect leaves. held: f64[C, F, n], as `Judge.cross_validated` gives it.
    """
    result = held.copy()
    others = chain.without(DROPOUT)
    expected = others.features(judge.state)
    for number in range(int(judge.parts.max()) + 1):
        left_out = judge.parts == number
        effect = Dropout(find_dropped(judge.state, judge.sessions, expected, ~left_out))
        features = others.with_link(Link(effect, effect.found_values(judge.state))).features(judge.state)
        result = np.where(left_out[:, None], features, result)
    return result
