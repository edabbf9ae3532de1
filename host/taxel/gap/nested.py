"""The whole search once more without each session: what that chooses knows nothing of the session that judges it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np

from taxel.gap.chain import Chain
from taxel.gap.errors import GapInputError
from taxel.gap.judge import Judge
from taxel.gap.rounds import Forms
from taxel.gap.select import select

LEAST_SESSIONS: Final = 4
"""Three must be left to tell a gain from chance."""


@dataclass(frozen=True, eq=False)
class Inside:
    """What is chosen without each session: a fitted chain for every one that is left out."""

    chains: tuple[Chain, ...]

    def only(self, found: tuple[str, ...], believed: tuple[str, ...]) -> Inside:
        """Without those of the `found` effects that are not `believed`; what only a session's absence brings stays."""
        dropped = set(found) - set(believed)
        return Inside(
            tuple(Chain(tuple(one for one in chain.links if one.effect.name not in dropped)) for chain in self.chains)
        )

    @property
    def names(self) -> list[list[str]]:
        """Of each session's chain."""
        return [sorted(chain.names) for chain in self.chains]


def searched_inside(judge: Judge, forms: Forms, progress: Callable[[int, int], None]) -> Inside:
    """Search without each session in turn. judge: as before the first search. Raises GapInputError of one line."""
    count = judge.sessions.value.shape[1]
    if count < LEAST_SESSIONS:
        expected = f"at least {LEAST_SESSIONS} sessions"
        raise GapInputError("--nested", expected, str(count), "omit --nested, or record more sessions")
    chains = []
    for session in range(count):
        progress(session, count)
        inside = judge.sessions.only(np.arange(count) != session)
        chains.append(select(Judge(judge.state, inside, judge.layout), forms).chain)
    progress(count, count)
    return Inside(tuple(chains))
