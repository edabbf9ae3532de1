"""What a further effect takes from what the earlier ones have left, and whether that is enough for a name."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Final

from taxel.gap.catalogue import DROPOUT
from taxel.gap.chain import Chain
from taxel.gap.effects.noise import Noise
from taxel.gap.judge import Judge
from taxel.gap.metric import MARGIN_FLOORS, margin2
from taxel.gap.score import Score
from taxel.gap.standing import Standing
from taxel.gap.told import told_of
from taxel.gap.trial import Trial
from taxel.types import FloatArray

MOST_OF_LEFT: Final = 0.55
"""Share of what the effects before have left, from which on a further one counts however small it is beside them."""

PLAIN_SHARE: Final = 0.4
"""Share of the whole score that an effect explains on left-out cells, from which on counts^2 are not asked for: they
hang on the few taxels that are pressed hardest."""

PLAIN_BESIDE: Final = 0.2
"""The same beside another effect, if it also does most of what that has left where they were fitted."""

PLAIN_FLOORS: Final = 2.0
"""Squared floors that an effect takes from the gap, from which on it is material however large the gap is."""


NOISE_MARGIN: Final = 1.0 / 6.0
"""Of the margin that is no gap yet, that noise must take in counts^2: a simulator that has a little less noise than the
hand, or none, is seen at once and means nothing, alone as beside other effects."""

NOISY_COUNTS: Final = 20.0
"""Noise, counts of standard deviation, that is told however much presses scatter: as much as nobody can tell from a
touch.
"""


def much_is_left(standing: Standing) -> bool:
    """Whether what the earlier effects leave would be a gap of its own."""
    return standing.judge.excess(standing.features) > MARGIN_FLOORS * standing.judge.floor2


@dataclass(frozen=True, eq=False)
class Weighed:
    """A trial that was cross-validated, beside where the search stands."""

    standing: Standing
    trial: Trial

    @property
    def held(self) -> Score:
        """On cells that were left out."""
        assert self.trial.held is not None
        return self.trial.held

    @cached_property
    def _judge(self) -> Judge:
        """Of what can speak of the effect where it is left out."""
        return told_of(self.trial.link.effect, self.standing.judge).judge

    @cached_property
    def _told(self) -> tuple[Score, Score, Score]:
        """Its scores of the start, before and after, on cells that were left out."""
        if self._judge is self.standing.judge:
            return self.standing.start, self.standing.base, self.held
        assert self.trial.held_features is not None
        start, before, after = self._judge.state.mean, self.standing.held, self.trial.held_features
        return self._judge.score(start), self._judge.score(before), self._judge.score(after)

    def better(self) -> tuple[float, float]:
        """By how much the score is lower where it was not fitted, and the p-value of that being chance."""
        _, before, after = self._told
        return after.better_than(before)

    @property
    def share(self) -> float:
        """Of the whole score that is gone where it was not fitted."""
        start, before, after = self._told
        return (before.value - after.value) / start.value

    @property
    def gone(self) -> float:
        """Share of what was left that is gone where it was not fitted."""
        _, before, after = self._told
        return after.gone_of(before)

    @property
    def does_most(self) -> bool:
        """Whether it does most of what was left, where it was not fitted: by the score or, where that is a gap of its
        own, by what of it a good simulator does not have.
        """
        if self.gone > MOST_OF_LEFT:
            return True
        _, before, after = self._told
        above = before.value - self._judge.imperfect
        more = above > 0.0 and before.value - after.value > MOST_OF_LEFT * above
        return more and much_is_left(self.standing)

    @cached_property
    def excesses(self) -> tuple[tuple[float, float], ...]:
        """Counts^2 before and after, both where it was not fitted and where it was: a model with a value for each taxel
        may leave much of the first to another, and nothing of the second.
        """
        judge = self.standing.judge
        return tuple((judge.excess(before), judge.excess(after)) for before, after in self._pairs)

    @property
    def _pairs(self) -> tuple[tuple[FloatArray, FloatArray], ...]:
        """Features before and after, where it was not fitted and where it was."""
        assert self.trial.held_features is not None
        return (self.standing.held, self.trial.held_features), (self.standing.features, self.trial.features)

    @cached_property
    def takes_most(self) -> bool:
        """Whether it does most of what the earlier effects have left, in the score or, where many are left, in
        counts^2: beside a proximity of thousands of standard deviations, counts are what still tells.
        """
        least = MARGIN_FLOORS * self.standing.judge.floor2
        in_counts = (1.0 - after / before if before > least else 0.0 for before, after in self.excesses)
        return self.gone > MOST_OF_LEFT or min(in_counts) > MOST_OF_LEFT

    def is_material(self, least: float) -> bool:
        """Whether it takes counts from the gap, not only from what scatters least; or so much that it need not. least:
        share of the gap.
        """
        standing, judge = self.standing, self.standing.judge
        if self.trial.name == DROPOUT:
            return True
        if self.trial.name == Noise.name:
            return all(is_noise_told(judge, *pair) for pair in self._pairs)
        if self.share > PLAIN_SHARE and (not judge.is_partial or self._is_noticeable()):
            return True
        if standing.chain.links and self._is_plain_beside():
            return True
        # What is noise in the gap is no measure of an effect on drops: it must not hide what else is there.
        noise = Chain(tuple(link for link in standing.chain.links if link.effect.name == Noise.name))
        whole = max(judge.excess(noise.features(judge.state)), judge.floor2)
        enough = min(least * whole, PLAIN_FLOORS * judge.floor2)
        # Beside what does not answer the rest is a gap of its own: what would be none alone is none here.
        return self._taken2 > (max(enough, judge.floor2) if judge.is_partial else enough)

    @property
    def _taken2(self) -> float:
        """Counts^2 that it takes from the gap, both where it was not fitted and where it was."""
        return min(before - after for before, after in self.excesses)

    def _is_noticeable(self) -> bool:
        gone = self.standing.base.families - self.held.families
        return bool((gone > self.standing.judge.noticeable).any())

    def _is_plain_beside(self) -> bool:
        """Whether it does much of what the earlier ones have left, both where it was fitted and where not."""
        inside = self.trial.inside.gone_of(self.standing.fitted)
        return inside > MOST_OF_LEFT and self.share > PLAIN_BESIDE


def is_noise_told(judge: Judge, before: FloatArray, after: FloatArray) -> bool:
    """Whether noise that makes features f64[C, F, n] of others takes enough of the gap to be told."""
    if judge.excess(before) - judge.excess(after) > NOISE_MARGIN * margin2(judge.floor2):
        return True
    noisy = float(judge.layout.weight[judge.layout.noise].sum()) * NOISY_COUNTS**2
    return judge.noise_excess(before) - judge.noise_excess(after) > noisy
