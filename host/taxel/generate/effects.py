"""Sampled effects: those of a gap report within their intervals, and those that a recipe names with ranges."""

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
"""Label of the interval that a report gives for all noise that taxels share."""


@dataclass(frozen=True, eq=False)
class PlannedEffect:
    """An effect and the distribution of its values over the grasps.

    nominal: variant, blocks and the mean values f64[P, G]. share: share of grasps with the effect. std: f64[P, G],
    standard deviations of a normal distribution; 0: a fixed value. ranges: uniform distributions of parameters, which
    replace the normal ones. low, high: bounds f64[P]. source: origin of the values, as a text.
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
        """Sample the effect for one generated grasp; returns the effect (None if absent) and the sampled values.

        The values are labelled "effect.parameter". Values of single taxels are not in the result, because there are
        about a thousand of each parameter.
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
                    sampled[f"{self.name}.{_label(nominal, name, block)}"] = float(values[row, column])
        return (replace(nominal, values=values) if is_present else None), sampled

    def to_json(self) -> dict[str, Any]:
        """Return the planned effect with its distributions as JSON values, for the digest of a recipe."""
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


def _label(effect: ReportedEffect, parameter: str, block: int | str) -> str:
    """Make the label of a parameter: its name, with "@" and the board or taxel unless the whole hand has one value."""
    return parameter if effect.effect.scope == HAND else f"{parameter}@{block}"


def plan_report_effects(report: ReportedGap, hand: Hand, widen: float, share: float) -> tuple[PlannedEffect, ...]:
    """Plan the effects of a gap report's verdict for generated grasps.

    widen: factor on the intervals of the parameters; 0: every grasp has the reported values. share: share of grasps
    with each effect. A value without an interval (fewer than three sessions, or a value of a single taxel) is fixed.
    Raises RecipeError for a report of another hand.
    """
    is_same_hand = len(report.sensor) == hand.n_taxels and all(
        np.array_equal(reported, own)
        for reported, own in ((report.sensor, hand.sensor), (report.tx, hand.tx), (report.rx, hand.rx))
    )
    if not is_same_hand:
        found = f"{len(report.sensor)} taxels of another hand"
        raise RecipeError(
            str(report.path), "taxels", f"those of the hand {hand.name!r}", found, "give a report of that hand"
        )
    source = f"report {report.sha256}"
    return tuple(_plan_reported(effect, widen, share, source) for effect in report.effects)


def _plan_reported(reported: ReportedEffect, widen: float, share: float, source: str) -> PlannedEffect:
    """Plan an effect of a report with parameters that vary within their intervals.

    widen: factor on the standard deviations. share: share of grasps with the effect. source: for the recipe's digest.
    """
    std = np.zeros(reported.values.shape)
    for row, name in enumerate(reported.parameters):
        for column, block in enumerate(reported.blocks if reported.effect.scope != TAXEL else ()):
            std[row, column] = widen * _standard_deviation(
                reported, name, _label(reported, name, block), float(reported.values[row, column])
            )
    low, high = _parameter_bounds(reported)
    return PlannedEffect(reported, share, std, low, high, source=source)


def _standard_deviation(reported: ReportedEffect, name: str, label: str, value: float) -> float:
    """Compute the standard deviation of a parameter from its 95 % interval in the report; 0 without an interval.

    name, value: of the parameter. label: key of the interval. All kinds of noise that taxels share have a common
    interval; its relative width is used for each of them.
    """
    if reported.name == "noise" and name != NOISE_COMPONENTS[0]:
        # The report gives one interval for all noise that taxels share.
        bounds = reported.intervals.get(label.replace(name, COMMON))
        if bounds is None or sum(bounds) <= 0.0:
            return 0.0
        return value * (bounds[1] - bounds[0]) / (sum(bounds) * NORMAL_95)
    bounds = reported.intervals.get(label)
    return 0.0 if bounds is None else (bounds[1] - bounds[0]) / (2.0 * NORMAL_95)


def _parameter_bounds(reported: ReportedEffect) -> tuple[FloatArray, FloatArray]:
    """Return lower and upper bounds of the P parameters of an effect, f64[P] each."""
    by_name = {parameter.name: parameter for parameter in _parameters(reported)}
    rows = [by_name[name] for name in reported.parameters]
    return np.array([row.low for row in rows], np.float64), np.array([row.high for row in rows], np.float64)


def _parameters(reported: ReportedEffect) -> Sequence[Parameter]:
    """List the sampled parameters of an effect that a gap report names."""
    return list_sampled_parameters(reported.name, reported.effect.own_parameters())


def list_sampled_parameters(name: str, own: Sequence[Parameter]) -> Sequence[Parameter]:
    """List the parameters of an effect that are sampled; for noise, its independent parts. own: all parameters."""
    if name == "noise":
        return [Parameter(part, "counts", 0.0, MAX_NOISE_COUNTS, 0.0, 0.0) for part in NOISE_COMPONENTS]
    return own


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
    """Plan an effect of the catalogue whose parameters are sampled from ranges. Raises RecipeError.

    where: location in the recipe, for errors. name, variant, scope: as in the catalogue; "" as variant or scope stands
    for the first one. share: share of grasps with the effect. ranges: by name of the parameter; a parameter without a
    range keeps its neutral value. moving_s: seconds from closing to the end of a grasp, over which a drift reaches its
    counts.
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
    blocks = _blocks_of_scope(effect.scope, hand)
    values = np.repeat([[each.neutral] for each in parameters], len(blocks), axis=1)
    parameter_names = tuple(each.name for each in parameters)
    nominal = ReportedEffect(name, effect, effect.order, moving_s, 0.0, blocks, parameter_names, values, {})
    low, high = _parameter_bounds(nominal)
    return PlannedEffect(nominal, share, np.zeros(values.shape), low, high, dict(ranges), "recipe")


def _blocks_of_scope(scope: str, hand: Hand) -> tuple[int | str, ...]:
    """List the blocks that have own parameter values: the hand, addresses of the boards, or indices of the taxels."""
    if scope == HAND:
        return (HAND,)
    return tuple(board.address for board in hand.boards) if scope == BOARD else tuple(range(hand.n_taxels))
