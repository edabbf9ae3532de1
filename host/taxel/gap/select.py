"""Which effects explain the gap: one after another, as long as cells that were left out gain by them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from taxel.gap.catalogue import DROPOUT
from taxel.gap.chain import Chain, Link
from taxel.gap.dropped import find_dropped
from taxel.gap.effects.dropout import Dropout
from taxel.gap.effects.effect import HAND, Effect
from taxel.gap.fit import ITERATIONS, started
from taxel.gap.judge import Judge, Score
from taxel.gap.screen import screened

Array = NDArray[np.float64]

MOST_EFFECTS: Final = 4
SHORTLIST: Final = 4
"""Forms that are cross-validated in a round: those that gain most where they were fitted."""

GLANCE: Final = 4
"""Iterations of the fits that make the short list."""

LEVEL: Final = 0.01
"""Of a corrected p-value under which a gain is believed."""

NEARLY_ALL: Final = 0.8
PLAIN_LEVEL: Final = 0.05
"""Share of what is left that an effect explains where it was not fitted, from which on this level will do: with four
sessions even what is plain hardly comes below the other."""

LEAST_SHARE: Final = 0.03
"""Of the whole score, and of the excess in counts^2, that the first effect must explain to be named."""

NEXT_SHARE: Final = 0.06
"""The same for a further one: what the first one's form leaves is no effect of its own."""

MOST_OF_LEFT: Final = 0.55
"""Share of what the effects before have left, from which on a further one counts however small it is beside them."""

PLAIN_SHARE: Final = 0.4
"""Share of the whole score that an effect explains on left-out cells, from which on counts^2 are not asked for: they
hang on the few taxels that are pressed hardest."""

PLAIN_FLOORS: Final = 2.0
"""Squared floors that an effect takes from the gap, from which on it is material however large the gap is."""

SIMPLER: Final = 0.01
"""Share of the whole score by which a form with values for each board or taxel must be better than one for the hand."""

ALIKE: Final = 0.1
"""Share of the best effect's gain by which another may fall behind and still not be told from it."""

SCREENED_SHARE: Final = 0.12
"""Share of the drops' score that may be left before pairs and triples are screened."""

SCREENED_BETTER: Final = 0.6
"""Of what the found effects leave by linear reckoning, below which another set is worth a fit."""

SCREENED_MOST: Final = 1

THREADS: Final = 2

FIXED: Final = (DROPOUT,)
"""Links that are found, not fitted with the others."""

Forms = Mapping[str, tuple[Effect, ...]]


@dataclass(frozen=True, eq=False)
class Trial:
    """An effect that was tried in a round. link: with fitted values; chain: in which. inside: score where it was
    fitted; held: score on what was left out, None where it was not worth it; parts: the fits without each part.
    """

    name: str
    chain: Chain
    features: Array
    inside: Score
    held: Score | None = None
    held_features: Array | None = None
    parts: tuple[Chain, ...] = ()

    @property
    def link(self) -> Link:
        """The effect itself."""
        return next(link for link in self.chain.links if link.effect.name == self.name)


@dataclass(frozen=True, eq=False)
class Round:
    """One round of the search. trials: best form of each effect. base: score that they began from. gain, p_value: of
    the best, corrected for the search.
    """

    base: Score
    trials: tuple[Trial, ...]
    best: Trial | None
    gain: float
    p_value: float
    accepted: bool


