"""Sampled effects: those of a gap report within their intervals, and those that a recipe names with ranges.

The scope of an effect states what has its own parameter values: the hand, each board or each taxel. Such a part of the
skin is called a block.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Final

import numpy as np

from taxel.gap.effects.catalogue import DROPOUT, all_effects
from taxel.gap.effects.effect import BOARD, HAND, TAXEL, Parameter
from taxel.gap.report.model import NOISE_COMPONENTS
from taxel.gap.report.reading import MAX_NOISE_COUNTS, ReportedEffect, ReportedGap
from taxel.generate.errors import RecipeError
from taxel.generate.ranges import Range
from taxel.hand import Hand
from taxel.types import FloatArray

NORMAL_95: Final = 1.959964
"""Half width of a 95 % interval of a normal distribution, in standard deviations."""

COMMON: Final = "common_counts"
"""Key of the interval that a report gives for all noise components that several taxels share."""


@dataclass(frozen=True, eq=False)
class PlannedEffect:
    """An effect and the distribution of its P parameters in G blocks over the generated grasps.

    nominal: the effect with its blocks and with the mean values f64[P, G]. share: share of grasps with the effect. std:
    f64[P, G], standard deviations of a normal distribution; 0: a fixed value. low, high: f64[P], bounds to which all
    values are clipped. ranges: by parameter, uniform distributions that replace the normal ones. source: origin of the
    values, "recipe" or "report" with its digest.
    """

    nominal: ReportedEffect
    share: float
    std: FloatArray
    low: FloatArray
    high: FloatArray
    ranges: Mapping[str, Range] = field(default_factory=dict)
    source: str = ""

    @property
    def name(self) -> str:
        """Name of the effect in the catalogue of the gap diagnosis."""
        return self.nominal.name

    def sample(self, rng: np.random.Generator) -> tuple[ReportedEffect | None, dict[str, float]]:
        """Sample the effect for one generated grasp; return it (None if absent) and the sampled values by label.

        The labels are "effect.parameter", and "effect.there" for the presence (1.0 or 0.0). Values are sampled and
        returned even if the effect is absent. Values of single taxels are not returned, because there are about a
        thousand of each parameter.
        """
        nominal = self.nominal
        is_present = float(rng.random()) < self.share
        values = nominal.values + self.std * rng.standard_normal(self.std.shape)
        for row, name in enumerate(nominal.parameters):
            if name in self.ranges:
                values[row] = [self.ranges[name].sample(rng) for _ in nominal.blocks]
        values = np.clip(values, self.low[:, None], self.high[:, None])
        sampled = {f"{self.name}.there": float(is_present)}
        if nominal.effect.scope != TAXEL:
            for row, name in enumerate(nominal.parameters):
                for column, block in enumerate(nominal.blocks):
                    sampled[f"{self.name}.{_make_label(nominal, name, block)}"] = float(values[row, column])
        return (replace(nominal, values=values) if is_present else None), sampled

    def to_json(self) -> dict[str, Any]:
        """Return the planned effect with its distributions as JSON values, from which a recipe's digest is computed."""
        nominal = self.nominal
        return {
            "name": nominal.name,
            "form": nominal.effect.variant,
            "scope": nominal.effect.scope,
            "source": self.source,
            "share": self.share,
            "until_s": nominal.until_s,
            "shift_s": nominal.shift_s,
            "blocks": list(nominal.blocks),
            "values": {name: row.tolist() for name, row in zip(nominal.parameters, nominal.values, strict=True)},
            "std": {name: row.tolist() for name, row in zip(nominal.parameters, self.std, strict=True)},
            "ranges": {name: value.to_json() for name, value in self.ranges.items()},
            "missing": {str(board): share for board, share in nominal.missing.items()},
            "stuck": list(nominal.stuck),
        }


def _make_label(effect: ReportedEffect, parameter: str, block: int | str) -> str:
    """Make the label of a parameter: its name, followed by "@" and the block unless the whole hand has one value."""
    return parameter if effect.effect.scope == HAND else f"{parameter}@{block}"


def plan_report_effects(report: ReportedGap, hand: Hand, widen: float, share: float) -> tuple[PlannedEffect, ...]:
    """Plan the effects that a gap report found, for generated grasps.

    widen: factor on the widths of the parameters' intervals; 0: every grasp has the reported values. share: share of
    grasps with each effect. A value without an interval (fewer than three sessions, or a value of a single taxel) is
    fixed. Raises RecipeError for a report of another hand.
    """
    is_same_hand = len(report.sensor) == hand.n_taxels and all(
        np.array_equal(reported, expected)
        for reported, expected in ((report.sensor, hand.sensor), (report.tx, hand.tx), (report.rx, hand.rx))
    )
    if not is_same_hand:
        found = f"{len(report.sensor)} taxels of another hand"
        raise RecipeError(
            str(report.path), "taxels", f"those of the hand {hand.name!r}", found, "give a report of that hand"
        )
    source = f"report {report.sha256}"
    return tuple(_plan_reported(effect, widen, share, source) for effect in report.effects)


