"""Effects that are drawn: those of a gap report within their intervals, and those that a recipe names with ranges."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Final

import numpy as np

from taxel.gap.catalogue import DROPOUT, all_effects
from taxel.gap.effects.effect import BOARD, HAND, TAXEL, Parameter
from taxel.gap.report.model import NOISE_PARTS
from taxel.gap.report.reading import MOST_NOISE_COUNTS, ReportedEffect, ReportedGap
from taxel.generate.errors import RecipeError
from taxel.generate.ranges import Range
from taxel.hand import Hand
from taxel.types import FloatArray

NORMAL_95: Final = 1.959964
"""Half the width of a 95 % interval, in standard deviations."""

COMMON: Final = "common_counts"


@dataclass(frozen=True, eq=False)
class PlannedEffect:
    """An effect, and how its values vary from grasp to grasp.

    found: form, blocks and the values f64[P, G] about which is drawn. share: of grasps that have it. std: f64[P, G], of
    a normal draw; 0: as it is. ranges: by parameter, instead of that. low, high: bounds f64[P]. source: of the values,
    for people.
    """

    found: ReportedEffect
    share: float
    std: FloatArray
    low: FloatArray
    high: FloatArray
    ranges: Mapping[str, Range] = field(default_factory=dict)
    source: str = ""

    @property
    def name(self) -> str:
        """As the gap report's catalogue has it."""
        return self.found.name

    def draw(self, rng: np.random.Generator) -> tuple[ReportedEffect | None, dict[str, float]]:
        """The effect as one grasp has it, None if it has not; and what was drawn, by label."""
        there = float(rng.random()) < self.share
        values = self.found.values + self.std * rng.standard_normal(self.std.shape)
        for row, name in enumerate(self.found.parameters):
            if name in self.ranges:
                values[row] = [self.ranges[name].draw(rng) for _ in self.found.blocks]
        values = np.clip(values, self.low[:, None], self.high[:, None])
        told = {f"{self.name}.there": float(there)}
        if self.found.effect.scope != TAXEL:  # of a thousand taxels the report or the seed tells
            for row, name in enumerate(self.found.parameters):
                for column, block in enumerate(self.found.blocks):
                    told[f"{self.name}.{_label(self.found, name, block)}"] = float(values[row, column])
        return (replace(self.found, values=values) if there else None), told

    def to_json(self) -> dict[str, Any]:
        """As plain values, for a recipe's digest."""
        found = self.found
        return {
            "name": found.name,
            "form": found.effect.variant,
            "scope": found.effect.scope,
            "source": self.source,
            "share": self.share,
            "until_s": found.until_s,
            "shift_s": found.shift_s,
            "blocks": list(found.blocks),
            "values": {name: row.tolist() for name, row in zip(found.parameters, found.values, strict=True)},
            "std": {name: row.tolist() for name, row in zip(found.parameters, self.std, strict=True)},
            "ranges": {name: one.to_json() for name, one in self.ranges.items()},
            "missing": {str(board): share for board, share in found.missing.items()},
            "stuck": list(found.stuck),
        }


def _label(found: ReportedEffect, parameter: str, block: int | str) -> str:
    return parameter if found.effect.scope == HAND else f"{parameter}@{block}"


def planned_of_report(report: ReportedGap, hand: Hand, widen: float, share: float) -> tuple[PlannedEffect, ...]:
    """The effects of a report's verdict. widen: factor on their intervals; 0: every grasp has the values found.

    A value without an interval (below three sessions, or of a single taxel) is taken as found. Raises RecipeError for a
    report of another hand.
    """
    same = len(report.sensor) == hand.n_taxels and all(
        np.array_equal(ours, theirs)
        for ours, theirs in ((report.sensor, hand.sensor), (report.tx, hand.tx), (report.rx, hand.rx))
    )
    if not same:
        found = f"{len(report.sensor)} taxels of another hand"
        raise RecipeError(str(report.path), "taxels", f"those of the hand {hand.name!r}", found, "give its own report")
    source = f"report {report.sha256}"
    return tuple(_of_report(one, widen, share, source) for one in report.effects)


