"""Which effects explain the gap: one after another, as long as cells that were left out gain by them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from taxel.gap.align import shift_beside
from taxel.gap.catalogue import DROPOUT
from taxel.gap.chain import Chain, FittedEffect
from taxel.gap.cores import in_copies
from taxel.gap.deciding import NEXT_SHARE
from taxel.gap.dropped import find_dropped
from taxel.gap.effects.dropout import Dropout
from taxel.gap.effects.latency import is_delay
from taxel.gap.effects.noise import Noise
from taxel.gap.effects.pose_error import PoseError
from taxel.gap.exchange import exchanged
from taxel.gap.fit import started
from taxel.gap.judge import REFITS, Judge
from taxel.gap.rounds import FIXED, Forms, cross_validated, is_idle, next_round, tried
from taxel.gap.screen import screened
from taxel.gap.standing import Standing
from taxel.gap.told import told_of
from taxel.gap.trial import LEVEL, Round, Selection, Trial
from taxel.gap.weighing import MOST_OF_LEFT

MOST_EFFECTS: Final = 4

LEAST_SHIFT: Final = 0.05
"""Share of a frame period by which both sides must lie apart to be aligned anew."""

SCREENED_SHARE: Final = 0.12
"""Share of the drops' score that may be left before pairs and triples are screened."""

SCREENED_BETTER: Final = 0.6
"""Of what the found effects leave by linear reckoning, below which another set is worth a fit."""

SCREENED_MOST: Final = 1


def select(judge: Judge, forms: Forms, progress: Callable[[int, int], None] = lambda done, total: None) -> Selection:
    """Search forward. forms: the catalogue."""
    standing = Standing.of(judge)
    rounds: list[Round] = []
    for number in range(MOST_EFFECTS):
        progress(number, MOST_EFFECTS)
        this = next_round(standing, forms)
        rounds.append(this)
        if not this.accepted or this.best is None:
            break
        standing = _looked_again(judge, standing.after(_pruned(standing, this.best)), this.best.name)
        if sum(name not in FIXED for name in standing.chain.names) == 1:
            standing = _realigned(standing, forms)
    swapped = exchanged(standing, rounds, forms)
    if swapped is not None and swapped.best is not None:
        rounds.append(swapped)
        standing = standing.after(swapped.best)
    other = _better_set(standing, forms)
    if other is not None and other.held is not None:
        gain, p_value = other.held.better_than(standing.base)
        rounds.append(Round(standing.base, (other,), other, gain, p_value, True))
        standing = standing.after(other)
    before = judge.state.mean
    judge = _whole(judge, standing)
    return Selection(
        judge,
        before,
        standing.chain,
        tuple(rounds),
        standing.features,
        standing.held,
        judge.score(judge.state.mean),
        judge.score(standing.held),
        judge.score(standing.features),
        standing.parts,
    )


def _looked_again(judge: Judge, standing: Standing, name: str) -> Standing:
    """With what does not answer looked for once more where the effect `name`, found last, is a displacement: of a
    bracket that stands elsewhere the rim is not pressed, and looks dead to who expects the press where it was.
    """
    old = next((link.effect for link in standing.chain.links if isinstance(link.effect, Dropout)), None)
    others = standing.chain.without(DROPOUT)
    if old is None or name != PoseError.name:
        return standing
    judge = _whole(judge, standing)
    new = find_dropped(judge.state, judge.sessions, others.features(judge.state))
    if not (old.dropped.dead & ~new.dead).any():
        return standing
    if new.evident or new.lines or new.shorts or new.missing.any():  # a next round weighs whether taxels alone are
        effect = Dropout(new)
        name, others = DROPOUT, others.with_link(FittedEffect(effect, effect.found_values(judge.state)))
    return Standing.of(judge).after(cross_validated(judge, tried(judge, name, others)))


def _whole(judge: Judge, standing: Standing) -> Judge:
    """A judge of all features, also of those that do not answer, with the frames aligned as they are."""
    return judge if standing.judge.state is judge.state else Judge(standing.judge.state, judge.sessions, judge.layout)


