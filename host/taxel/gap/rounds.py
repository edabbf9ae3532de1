"""One round of the search: which further effect gains most on cells that were left out, and whether that counts."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from taxel.gap.catalogue import DROPOUT
from taxel.gap.chain import Chain, Link
from taxel.gap.cores import in_copies
from taxel.gap.dropped import find_dropped
from taxel.gap.effects.baseline_drift import BaselineDrift
from taxel.gap.effects.dropout import Dropout
from taxel.gap.effects.effect import HAND, TAXEL, Effect
from taxel.gap.effects.noise import Noise
from taxel.gap.fit import ITERATIONS, started
from taxel.gap.judge import Judge, Score
from taxel.gap.standing import Standing
from taxel.gap.trial import ALIKE, LEVEL, Round, Trial, as_good
from taxel.gap.weighing import MOST_OF_LEFT, Weighed, much_is_left

Array = NDArray[np.float64]

SHORTLIST: Final = 4
"""Forms that are cross-validated in a round: those that gain most where they were fitted, one of each effect and scope.
"""

GLANCE: Final = 4
"""Iterations of the fits that make the short list."""

LEAST_SHARE: Final = 0.03
"""Of the whole score, and of the excess in counts^2, that the first effect must explain to be named."""

NEXT_SHARE: Final = 0.05
"""The same for a further one: what the first one's form leaves is no effect of its own."""

PLAIN_LEVEL: Final = 0.05
"""Level that will do for an effect that takes most of what is left: with four sessions even that hardly comes below the
other.
"""

SIMPLER: Final = 0.01
"""Share of the whole score by which a form with values for each board or taxel must be better than one for the hand."""

FIXED: Final = (DROPOUT,)
"""Links that are found, not fitted with the others."""

Forms = Mapping[str, tuple[Effect, ...]]


def next_round(standing: Standing, forms: Forms) -> Round:
    """Try every effect that was not found yet, and where much is left and none is accepted, once more while the earlier
    ones are fitted beside it: they may have taken it for their own. forms: the catalogue.
    """
    chain = standing.chain
    found = _round(standing, forms, (*FIXED, *chain.names))
    if found.accepted or not set(chain.names) - set(FIXED) or not much_is_left(standing):
        return found
    again = _round(standing, forms, FIXED)
    takes_most = again.accepted and again.best is not None and Weighed(standing, again.best).takes_most
    return again if takes_most else found


def _round(standing: Standing, forms: Forms, fixed: tuple[str, ...]) -> Round:
    """fixed: effects that keep their values while the short list is made."""
    judge, base, start = standing.judge, standing.base, standing.start
    least, noticeable = (NEXT_SHARE, judge.noticeable) if standing.chain.links else (LEAST_SHARE, np.zeros(5))
    # The longest first: nobody waits for it at the end.
    jobs = sorted(_jobs(standing, forms), key=lambda job: -job[1].values.size)
    trials = in_copies(judge.state, lambda job: _glanced(judge, job[0], standing.chain, job[1], fixed), jobs)
    trials = [trial for trial in trials if not is_idle(judge, trial)]
    trials.sort(key=lambda trial: trial.inside.value)
    worthy = [
        trial
        for trial in trials
        if trial.inside.share_of(start, base, noticeable) > 0.5 * least
        or trial.inside.gone_of(standing.fitted) > MOST_OF_LEFT
        or _is_seen_beside(standing, trial)
    ]
    best_fits: dict[tuple[str, str], Trial] = {}
    for trial in worthy:
        best_fits.setdefault((trial.name, trial.link.effect.scope), trial)
    worthy = [trial for trial in best_fits.values() if not _is_hopeless(trial, worthy[0], base)]
    # What does not answer is found by looking, not by a fit that could beat others: it is always weighed.
    chosen = worthy[:SHORTLIST] + [trial for trial in worthy[SHORTLIST:] if trial.name == DROPOUT]
    held = in_copies(judge.state, lambda trial: cross_validated(judge, tried(judge, trial.name, trial.chain)), chosen)
    held = [trial for trial in held if not is_idle(judge, trial)]
    every = held + [trial for trial in trials if trial not in chosen]
    best_of = _best_forms(every, SIMPLER * start.value)
    known = (trial for trial in best_of.values() if trial.held is not None)
    ranked = sorted(known, key=lambda trial: (not _is_evident(trial), *_rank(trial)))
    names_tried = len({trial.name for trial in held})
    rounds = [_weighed(standing, trial, tuple(best_of.values()), names_tried) for trial in ranked]
    seen = (
        replace(one, accepted=True)
        for one in rounds
        if one.best is not None and one.p_value < LEVEL and _is_seen_beside(standing, one.best)
    )
    accepted = _plainest([one for one in rounds if one.accepted]) or next(seen, None)
    nothing = Round(base, tuple(best_of.values()), None, 0.0, 1.0, False)
    return accepted or (rounds[0] if rounds else nothing)


def _plainest(accepted: list[Round]) -> Round | None:
    """The best of them, or one for the whole hand that is as good where the best has a value for each taxel."""
    first = next(iter(accepted), None)
    if first is None or first.best is None or first.best.link.effect.scope != TAXEL or _is_evident(first.best):
        return first
    for other in accepted[1:]:
        assert other.best is not None
        if other.best.link.effect.scope == HAND and as_good(other.best, first.best, first.base):
            return other
    return first


def _weighed(standing: Standing, trial: Trial, every: tuple[Trial, ...], names_tried: int) -> Round:
    """The round if this trial were its best. every: best form of each effect."""
    judge, chain, weighed = standing.judge, standing.chain, Weighed(standing, trial)
    least, noticeable = (NEXT_SHARE, judge.noticeable) if chain.links else (LEAST_SHARE, np.zeros(5))
    gain, p_value = weighed.held.better_than(standing.base)
    p_value = min(1.0, p_value * names_tried)
    level = PLAIN_LEVEL if weighed.gone > MOST_OF_LEFT else LEVEL
    shared = weighed.held.share_of(standing.start, standing.base, noticeable) > least
    large = p_value < level and (shared or weighed.takes_most)
    return Round(standing.base, every, trial, gain, p_value, large and weighed.is_material(least))


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


def _is_hopeless(trial: Trial, best: Trial, base: Score) -> bool:
    """Whether it has a value for each taxel and falls behind even where it was fitted: not there alone, then."""
    if trial.link.effect.scope != TAXEL or trial.name == DROPOUT:
        return False
    return trial.inside.value - best.inside.value > ALIKE * (base.value - best.inside.value)


def is_idle(judge: Judge, trial: Trial) -> bool:
    """Whether what was fitted says nothing that is an effect."""
    return trial.link.effect.is_idle(judge.state, trial.link.values)


def _is_evident(trial: Trial) -> bool:
    """Whether it says of a line that it is broken, and that is seen: a value for each taxel would fit that as well, and
    more, and afterwards nobody would look for it.
    """
    effect = trial.link.effect
    return isinstance(effect, Dropout) and effect.dropped.evident


def _is_seen_beside(standing: Standing, trial: Trial) -> bool:
    """Whether it says so beside what was found: told however little of the gap it makes, since who mends the one wants
    to know of the other.
    """
    return bool(standing.chain.links) and trial.name == DROPOUT and _is_evident(trial)


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
