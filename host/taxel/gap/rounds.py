"""One round of the search: what is tried, and what of that is worth being judged on cells that were left out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np

from taxel.gap.catalogue import DROPOUT
from taxel.gap.chain import Chain, FittedEffect
from taxel.gap.cores import in_copies
from taxel.gap.deciding import asked_of, decided, is_counted, is_evident, is_seen_beside
from taxel.gap.dropped import find_dropped
from taxel.gap.effects.baseline_drift import BaselineDrift
from taxel.gap.effects.dropout import Dropout
from taxel.gap.effects.effect import TAXEL, Effect
from taxel.gap.effects.noise import Noise
from taxel.gap.fit import ITERATIONS, NOTHING_KNOWN, KnownColumns, near_their_end, started
from taxel.gap.judge import Judge
from taxel.gap.score import Score
from taxel.gap.standing import Standing
from taxel.gap.trial import ALIKE, Round, Trial
from taxel.gap.weighing import MOST_OF_LEFT, Weighed, is_noise_told, much_is_left
from taxel.types import FloatArray

SHORTLIST: Final = 4
"""Forms that are cross-validated in a round: those that gain most where they were fitted, one of each effect and scope.
"""

GLANCE: Final = 4
"""Iterations of the fits that make the short list."""

PROMISED: Final = 0.75
"""Of what an effect must do of what is left, that shows at a glance."""

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
    judge = standing.judge
    trials = glanced(standing, forms, fixed)
    chosen = _short_list(standing, trials)
    if set(standing.chain.names) - set(fixed):  # only what does most of what is left would be taken
        chosen = [trial for trial in chosen if _promises_most(standing, trial)]
    fitted = in_copies(judge.state, lambda trial: tried(judge, trial.name, trial.chain), chosen)
    held = [trial for trial in cross_validated_each(judge, fitted) if not is_idle(judge, trial)]
    return decided(standing, held, [trial for trial in trials if trial not in chosen])


def glanced(standing: Standing, forms: Forms, fixed: tuple[str, ...]) -> list[Trial]:
    """Every effect that was not found yet, after a few iterations, best first. fixed: those that keep their values."""
    judge = standing.judge
    # The longest first: nobody waits for it at the end.
    jobs = sorted(_jobs(standing, forms), key=lambda job: -job[1].values.size)
    # An earlier effect moves little: one tangent of it serves all that are tried beside it.
    chain = standing.chain
    known = near_their_end(judge.state, chain, chain.features(judge.state), fixed) if jobs else NOTHING_KNOWN
    trials = in_copies(judge.state, lambda job: _glanced(judge, job[0], chain, job[1], fixed, known), jobs)
    return sorted((one for one in trials if not is_idle(judge, one)), key=lambda trial: trial.inside.value)


def _short_list(standing: Standing, trials: list[Trial]) -> list[Trial]:
    """Those that are worth a cross-validation. trials: the best one where it was fitted first."""
    judge, (least, noticeable) = standing.judge, asked_of(standing)
    best: dict[tuple[str, str], Trial] = {}
    for trial in trials:
        share = trial.inside.share_of(standing.start, standing.base, noticeable)
        much = share > 0.5 * least or trial.inside.gone_of(standing.fitted) > MOST_OF_LEFT
        if much or is_counted(trial) or is_seen_beside(standing, trial):
            best.setdefault((trial.name, trial.link.effect.scope), trial)
    first = next(iter(best.values()), None)
    worthy = [trial for trial in best.values() if not _is_hopeless(trial, first or trial, standing.base)]
    # No place for noise that would be refused: it is the clearest of all.
    worthy.sort(
        key=lambda trial: trial.name == Noise.name and not is_noise_told(judge, standing.features, trial.features)
    )
    # What does not answer is found by looking, not by a fit that could beat others: it is always weighed.
    return worthy[:SHORTLIST] + [trial for trial in worthy[SHORTLIST:] if trial.name == DROPOUT]


def _promises_most(standing: Standing, trial: Trial) -> bool:
    """Whether it may do most of what the earlier ones have left, in the score or in counts, once it is fitted."""
    judge = standing.judge
    left, less = judge.excess(standing.features), judge.excess(trial.features)
    return max(trial.inside.gone_of(standing.fitted), 1.0 - less / left) > PROMISED * MOST_OF_LEFT


def _jobs(standing: Standing, forms: Forms) -> list[tuple[str, FittedEffect]]:
    """Effects at the values where their search begins."""
    judge = standing.judge
    jobs: list[tuple[str, FittedEffect]] = []
    for name in forms:
        if name in standing.chain.names:
            continue
        if name == DROPOUT:
            dropped = find_dropped(judge.state, judge.sessions, standing.features)
            if dropped.found:
                effect = Dropout(dropped)
                jobs.append((name, FittedEffect(effect, effect.found_values(judge.state))))
            continue
        jobs += [(name, started(judge.state, form)) for form in forms[name] if not form.unavailable(judge.state)]
    return jobs


def _is_hopeless(trial: Trial, best: Trial, base: Score) -> bool:
    """Whether it has a value for each taxel and falls behind even where it was fitted: not there alone, then."""
    if trial.link.effect.scope != TAXEL or trial.name == DROPOUT:
        return False
    return trial.inside.value - best.inside.value > ALIKE * (base.value - best.inside.value)


def is_idle(judge: Judge, trial: Trial) -> bool:
    """Whether what was fitted says nothing that is an effect."""
    return trial.link.effect.is_idle(judge.state, trial.link.values)


def tried(judge: Judge, name: str, chain: Chain, iterations: int = ITERATIONS) -> Trial:
    """A chain with all its effects fitted, as a trial of one of them."""
    fitted = judge.in_sample(chain, FIXED, iterations)
    return Trial(name, fitted.chain, fitted.features, judge.score(fitted.features))


def _glanced(
    judge: Judge, name: str, chain: Chain, link: FittedEffect, fixed: tuple[str, ...], known: KnownColumns
) -> Trial:
    """One more effect, after a few iterations."""
    fitted = judge.in_sample(chain.with_link(link), fixed, GLANCE, known)
    return Trial(name, fitted.chain, fitted.features, judge.score(fitted.features))


def cross_validated(judge: Judge, trial: Trial) -> Trial:
    """The same trial with what each part is predicted to be by the others."""
    (found,) = cross_validated_each(judge, [trial])
    return found


def cross_validated_each(judge: Judge, trials: Sequence[Trial]) -> list[Trial]:
    """The same of several."""
    each = judge.cross_validated([trial.chain for trial in trials], FIXED)
    return [_judged(judge, trial, *found) for trial, found in zip(trials, each, strict=True)]


def _judged(judge: Judge, trial: Trial, held: FloatArray, parts: tuple[Chain, ...]) -> Trial:
    """held, parts: as `Judge.cross_validated` gives them."""
    alone = all(name in (DROPOUT, Noise.name, BaselineDrift.name) for name in trial.chain.names)
    if trial.name == DROPOUT and not alone and not is_evident(trial):
        held = _found_elsewhere(judge, parts, held)
    return Trial(trial.name, trial.chain, trial.features, trial.inside, judge.score(held), held, parts)


def _found_elsewhere(judge: Judge, parts: tuple[Chain, ...], held: FloatArray) -> FloatArray:
    """Each part with what does not answer in the others: beside another effect on drops, what does not answer in one
    press alone may be what that effect leaves. parts, held: as `Judge.cross_validated` gives them.
    """
    result = held.copy()
    for number, chain in enumerate(parts):
        left_out = judge.parts == number
        others = chain.without(DROPOUT)
        effect = Dropout(find_dropped(judge.state, judge.sessions, others.features(judge.state), ~left_out))
        features = others.with_link(FittedEffect(effect, effect.found_values(judge.state))).features(judge.state)
        result = np.where(left_out[:, None], features, result)
    return result