def _of_report(found: ReportedEffect, widen: float, share: float, source: str) -> PlannedEffect:
    std = np.zeros(found.values.shape)
    for row, name in enumerate(found.parameters):
        for column, block in enumerate(found.blocks if found.effect.scope != TAXEL else ()):
            std[row, column] = widen * _std(found, name, _label(found, name, block), float(found.values[row, column]))
    low, high = _bounds(found)
    return PlannedEffect(found, share, std, low, high, source=source)


def _std(found: ReportedEffect, name: str, label: str, value: float) -> float:
    if found.name == "noise" and name != NOISE_PARTS[0]:
        # The report tells one interval for all that taxels have in common.
        bounds = found.intervals.get(label.replace(name, COMMON))
        if bounds is None or sum(bounds) <= 0.0:
            return 0.0
        return value * (bounds[1] - bounds[0]) / (sum(bounds) * NORMAL_95)
    bounds = found.intervals.get(label)
    return 0.0 if bounds is None else (bounds[1] - bounds[0]) / (2.0 * NORMAL_95)


def _bounds(found: ReportedEffect) -> tuple[FloatArray, FloatArray]:
    known = {one.name: one for one in _parameters(found)}
    rows = [known[name] for name in found.parameters]
    return np.array([one.low for one in rows], np.float64), np.array([one.high for one in rows], np.float64)


def _parameters(found: ReportedEffect) -> Sequence[Parameter]:
    return parameters_of(found.name, found.effect.own_parameters())


def parameters_of(name: str, own: Sequence[Parameter]) -> Sequence[Parameter]:
    """What is drawn of an effect: of noise, its independent parts."""
    if name == "noise":
        return [Parameter(part, "counts", 0.0, MOST_NOISE_COUNTS, 0.0, 0.0) for part in NOISE_PARTS]
    return own


def planned_by_name(
    where: str, name: str, form: str, scope: str, share: float, ranges: Mapping[str, Range], hand: Hand, moving_s: float
) -> PlannedEffect:
    """An effect of the catalogue with ranges. where: in the recipe, for errors. form, scope: "" for the first.

    moving_s: seconds from closing to the end of a grasp, over which a drift reaches its counts. Raises RecipeError.
    """
    forms = [one for one in all_effects().get(name, ()) if form in ("", one.variant) and scope in ("", one.scope)]
    if not forms or forms[0].scope not in (HAND, BOARD, TAXEL):
        known = ", ".join(f"{one.variant or 'plain'} of the {one.scope}" for one in all_effects().get(name, ()))
        expected = f"a form of it ({known})" if known else "an effect of the catalogue"
        every = ", ".join(key for key in all_effects() if key != DROPOUT)
        remedy = f"they are {every}; lost boards come from a report alone"
        raise RecipeError(where, "name", expected, " ".join(part for part in (name, form, scope) if part), remedy)
    effect = forms[0]
    parameters = parameters_of(name, effect.own_parameters())
    for key, one in ranges.items():
        parameter = next((each for each in parameters if each.name == key), None)
        if parameter is None:
            names = ", ".join(each.name for each in parameters)
            raise RecipeError(where, key, f"one of {names}", "another parameter", "correct the name")
        if not parameter.low <= one.low <= one.high <= parameter.high:
            expected = f"a range within {parameter.low:g} to {parameter.high:g} {parameter.unit}"
            raise RecipeError(where, key, expected, f"{one.low:g} to {one.high:g}", "correct it")
    blocks = _blocks(effect.scope, hand)
    values = np.repeat([[each.neutral] for each in parameters], len(blocks), axis=1)
    own = tuple(each.name for each in parameters)
    found = ReportedEffect(name, effect, effect.order, moving_s, 0.0, blocks, own, values, {})
    low, high = _bounds(found)
    return PlannedEffect(found, share, np.zeros(values.shape), low, high, dict(ranges), "recipe")


def _blocks(scope: str, hand: Hand) -> tuple[int | str, ...]:
    if scope == HAND:
        return (HAND,)
    return tuple(board.address for board in hand.boards) if scope == BOARD else tuple(range(hand.n_taxels))
