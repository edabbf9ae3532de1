"""Which of a round's trials is taken, if one is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from taxel.gap.catalogue import DROPOUT
from taxel.gap.effects.dropout import Dropout
from taxel.gap.effects.effect import BOARD, HAND, TAXEL, Effect
from taxel.gap.standing import Standing
from taxel.gap.trial import LEVEL, Round, Trial, as_good
from taxel.gap.weighing import Weighed
from taxel.types import FloatArray

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

MANY_MISSING: Final = 0.05
"""Share of a board's frames, beyond the simulator's, that nobody calls chance."""

MANY: Final = 4
"""Values of a board, as of its place or its wires, from which on all boards together could learn a press by heart."""


def asked_of(standing: Standing) -> tuple[float, FloatArray]:
    """The share that an effect must explain to be named, and the score of each family f64[5] below which that says
    nothing.
    """
    return (NEXT_SHARE, standing.judge.noticeable) if standing.chain.links else (LEAST_SHARE, np.zeros(5))


def decided(standing: Standing, held: Sequence[Trial], others: Sequence[Trial]) -> Round:
    """The round of these trials. held: those that were cross-validated."""
    best_of = _best_forms([*held, *others], SIMPLER * standing.start.value)
    known = (trial for trial in best_of.values() if trial.held is not None)
    ranked = sorted(known, key=lambda trial: (not is_evident(trial), *_rank(trial)))
    names_tried = len({trial.name for trial in held})
    every = tuple(best_of.values())
    rounds = [_weighed(standing, trial, every, names_tried) for trial in ranked]
    seen = (
        replace(one, accepted=True)
        for one in rounds
        if one.best is not None and one.p_value < LEVEL and is_seen_beside(standing, one.best)
    )
    taken = _plainest([one for one in rounds if one.accepted]) or next(seen, None)
    return taken or next(iter(rounds), Round(standing.base, every, None, 0.0, 1.0, False))


def _plainest(accepted: list[Round]) -> Round | None:
    """The best of them, or a plainer one that is as good: for the whole hand where the best has a value for each taxel,
    a few dead taxels likewise, without a memory where the best remembers.
    """
    first = next(iter(accepted), None)
    if first is None or first.best is None or is_evident(first.best):
        return first
    for other in accepted[1:]:
        assert other.best is not None
        plainer = _is_plainer(other.best.link.effect, first.best.link.effect)
        if plainer and as_good(other.best, first.best, first.base):
            return other
    return first


def _is_plainer(one: Effect, other: Effect) -> bool:
    """Whether an effect needs fewer words than another: one value, or the names of some dead taxels, not a value for
    each taxel, nor many for each board; what presses now, not what pressed before.
    """
    if one.name == DROPOUT:
        return other.scope == TAXEL
    if one.scope != HAND:
        return False
    many = other.scope == BOARD and len(other.own_parameters()) >= MANY
    return other.scope == TAXEL or many or (other.memory and not one.memory)


def _weighed(standing: Standing, trial: Trial, every: tuple[Trial, ...], names_tried: int) -> Round:
    """The round if this trial were its best. every: best form of each effect."""
    weighed = Weighed(standing, trial)
    least, noticeable = asked_of(standing)
    gain, p_value = weighed.better()
    p_value = min(1.0, p_value * names_tried)
    level = PLAIN_LEVEL if weighed.does_most or weighed.takes_most else LEVEL
    shared = weighed.held.share_of(standing.start, standing.base, noticeable) > least
    large = (p_value < level and (shared or weighed.takes_most)) or is_counted(trial)
    return Round(standing.base, every, trial, gain, p_value, large and weighed.is_material(least))


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


def is_evident(trial: Trial) -> bool:
    """Whether it says of a line that it is broken, and that is seen: a value for each taxel would fit that as well, and
    more, and afterwards nobody would look for it.
    """
    effect = trial.link.effect
    return isinstance(effect, Dropout) and effect.dropped.evident


def is_counted(trial: Trial) -> bool:
    """Whether it says of frames that they did not arrive, and they are many: those are counted, not inferred."""
    effect = trial.link.effect
    return isinstance(effect, Dropout) and float(effect.dropped.missing.max(initial=0.0)) > MANY_MISSING


def is_seen_beside(standing: Standing, trial: Trial) -> bool:
    """Whether it says so beside what was found: told however little of the gap it makes, since who mends the one wants
    to know of the other.
    """
    return bool(standing.chain.links) and trial.name == DROPOUT and is_evident(trial)


def _rank(trial: Trial) -> tuple[bool, float]:
    """Those that were cross-validated first."""
    return (trial.held is None, trial.inside.value if trial.held is None else trial.held.value)
