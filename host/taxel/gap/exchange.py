"""Another effect in the place of an earlier one, once what came after it is known.

The last effect was found beside all others; each of the others was not. `screen.py` asks by derivatives whether quite
another set would do; here the rivals that an effect had when it was found are fitted beside what came later.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

from taxel.gap.deciding import NEXT_SHARE, PLAIN_LEVEL
from taxel.gap.effects.noise import Noise
from taxel.gap.rounds import FIXED, Forms, cross_validated, glanced, tried
from taxel.gap.standing import Standing
from taxel.gap.trial import Round

RIVAL: Final = 1.0 / 3.0
"""Share of what an effect did when it was found, that another did at a glance then, to be tried in its place."""


def exchanged(standing: Standing, rounds: Sequence[Round], forms: Forms) -> Round | None:
    """The round that puts another effect in the place of a found one, if one does surely better; None otherwise, and
    where what is left may be the solver's. No more is named than before, so that a plain level will do. rounds: of the
    search. forms: the catalogue.
    """
    judge, base, alone = standing.judge, standing.base, (*FIXED, Noise.name)  # nothing else does what these do
    names = [name for name in standing.chain.names if name not in alone]
    if len(names) < 2 or base.families[0] <= judge.noticeable[0]:
        return None
    for name in names:
        without = replace(standing, chain=standing.chain.without(name))
        others = {one: forms[one] for one in _rivals(name, rounds) if one not in alone}
        trials = glanced(without, others, FIXED)
        if not trials or trials[0].inside.value > (1.0 - NEXT_SHARE) * standing.fitted.value:
            continue
        best = cross_validated(judge, tried(judge, trials[0].name, trials[0].chain))
        assert best.held is not None
        gain, p_value = best.held.better_than(base)
        p_value *= len(names)
        if p_value < PLAIN_LEVEL and gain > NEXT_SHARE * base.value:
            return Round(base, (best,), best, gain, p_value, True)
    return None


def _rivals(name: str, rounds: Sequence[Round]) -> list[str]:
    """Effects that did much of what this one did when it was found."""
    found = next((one for one in rounds if one.accepted and one.best is not None and one.best.name == name), None)
    if found is None or found.best is None:
        return []
    least = RIVAL * (found.base.value - found.best.inside.value)
    return [one.name for one in found.trials if one.name != name and found.base.value - one.inside.value > least]
