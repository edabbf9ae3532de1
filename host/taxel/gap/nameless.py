"""Found effects that these presses do not tell from a change of amplitude that nobody has a name for.

A plain change of amplitude and one that fades towards full scale are two generic distortions: many causes do the one or
the other. Where a found effect does no more than that, and no other effect of the catalogue was there to be compared
with, it may as well be a cause that the catalogue lacks.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping

import numpy as np

from taxel.gap.catalogue import DROPOUT
from taxel.gap.chain import Chain, FittedEffect
from taxel.gap.effects.effect import TAXEL
from taxel.gap.effects.gain_mismatch import GainMismatch
from taxel.gap.equations import Column
from taxel.gap.identify import is_alike, linear_left
from taxel.gap.judge import Judge
from taxel.gap.told import ENOUGH_TOLD, told_of
from taxel.gap.uneven import odd_pattern

AMPLITUDE = ("gain_mismatch", "stiffness")
"""A gain is a plain change of amplitude, and is asked whether it might be one that fades. Both together are asked
whether any change of amplitude would do."""


def nameless(judge: Judge, chain: Chain, confounded: Mapping[str, Collection[str]]) -> dict[str, str]:
    """Names of such effects, and why each may be another. chain: fitted. confounded: what was found, and what cannot be
    told from it: a class of named effects is an honest answer, if its values are as parts have them.
    """
    odd = {link.effect.name: pattern for link in chain.links if (pattern := odd_pattern(judge, link))}
    plain = _plain_amplitude(judge, chain, confounded)
    ladder = (
        f"these grasps do not distinguish {' and '.join(map(_plain, plain))} from other changes of the amplitude; "
        "record a force ladder"
    )
    once = "is determined for most taxels by a single condition; load these taxels in other conditions too"
    untold = {link.effect.name: once for link in chain.links if told_of(link.effect, judge).share < ENOUGH_TOLD}
    return {**dict.fromkeys(plain, ladder), **{name: f"{_plain(name)} {why}" for name, why in (untold | odd).items()}}


def _plain(name: str) -> str:
    return name.replace("_", " ")


def _plain_amplitude(judge: Judge, chain: Chain, confounded: Mapping[str, Collection[str]]) -> tuple[str, ...]:
    found = set(chain.names)
    amplitude = [link for link in chain.links if link.effect.name in AMPLITUDE]
    compared = any(set(confounded.get(link.effect.name, ())) - found for link in amplitude)
    if len(amplitude) > 1 and not compared and _could_be_amplitude(judge, chain, *amplitude):
        return tuple(link.effect.name for link in amplitude)
    return tuple(
        link.effect.name
        for link in chain.links
        if link.effect.name != DROPOUT
        and not set(confounded.get(link.effect.name, ())) - found
        and _could_be_amplitude(judge, chain, link)
    )


def _could_be_amplitude(judge: Judge, chain: Chain, *links: FittedEffect) -> bool:
    """Whether generic changes of amplitude do what these effects do together."""
    state, without = judge.state, chain
    for link in links:
        without = without.without(link.effect.name)
    vector = np.nan_to_num(chain.features(state) - without.features(state))
    whole = float(np.sum(judge.weight * vector**2))
    if whole <= 0:
        return False
    if len(links) > 1:
        generic = [_amplitude(judge, links[0].effect.scope, fades) for fades in (False, True)]
    else:
        generic = [_amplitude(judge, links[0].effect.scope, isinstance(links[0].effect, GainMismatch))]
    return is_alike(linear_left(judge, vector, generic), whole)


def _amplitude(judge: Judge, scope: str, fades: bool) -> Column:
    """A plain change of amplitude, of each taxel or board; or one that fades towards full scale."""
    state, bins = judge.state, judge.layout.bins
    change = np.zeros_like(state.mean)
    drop = state.mean[:, :bins]
    change[:, :bins] = drop * (1.0 - drop / state.full_scale) if fades else drop
    pair = state.pair
    own = np.arange(pair.n) if scope == TAXEL else pair.groups.sensor
    count = int(own.max()) + 1
    return Column(change, np.broadcast_to(own, (len(pair.cells), pair.n)), count, np.zeros(count))
