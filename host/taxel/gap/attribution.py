"""What each found effect does in sessions that were left out: Shapley shares, waterfall, what is lost without one."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations
from math import factorial

import numpy as np
from numpy.typing import NDArray

from taxel.gap.chain import Chain
from taxel.gap.held_out import HeldOut
from taxel.gap.judge import Judge
from taxel.gap.metric import jackknife, root

Array = NDArray[np.float64]
Names = frozenset[str]


@dataclass(frozen=True, eq=False)
class Attribution:
    """gap2: squared gap of each left-out session with each subset of the effects, counts^2, f64[S]."""

    names: tuple[str, ...]
    gap2: dict[Names, Array]

    def shapley(self) -> dict[str, float]:
        """Each effect's share of what all of them take from the squared gap (Shapley 1953); they add to 1."""
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
        return {name: value / whole if whole != 0 else 0.0 for name, value in worth.items()}

    def waterfall(self) -> list[dict[str, object]]:
        """The gap after each effect, one after another, counts."""
        steps: list[dict[str, object]] = []
        for number, name in enumerate(self.names):
            gap2 = self.gap2[frozenset(self.names[: number + 1])]
            left = np.array([np.delete(gap2, s).mean() for s in range(len(gap2))]) if len(gap2) > 2 else np.zeros(0)
            value = root(jackknife(left, float(gap2.mean())))
            steps.append({"effect": name, "gap": value.value, "ci95": value.ci95})
        return steps

    def ablation(self) -> list[dict[str, object]]:
        """The gap with all effects but one, counts."""
        return [
            {"without": name, "gap": float(np.sqrt(self.gap2[frozenset(self.names) - {name}].mean()))}
            for name in self.names
        ]

    def shrink(self, names: Names) -> tuple[float, list[float] | None]:
        """Of the gap by some effects alone, and its interval."""
        before, after = self.gap2[frozenset()], self.gap2[names]
        whole = _shrink(before, after)
        keep = [np.arange(len(before)) != s for s in range(len(before))]
        left = np.array([_shrink(before[k], after[k]) for k in keep]) if len(before) > 2 else np.zeros(0)
        return whole, jackknife(left, whole).ci95


def _shrink(before: Array, after: Array) -> float:
    return float(1.0 - np.sqrt(after.mean() / before.mean())) if before.mean() > 0 else 0.0


def attribute(judge: Judge, names: tuple[str, ...], held: HeldOut) -> Attribution:
    """Work out every subset, with the values that were fitted without the session in which it is measured."""
    real, layout = judge.sessions.value, judge.layout
    scale = layout.weight[:, None] / (real.shape[0] * real.shape[3])
    gap2: dict[Names, Array] = {}
    for size in range(len(names) + 1):
        for chosen in combinations(names, size):
            sessions = []
            for session, links in enumerate(held.links):
                chain = Chain.of([link for link in links if link.effect.name in chosen])
                residual = real[:, session] - chain.features(judge.state)
                sessions.append(float(np.nansum(scale * residual**2)))
            gap2[frozenset(chosen)] = np.array(sessions)
    return Attribution(names, gap2)
