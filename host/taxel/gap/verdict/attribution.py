"""What each found effect does in sessions that were left out: Shapley shares, waterfall, what is lost without one."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations
from math import factorial

import numpy as np

from taxel.gap.features.metric import Interval, jackknife, leave_one_out, root, shrink
from taxel.gap.fitting.composite import CompositeModel
from taxel.gap.fitting.judge import Judge
from taxel.gap.verdict.held_out import HeldOut, compute_session_variance
from taxel.types import FloatArray

Names = frozenset[str]


@dataclass(frozen=True, eq=False)
class Attribution:
    """Of each subset of the effects: squared gap in each left-out session, counts^2, f64[S]; and the shrink that the
    other sessions had promised, f64[S].
    """

    names: tuple[str, ...]
    gap2: dict[Names, FloatArray]
    promised: dict[Names, FloatArray]

    def shapley(self) -> dict[str, float]:
        """Each effect's share of what all of them take from the squared gap (Shapley 1953); they add to 1. None where
        together they take nothing.
        """
        count = len(self.names)
        worth: dict[str, float] = {}
        for name in self.names:
            others = [other for other in self.names if other != name]
            total = 0.0
            for size in range(count):
                weight = factorial(size) * factorial(count - size - 1) / factorial(count)
                for chosen in combinations(others, size):
                    without = frozenset(chosen)
                    total += weight * float((self.gap2[without] - self.gap2[without | {name}]).mean())
            worth[name] = total
        whole = sum(worth.values())
        return {name: value / whole if whole > 0 else 0.0 for name, value in worth.items()}

    @property
    def strongest_first(self) -> tuple[str, ...]:
        """Names by their shares of what all of them take from the gap, in tenths; those that have as many as they were
        found.
        """
        shares = self.shapley()
        return tuple(sorted(self.names, key=lambda name: -round(10 * shares[name])))

    def waterfall(self) -> list[dict[str, object]]:
        """The gap after each effect, one after another, counts."""
        steps: list[dict[str, object]] = []
        for number, name in enumerate(self.names):
            gap2 = self.gap2[frozenset(self.names[: number + 1])]
            stays = leave_one_out(len(gap2)) if len(gap2) > 2 else []
            left = np.array([gap2[stay].mean() for stay in stays])
            value = root(jackknife(left, float(gap2.mean())))
            steps.append({"effect": name, "gap": value.value, "ci95": value.ci95})
        return steps

    def ablation(self) -> list[dict[str, object]]:
        """The gap with all effects but one, counts."""
        return [
            {"without": name, "gap": float(np.sqrt(self.gap2[frozenset(self.names) - {name}].mean()))}
            for name in self.names
        ]

    def shrink(self, name: str) -> Interval:
        """Of the gap by one effect alone."""
        before, after = self.gap2[frozenset()], self.gap2[frozenset({name})]
        stays = leave_one_out(len(before)) if len(before) > 2 else []
        left = np.array([shrink(float(before[k].mean()), float(after[k].mean())) for k in stays])
        return jackknife(left, shrink(float(before.mean()), float(after.mean())))


def attribute(judge: Judge, names: tuple[str, ...], held: HeldOut) -> Attribution:
    """Work out every subset, with the values that were fitted without the session in which it is measured."""
    real, state = judge.sessions, judge.state
    count = real.value.shape[1]
    scale = judge.layout.scale(real.value.shape[0], real.value.shape[3])
    in_sample = [Judge(state, real.only(stay), judge.layout) for stay in leave_one_out(count)] if count > 1 else [judge]
    floor = [compute_session_variance(own.sessions, scale) for own in in_sample]
    start = [max(own.excess(state.mean), 0.0) + one for own, one in zip(in_sample, floor, strict=True)]
    gap2: dict[Names, FloatArray] = {}
    promised: dict[Names, FloatArray] = {}
    for size in range(len(names) + 1):
        for chosen in combinations(names, size):
            squares, shrinks = [], []
            for session, links in enumerate(held.links):
                # What a search without this session found besides goes with the whole set.
                whole = size == len(names) > 0
                composite = CompositeModel.of([link for link in links if whole or link.effect.name in chosen])
                features = composite.features(state)
                squares.append(real.square(session, features, scale))
                after = max(in_sample[session].excess(features), 0.0) + floor[session]
                shrinks.append(shrink(start[session], after))
            gap2[frozenset(chosen)] = np.array(squares)
            promised[frozenset(chosen)] = np.array(shrinks)
    return Attribution(names, gap2, promised)
