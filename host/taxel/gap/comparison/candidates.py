"""The sets of effects that are compared: none, each effect, and larger sets that are built step by step."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from taxel.gap.catalogue import DROPOUT
from taxel.gap.chain import Chain, FittedEffect
from taxel.gap.comparison.density import BlockDensity
from taxel.gap.comparison.held_out import predict_held_out
from taxel.gap.comparison.settings import ComparisonSettings
from taxel.gap.dropped import find_dropped
from taxel.gap.effects.dropout import Dropout
from taxel.gap.effects.effect import Effect
from taxel.gap.fit import NOTHING_KNOWN, KnownColumns, near_their_end, started
from taxel.gap.judge import Judge
from taxel.types import FloatArray

FIXED = (DROPOUT,)
"""Effects that are found by inspection; their values are not fitted."""

Forms = Mapping[str, Sequence[Effect]]


@dataclass(frozen=True, eq=False)
class Candidate:
    """A set of effects.

    chain: with fitted values. features: f64[C, F, n], of the fit. inside, held_out: log density of each block,
    f64[C, s, 5], for the fit and for predictions of parts that a fit did not use.
    """

    chain: Chain
    features: FloatArray
    inside: FloatArray
    held_out: FloatArray

    @property
    def names(self) -> frozenset[str]:
        """Names of the effects."""
        return frozenset(self.chain.names)


class CandidateSearch:
    """Builds the candidate sets of one pair, starting from the empty set."""

    def __init__(self, judge: Judge, forms: Forms, density: BlockDensity, settings: ComparisonSettings) -> None:
        """Prepare the search. forms: forms of each effect by its name."""
        self._judge, self._forms, self._density, self._settings = judge, forms, density, settings

    def run(self, progress: Callable[[int, int], None]) -> dict[frozenset[str], Candidate]:
        """Fit and evaluate candidate sets; the best candidate of each set of names. progress: steps done, total."""
        empty = self._evaluate(Chain(), self._judge.state.mean)
        found = {empty.names: empty}
        base = empty
        for size in range(self._settings.largest_set):
            progress(size, self._settings.largest_set)
            extended = self._extend(base, self._settings.candidates[min(size, 1)])
            for candidate in extended:
                known = found.get(candidate.names)
                if known is None or candidate.held_out.sum() > known.held_out.sum():
                    found[candidate.names] = candidate
            best = max(extended, key=lambda one: one.held_out.sum(), default=base)
            if best.held_out.sum() <= base.held_out.sum():
                break  # no further effect predicts better
            base = best
        return found

    def _extend(self, base: Candidate, number: int) -> list[Candidate]:
        """Evaluate sets with one more effect than `base`: the best `number` of all effects, after coarse fits."""
        judge, settings = self._judge, self._settings
        known = near_their_end(judge.state, base.chain, base.features, FIXED) if base.chain.links else NOTHING_KNOWN
        coarse = [
            chain for name in self._forms if name not in base.names for chain in self._fit_forms(name, base, known)
        ]
        coarse.sort(key=lambda pair: -pair[1])
        result = []
        for chain, _ in coarse[:number]:
            fit = judge.in_sample(chain, FIXED, settings.fit_iterations)
            result.append(self._evaluate(fit.chain, fit.features))
        return result

    def _fit_forms(self, name: str, base: Candidate, known: KnownColumns) -> list[tuple[Chain, float]]:
        """Fit the forms of one effect beside `base` coarsely; the best form of each scope with its log density."""
        judge, best = self._judge, dict[str, tuple[Chain, float]]()
        for link in self._start_forms(name, base):
            fit = judge.in_sample(base.chain.with_link(link), FIXED, self._settings.coarse_iterations, known)
            fitted = next(one for one in fit.chain.links if one.effect.name == name)
            if fitted.effect.is_idle(judge.state, fitted.values):
                continue
            value = float(self._density.compute_log_density(fit.features).sum())
            if fitted.effect.scope not in best or value > best[fitted.effect.scope][1]:
                best[fitted.effect.scope] = (fit.chain, value)
        return list(best.values())

    def _start_forms(self, name: str, base: Candidate) -> list[FittedEffect]:
        """Forms of an effect at the values where a search starts; a dropout as it is found beside `base`."""
        state = self._judge.state
        if name == DROPOUT:
            dropped = find_dropped(state, self._judge.sessions, base.features)
            effect = Dropout(dropped)
            return [FittedEffect(effect, effect.found_values(state))] if dropped.found else []
        return [started(state, form) for form in self._forms[name] if not form.unavailable(state)]

    def _evaluate(self, chain: Chain, features: FloatArray) -> Candidate:
        """Evaluate a fitted chain, in sample and held out. features: f64[C, F, n], of the chain."""
        held = predict_held_out(self._judge, chain, FIXED) if chain.links else features
        density = self._density.compute_log_density
        return Candidate(chain, features, density(features), density(held))
