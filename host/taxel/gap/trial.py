"""What a search tries, and what it ends with."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace
from typing import Final

from taxel.gap.chain import Chain, FittedEffect
from taxel.gap.effects.dropout import Dropout
from taxel.gap.judge import Judge
from taxel.gap.score import Score
from taxel.types import FloatArray

LEVEL: Final = 0.01
"""Of a corrected p-value under which a gain is believed."""

ALIKE: Final = 0.1
"""Share of the best effect's gain by which another may fall behind and still not be told from it."""


@dataclass(frozen=True, eq=False)
class Trial:
    """An effect that was tried in a round. link: with fitted values; chain: in which. inside: score where it was
    fitted; held: score on what was left out, None where it was not worth it; parts: the fits without each part.
    """

    name: str
    chain: Chain
    features: FloatArray
    inside: Score
    held: Score | None = None
    held_features: FloatArray | None = None
    parts: tuple[Chain, ...] = ()

    @property
    def link(self) -> FittedEffect:
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
    """judge: of the pair, its frames aligned with what was found. before: the simulator's features f64[C, F, n] as the
    search began, aligned without it. chain: what explains the gap. rounds: how it was found. features: in sample; held:
    on left-out cells, f64[C, F, n]. start, end: scores without and with it, on what was left out; fitted: with it,
    where it was fitted; parts: the fits without each part.
    """

    judge: Judge
    before: FloatArray
    chain: Chain
    rounds: tuple[Round, ...]
    features: FloatArray
    held: FloatArray
    start: Score
    end: Score
    fitted: Score
    parts: tuple[Chain, ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """The effects that were found, in the order in which they were."""
        found = [one.best.name for one in self.rounds if one.accepted and one.best is not None]
        return tuple(dict.fromkeys(name for name in (*found, *self.chain.names) if name in self.chain.names))

    def only(self, names: Collection[str]) -> Selection:
        """With these effects alone in the chain, as they were fitted beside the others."""
        if set(self.chain.names) <= set(names):
            return self
        chain, *parts = (
            Chain(tuple(link for link in one.links if link.effect.name in names)) for one in (self.chain, *self.parts)
        )
        return replace(self, chain=chain, features=chain.features(self.judge.state), parts=tuple(parts))

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
                alike = tuple(trial.name for trial in others if as_good(trial, one.best, one.base))
                if alike:
                    found[one.best.name] = alike
        return found

    @property
    def explained(self) -> float:
        """Share of the score that is gone on left-out cells."""
        return 1.0 - self.end.value / self.start.value if self.start.value > 0 else 0.0

    @property
    def fits(self) -> float:
        """Share of the score that is gone where the chain was fitted."""
        return 1.0 - self.fitted.value / self.start.value if self.start.value > 0 else 0.0


def as_good(trial: Trial, best: Trial, base: Score) -> bool:
    """Whether a trial does what the best one does, as far as the left-out cells tell."""
    assert trial.held is not None
    assert best.held is not None
    lost, p_value = best.held.better_than(trial.held)
    return lost < ALIKE * (base.value - best.held.value) and p_value > LEVEL
