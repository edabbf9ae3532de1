"""Where a search for effects stands: what was found, what it leaves, and of what a further effect is judged."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from taxel.gap.catalogue import DROPOUT
from taxel.gap.chain import Chain
from taxel.gap.judge import Judge
from taxel.gap.score import Score
from taxel.gap.trial import Trial
from taxel.types import FloatArray


@dataclass(frozen=True, eq=False)
class Standing:
    """Where a search stands. judge: of what is still open. chain: found so far; features: with it, where it was
    fitted; held: on left-out cells; base: score of these; start: score without anything; parts: fits without each part.
    """

    judge: Judge
    chain: Chain
    features: FloatArray
    held: FloatArray
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