@dataclass(frozen=True, eq=False)
class Selection:
    """chain: what explains the gap. rounds: how it was found. features: in sample; held: on left-out cells,
    f64[C, F, n]. start, end: scores without and with it, on what was left out; parts: the fits without each part.
    """

    chain: Chain
    rounds: tuple[Round, ...]
    features: Array
    held: Array
    start: Score
    end: Score
    parts: tuple[Chain, ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """The effects that were found, in the order in which they were."""
        found = [one.best.name for one in self.rounds if one.accepted and one.best is not None]
        return tuple(dict.fromkeys(name for name in (*found, *self.chain.names) if name in self.chain.names))

    @property
    def is_local(self) -> bool:
        """Whether something surely does not answer: it is told however little of the gap it makes."""
        effects = [link.effect for link in self.chain.links]
        return any(isinstance(effect, Dropout) and effect.dropped.certain for effect in effects)

    @property
    def rivals(self) -> dict[str, tuple[str, ...]]:
        """For each found effect those that explain the left-out cells as well: these presses cannot tell them apart."""
        found: dict[str, tuple[str, ...]] = {}
        for one in self.rounds:
            if one.accepted and one.best is not None and one.best.held is not None:
                others = [trial for trial in one.trials if trial.name != one.best.name and trial.held is not None]
                alike = tuple(trial.name for trial in others if _as_good(trial, one.best, one.base))
                if alike:
                    found[one.best.name] = alike
        return found

    @property
    def explained(self) -> float:
        """Share of the score that is gone on left-out cells."""
        return 1.0 - self.end.value / self.start.value if self.start.value > 0 else 0.0


def select(judge: Judge, forms: Forms, progress: Callable[[int, int], None] = lambda done, total: None) -> Selection:
    """Search forward. forms: the catalogue."""
    start = judge.score(judge.state.mean)
    chain, base, features, held = Chain(), start, judge.state.mean, judge.state.mean
    rounds: list[Round] = []
    parts: tuple[Chain, ...] = ()
    for number in range(MOST_EFFECTS):
        progress(number, MOST_EFFECTS)
        this = _round(judge, forms, chain, features, held, base, start, number)
        rounds.append(this)
        if not this.accepted or this.best is None or this.best.held is None or this.best.held_features is None:
            break
        kept = _pruned(judge, this.best, start)
        assert kept.held is not None
        assert kept.held_features is not None
        chain, features, parts = kept.chain, kept.features, kept.parts
        base, held = kept.held, kept.held_features
    other = _better_set(judge, forms, chain, base, start)
    if other is not None and other.held is not None and other.held_features is not None:
        gain, p_value = other.held.better_than(base)
        rounds.append(Round(base, (other,), other, gain, p_value, True))
        chain, features, base, held = other.chain, other.features, other.held, other.held_features
        parts = other.parts
    return Selection(chain, tuple(rounds), features, held, start, base, parts)


def _better_set(judge: Judge, forms: Forms, chain: Chain, base: Score, start: Score) -> Trial | None:
    """A pair or triple that leaves less than what was found one after another, if the linear screen shows one that is
    worth the fit; None otherwise.
    """
    fixed = [link for link in chain.links if link.effect.name in FIXED]
    names = frozenset(chain.names) - set(FIXED)
    if not names or base.families[0] < SCREENED_SHARE * start.families[0]:
        return None
    sets = screened(judge, {name: own for name, own in forms.items() if name not in FIXED})
    own = min((one.left for one in sets if one.names == names), default=1.0)
    for one in [one for one in sets if one.names != names and one.left < SCREENED_BETTER * own][:SCREENED_MOST]:
        links = [*fixed, *(started(judge.state, form) for form in one.forms)]
        name = one.forms[0].name
        trial = _cross_validated(judge, _tried(judge, name, Chain.of(links)))
        assert trial.held is not None
        gain, p_value = trial.held.better_than(base)
        if p_value < LEVEL / SCREENED_MOST and gain > MOST_OF_LEFT * base.value:
            return _pruned(judge, trial, start)
    return None


def _pruned(judge: Judge, found: Trial, start: Score) -> Trial:
    """Without the earlier effects that are not needed beside the last one: that did its work before it was there."""
    for name in [name for name in found.chain.names if name not in (found.name, *FIXED)]:
        without = _cross_validated(judge, _tried(judge, found.name, found.chain.without(name)))
        assert without.held is not None
        assert found.held is not None
        _, p_value = found.held.better_than(without.held)
        if found.held.share_of(start, without.held) < NEXT_SHARE or p_value > LEVEL:
            found = without
    return found


def _as_good(trial: Trial, best: Trial, base: Score) -> bool:
    assert trial.held is not None
    assert best.held is not None
    lost, p_value = best.held.better_than(trial.held)
    return lost < ALIKE * (base.value - best.held.value) and p_value > LEVEL


def _round(
    judge: Judge,
    forms: Forms,
    chain: Chain,
    features: Array,
    held_before: Array,
    base: Score,
    start: Score,
    number: int,
) -> Round:
    least = LEAST_SHARE if number == 0 else NEXT_SHARE
    names = [name for name in forms if name not in chain.names]
    jobs: list[tuple[str, Link]] = []
    for name in names:
        if name == DROPOUT:
            dropped = find_dropped(judge.state, judge.sessions, features)
            if dropped.found:
                effect = Dropout(dropped)
                jobs.append((name, Link(effect, effect.found_values(judge.state))))
            continue
        jobs += [(name, started(judge.state, form)) for form in forms[name] if not form.unavailable(judge.state)]
    with ThreadPoolExecutor(THREADS) as pool:
        trials = list(pool.map(lambda job: _glanced(judge, job[0], chain, job[1]), jobs))
        trials = [trial for trial in trials if not trial.link.effect.is_idle(judge.state, trial.link.values)]
        trials.sort(key=lambda trial: trial.inside.value)
        worth = [trial for trial in trials if trial.inside.share_of(start, base) > 0.5 * least]
        chosen = worth[:SHORTLIST]
        held = list(pool.map(lambda trial: _cross_validated(judge, _tried(judge, trial.name, trial.chain)), chosen))
    every = held + [trial for trial in trials if trial not in chosen]
    best_of = _best_forms(every, SIMPLER * start.value)
    tried = sorted((trial for trial in best_of.values() if trial.held is not None), key=_rank)
    names_tried = len({trial.name for trial in held})
    found = Round(base, tuple(best_of.values()), None, 0.0, 1.0, False)
    for place, trial in enumerate(tried):
        assert trial.held is not None
        gain, p_value = trial.held.better_than(base)
        p_value = min(1.0, p_value * names_tried)
        share = trial.held.share_of(start, base)
        left = gain / base.value if base.value > 0 else 0.0
        level = PLAIN_LEVEL if left > NEARLY_ALL else LEVEL
        worth_it = p_value < level and (share > least or left > MOST_OF_LEFT)
        accepted = worth_it and _is_material(judge, trial, held_before, features, least, gain / start.value)
        if place == 0 or accepted:
            found = Round(base, tuple(best_of.values()), trial, gain, p_value, accepted)
        if accepted:
            break
    return found


def _is_material(judge: Judge, trial: Trial, held_before: Array, features: Array, least: float, gain: float) -> bool:
    """Whether an effect takes counts from the gap, not only from what scatters least; or so much that it need not."""
    if trial.name == DROPOUT or gain > PLAIN_SHARE:
        return True
    assert trial.held_features is not None
    # Both where it was not fitted and where it was: a model with a value for each taxel may leave much of the first to
    # another, and nothing of the second.
    pairs = ((held_before, trial.held_features), (features, trial.features))
    counts2 = min(judge.excess(before) - judge.excess(after) for before, after in pairs)
    whole = max(judge.excess(judge.state.mean), judge.floor2)
    return counts2 > min(least * whole, PLAIN_FLOORS * judge.floor2)


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


def _rank(trial: Trial) -> tuple[bool, float]:
    """Those that were cross-validated first."""
    return (trial.held is None, trial.inside.value if trial.held is None else trial.held.value)


def _tried(judge: Judge, name: str, chain: Chain, iterations: int = ITERATIONS) -> Trial:
    fitted = judge.in_sample(chain, FIXED, iterations)
    return Trial(name, fitted.chain, fitted.features, judge.score(fitted.features))


def _glanced(judge: Judge, name: str, chain: Chain, link: Link) -> Trial:
    """One more effect, while those that were found before keep their values."""
    fitted = judge.in_sample(chain.with_link(link), (*FIXED, *chain.names), GLANCE)
    return Trial(name, fitted.chain, fitted.features, judge.score(fitted.features))


def _cross_validated(judge: Judge, trial: Trial) -> Trial:
    held, parts = judge.cross_validated(trial.chain, FIXED)
    if trial.name == DROPOUT and len(trial.chain.links) > 1:
        held = _found_elsewhere(judge, trial.chain, held)
    return Trial(trial.name, trial.chain, trial.features, trial.inside, judge.score(held), held, parts)


def _found_elsewhere(judge: Judge, chain: Chain, held: Array) -> Array:
    """Each part with what does not answer in the others: beside another effect, what does not answer in one press alone
    may be what that effect leaves. held: f64[C, F, n], as `Judge.cross_validated` gives it.
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