def _plan_reported(reported: ReportedEffect, widen: float, share: float, source: str) -> PlannedEffect:
    """Plan an effect of a report with normally distributed parameters, whose widths are those of their intervals.

    widen: factor on the standard deviations. share: share of grasps with the effect. source: name of the report for the
    recipe's digest.
    """
    std = np.zeros(reported.values.shape)
    for row, name in enumerate(reported.parameters):
        # Reports contain no intervals for values of single taxels: these values are fixed.
        for column, block in enumerate(reported.blocks if reported.effect.scope != TAXEL else ()):
            std[row, column] = widen * _compute_standard_deviation(
                reported, name, _make_label(reported, name, block), float(reported.values[row, column])
            )
    low, high = _list_parameter_bounds(reported)
    return PlannedEffect(reported, share, std, low, high, source=source)


def _compute_standard_deviation(reported: ReportedEffect, name: str, label: str, value: float) -> float:
    """Compute the standard deviation of a parameter from its 95 % interval in the report; 0 without an interval.

    name, value: name and reported value of the parameter. label: key of its interval. The noise components that several
    taxels share have one common interval; its relative width is used for each of them.
    """
    if reported.name == "noise" and name != NOISE_COMPONENTS[0]:
        # The report gives one interval for the sum of all noise that taxels share.
        bounds = reported.intervals.get(label.replace(name, COMMON))
        if bounds is None or sum(bounds) <= 0.0:
            return 0.0
        # Relative half width of the interval, (high - low) / (high + low), in standard deviations.
        return value * (bounds[1] - bounds[0]) / (sum(bounds) * NORMAL_95)
    bounds = reported.intervals.get(label)
    return 0.0 if bounds is None else (bounds[1] - bounds[0]) / (2.0 * NORMAL_95)


def _list_parameter_bounds(reported: ReportedEffect) -> tuple[FloatArray, FloatArray]:
    """Return the lower and the upper bounds of the P parameters of an effect, f64[P] each."""
    available = list_sampled_parameters(reported.name, reported.effect.own_parameters())
    by_name = {parameter.name: parameter for parameter in available}
    parameters = [by_name[name] for name in reported.parameters]
    low, high = [parameter.low for parameter in parameters], [parameter.high for parameter in parameters]
    return np.array(low, np.float64), np.array(high, np.float64)


def list_sampled_parameters(name: str, parameters: Sequence[Parameter]) -> Sequence[Parameter]:
    """List the parameters of the effect `name` that are sampled: for noise its components, otherwise `parameters`."""
    if name == "noise":
        return [Parameter(part, "counts", 0.0, MAX_NOISE_COUNTS, 0.0, 0.0) for part in NOISE_COMPONENTS]
    return parameters


def plan_effect(
    where: str,
    name: str,
    variant: str,
    scope: str,
    share: float,
    ranges: Mapping[str, Range],
    hand: Hand,
    moving_s: float,
) -> PlannedEffect:
    """Plan an effect of the catalogue whose parameters are sampled from ranges.

    where: location in the recipe, for errors. name, variant, scope: as in the catalogue; an empty variant or scope
    selects the first one. share: share of grasps with the effect. ranges: by name of the parameter; a parameter without
    a range keeps its neutral value. moving_s: seconds from closing to the end of a grasp, in which a drift reaches its
    final value. Raises RecipeError for an effect, a parameter or a range that the catalogue does not permit.
    """
    catalogue = all_effects()
    variants = [
        effect for effect in catalogue.get(name, ()) if variant in ("", effect.variant) and scope in ("", effect.scope)
    ]
    if not variants or variants[0].scope not in (HAND, BOARD, TAXEL):
        available = ", ".join(f"{each.variant or 'plain'} of the {each.scope}" for each in catalogue.get(name, ()))
        expected = f"one of its variants ({available})" if available else "an effect of the catalogue"
        names = ", ".join(key for key in catalogue if key != DROPOUT)
        remedy = f"use one of {names}; dropouts can be taken from a report only"
        raise RecipeError(where, "name", expected, " ".join(part for part in (name, variant, scope) if part), remedy)
    effect = variants[0]
    parameters = list_sampled_parameters(name, effect.own_parameters())
    for key, bounds in ranges.items():
        parameter = next((each for each in parameters if each.name == key), None)
        if parameter is None:
            names = ", ".join(each.name for each in parameters)
            raise RecipeError(where, key, f"one of {names}", "another parameter", "correct the name")
        if not parameter.low <= bounds.low <= bounds.high <= parameter.high:
            expected = f"a range within {parameter.low:g} to {parameter.high:g} {parameter.unit}"
            raise RecipeError(where, key, expected, f"{bounds.low:g} to {bounds.high:g}", "correct it")
    blocks = _list_blocks(effect.scope, hand)
    values = np.repeat([[each.neutral] for each in parameters], len(blocks), axis=1)
    parameter_names = tuple(each.name for each in parameters)
    nominal = ReportedEffect(name, effect, effect.order, moving_s, 0.0, blocks, parameter_names, values, {})
    low, high = _list_parameter_bounds(nominal)
    return PlannedEffect(nominal, share, np.zeros(values.shape), low, high, dict(ranges), "recipe")


def _list_blocks(scope: str, hand: Hand) -> tuple[int | str, ...]:
    """List the blocks (parts of the skin with one value of each parameter) of an effect with this scope.

    The blocks are `HAND` alone, the addresses of the boards, or the indices of the taxels.
    """
    if scope == HAND:
        return (HAND,)
    return tuple(board.address for board in hand.boards) if scope == BOARD else tuple(range(hand.n_taxels))
