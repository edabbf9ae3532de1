"""Outcome of a demonstration (hidden causes compared with the diagnosis), and the score of all demonstrations so
far.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

from scipy.stats import beta

from taxel.blind.grasp_world import GraspWorld
from taxel.gap.calibration.calibration import NO_GAP, SMALLEST_CAUSE, UNKNOWN

SURE: Final = 0.8
"""Probability from which a cause that is not hidden is scored as a wrong statement."""


@dataclass(frozen=True)
class DemoOutcome:
    """Outcome of a demonstration.

    seed: seed of the campaign. hidden: emulator effects of the hidden causes. sizes: gap that each hidden cause alone
    produces, in floors. expected: effects of the hidden causes that are large enough to be named. named: effects that
    the diagnosis names. probabilities: probability of each cause in the diagnosis. is_right: whether the most probable
    effects are the expected ones; without an expected effect, whether none is named. is_surely_wrong: whether an effect
    that is not hidden has a probability of `SURE` or more.
    """

    seed: int
    hidden: tuple[str, ...]
    sizes: tuple[float, ...]
    expected: tuple[str, ...]
    named: tuple[str, ...]
    probabilities: Mapping[str, float]
    is_right: bool
    is_surely_wrong: bool

    def to_json(self) -> dict[str, Any]:
        """Return the outcome as JSON values."""
        return {**vars(self), "probabilities": dict(self.probabilities)}


def judge(world: GraspWorld, sizes: Sequence[float], verdict: Mapping[str, Any]) -> DemoOutcome:
    """Compare the verdict of a report with the hidden causes of a world.

    sizes: gap that each hidden cause alone produces, in floors; a cause below `SMALLEST_CAUSE` is not expected to be
    named. verdict: verdict of the report as JSON values. The outcome is right if the most probable effects are the
    expected ones, or if no effect is expected and none is named. It is surely wrong if an effect that is not hidden has
    a probability of `SURE` or more.
    """
    causes = world.hidden.causes
    expected = tuple(cause.name for cause, size in zip(causes, sizes, strict=True) if size >= SMALLEST_CAUSE)
    probabilities = {str(name): float(value) for name, value in verdict["probabilities"].items()}
    named = tuple(str(name) for name in verdict["effects"])
    order = sorted((name for name in named if name != UNKNOWN), key=lambda name: -probabilities.get(name, 0.0))
    hidden = tuple(cause.name for cause in causes)
    return DemoOutcome(
        world.seed,
        tuple(cause.emulator_effect for cause in causes),
        tuple(sizes),
        expected,
        named,
        probabilities,
        set(order[: len(expected)]) == set(expected) if expected else not named,
        any(value >= SURE for name, value in probabilities.items() if name not in (*hidden, NO_GAP, UNKNOWN)),
    )


def format_score(outcomes: Sequence[DemoOutcome]) -> str:
    """Format the score of demonstrations in one line, with its 95 % interval (Clopper and Pearson, Biometrika 26,
    1934).
    """
    number, right = len(outcomes), sum(one.is_right for one in outcomes)
    low = beta.ppf(0.025, right, number - right + 1) if right else 0.0
    high = beta.ppf(0.975, right + 1, number - right) if right < number else 1.0
    wrong = sum(one.is_surely_wrong for one in outcomes)
    share = f"{100.0 * right / number:.0f} %, interval {100.0 * low:.0f} to {100.0 * high:.0f} %"
    return f"{right} of {number} right ({share}), wrong with a probability of {SURE:g} or more: {wrong}"