def _realigned(standing: Standing, forms: Forms) -> Standing:
    """With the frames of both sides aligned anew: before the first effect was known its onset was taken for a shift.
    What remembers is tried in each of its forms again, since which of them fits best hangs on that.
    """
    judge, chain = standing.judge, standing.chain
    name = next(one for one in chain.names if one not in FIXED)
    link = next(one for one in chain.links if one.effect.name == name)
    others = [form for form in forms[name] if form.variant != link.effect.variant and not form.unavailable(judge.state)]
    rivals = [chain.without(name).with_link(started(judge.state, form)) for form in others if link.effect.memory]
    aligned = in_copies(judge.state, lambda one: _aligned(judge, name, one), [chain, *rivals])
    possible = [aligned[0], *(one for one in aligned[1:] if not is_idle(judge, one[1]))]
    shift, trial = min(possible, key=lambda one: one[1].inside.value)
    same = trial.link.effect.variant == link.effect.variant
    worse = trial.inside.value > standing.fitted.value  # frames can lie only so far apart, and that was cut off
    if same and (worse or abs(shift) < LEAST_SHIFT * judge.state.pair.frame_s):
        return standing
    moved = judge.shifted(shift)
    return Standing.of(moved).after(cross_validated(moved, trial))


def _aligned(judge: Judge, name: str, chain: Chain) -> tuple[float, Trial]:
    """By how much the frames are later beside a chain, and it fitted to that. What all boards' delays share was taken
    for a shift before they were fitted.
    """
    fitted = judge.in_sample(chain, FIXED).chain
    if any(is_delay(link.effect) for link in fitted.links):
        return 0.0, tried(judge, name, fitted, REFITS)
    shift, fitted = shift_beside(judge, fitted, FIXED)
    return shift, tried(judge.shifted(shift), name, fitted, REFITS)


def _better_set(standing: Standing, forms: Forms) -> Trial | None:
    """A pair or triple that leaves less than what was found one after another, if the linear screen shows one that is
    worth the fit; None otherwise.
    """
    judge, chain, base = standing.judge, standing.chain, standing.base
    kept = (*FIXED, Noise.name)  # noise is orthogonal to the others: beside it each set would do as well
    fixed = [link for link in chain.links if link.effect.name in kept]
    names = frozenset(chain.names) - set(kept)
    if not names or base.families[0] < SCREENED_SHARE * standing.start.families[0]:
        return None
    sets = screened(judge, {name: own for name, own in forms.items() if name not in kept})
    own = min((one.left for one in sets if one.names == names), default=1.0)
    for one in [one for one in sets if one.names != names and one.left < SCREENED_BETTER * own][:SCREENED_MOST]:
        links = [*fixed, *(started(judge.state, form) for form in one.forms)]
        trial = cross_validated(judge, tried(judge, one.forms[0].name, chain.of(links)))
        assert trial.held is not None
        gain, p_value = trial.held.better_than(base)
        if p_value < LEVEL / SCREENED_MOST and gain > MOST_OF_LEFT * base.value:
            return _pruned(standing, trial)
    return None


def _pruned(standing: Standing, found: Trial) -> Trial:
    """Without the earlier effects that are not needed beside the last one: that did its work before it was there."""
    judge = standing.judge
    for link in [link for link in found.chain.links if link.effect.name not in (found.name, *FIXED)]:
        without = cross_validated(judge, tried(judge, found.name, found.chain.without(link.effect.name)))
        assert without.held_features is not None
        assert found.held_features is not None
        told = told_of(link.effect, judge).judge
        start, less, more = map(told.score, (judge.state.mean, without.held_features, found.held_features))
        _, p_value = more.better_than(less)
        small = more.share_of(start, less) < NEXT_SHARE
        if p_value > LEVEL or (small and more.gone_of(less) <= MOST_OF_LEFT):
            found = without
    return found
