"""All samples of one grasp, from its own seed: each grasp can be generated alone, by any worker and in any order."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from taxel.campaign.variation import make_small_motion
from taxel.gap.report.reading import ReportedEffect
from taxel.generate.errors import SamplingError
from taxel.generate.placement import sample_placement, shift_placement
from taxel.generate.ranges import Range
from taxel.generate.recipe import Recipe
from taxel.generate.solids import ObjectKind
from taxel.grasp.objects import GraspObject
from taxel.grasp.plan import PalmPlacement
from taxel.grasp.shapes import ShapeError
from taxel.sim.sensor_model import SimSensor
from taxel.types import FloatArray

ATTEMPTS: Final = 20
"""Largest number of samples of one grasp; a sample is repeated if its sizes bound no solid or its simulation fails."""

_GRASP, _SENSOR = 0, 1
_MOTION, _NOISE, _EFFECTS = 0, 1, 2
"""Random streams of a grasp. They are separate, so that an added effect changes neither the motion nor the noise."""


@dataclass(frozen=True, eq=False)
class SampledGrasp:
    """One grasp before its simulation.

    number: number of the grasp in the recipe. attempt: number of earlier samples that were unsuitable. kind: kind of
    object. item: the object. approach, placement: name of the approach and placement of the palm at the object. grip:
    factor on the joint torques. offset: f64[4, 4], true pose of the object in its nominal frame. stops_seed: seed of
    the angles at which held joints stop. layer_stiffness: factor on the layer's stiffness. friction: coefficient
    between hand and object. values: all sampled values, by name.
    """

    number: int
    attempt: int
    kind: ObjectKind
    item: GraspObject
    approach: str
    placement: PalmPlacement
    grip: float
    offset: FloatArray
    stops_seed: int
    layer_stiffness: float
    friction: float
    values: dict[str, float]


def sample_grasp(recipe: Recipe, number: int, first_attempt: int = 0) -> SampledGrasp:
    """Sample the random quantities of grasp `number` of a recipe, starting with attempt `first_attempt`.

    Raises SamplingError if no attempt is left, or if the sampled sizes of every attempt describe no solid.
    """
    reason, label = "no attempt is left", "any object"
    for attempt in range(first_attempt, ATTEMPTS):
        rng = make_random_stream(recipe, number, _MOTION, attempt)
        try:
            return _sample_attempt(recipe, number, attempt, rng)
        except ShapeError as error:
            reason, label = str(error), error.shape
    raise SamplingError(number, label, reason)


def _sample_attempt(recipe: Recipe, number: int, attempt: int, rng: np.random.Generator) -> SampledGrasp:
    """Sample all random quantities of a grasp once. Raises ShapeError for sizes that describe no solid."""
    shares = np.cumsum([kind.share for kind in recipe.objects])
    kind = recipe.objects[int(np.searchsorted(shares, float(rng.random()) * shares[-1], side="right"))]
    values = kind.sample(rng)
    digits = len(str(recipe.grasps - 1))
    item = kind.solid(values, f"{kind.name}_{number:0{digits}d}" if kind.is_varied else kind.name)
    approach, placement = sample_placement(kind, item.shape, recipe.grasp.top_share, rng)
    for ranges in (recipe.grasp, recipe.simulator):
        values |= {name: value.sample(rng) for name, value in vars(ranges).items() if isinstance(value, Range)}
    offset = make_small_motion(rng.standard_normal(3), rng.standard_normal(3), *_get_object_std(recipe))
    values |= {f"offset_{axis}_mm": 1e3 * float(offset[row, 3]) for row, axis in enumerate("xyz")}
    return SampledGrasp(
        number=number,
        attempt=attempt,
        kind=kind,
        item=item,
        approach=approach,
        placement=shift_placement(placement, values),
        grip=values["grip"],
        offset=offset,
        stops_seed=int(rng.integers(2**63)),
        layer_stiffness=values["layer_stiffness"],
        friction=values["friction"],
        values=values,
    )


def _get_object_std(recipe: Recipe) -> tuple[float, float]:
    """Return the standard deviations per axis of the object's position (metres) and rotation (radians)."""
    return 1e-3 * recipe.grasp.object_mm, float(np.radians(recipe.grasp.object_deg))


def sample_effects(recipe: Recipe, number: int) -> tuple[list[ReportedEffect], dict[str, float]]:
    """Sample the effects of grasp `number`; return those that are present, and the sampled values by label.

    The effects are in the order in which they act.
    """
    effects: list[ReportedEffect] = []
    values: dict[str, float] = {}
    for index, planned in enumerate(recipe.effects):
        effect, sampled = planned.sample(make_random_stream(recipe, number, _EFFECTS, index))
        values |= sampled
        if effect is not None:
            effects.append(effect)
    return sorted(effects, key=lambda effect: effect.order), values


def sample_sensor(recipe: Recipe, shard: int) -> SimSensor:
    """Sample the sensor model of shard `shard`."""
    rng = _make_generator(recipe, _SENSOR, shard)
    return SimSensor(**{name: value.sample(rng) for name, value in vars(recipe.sensor).items()})


def make_noise_generator(recipe: Recipe, number: int) -> np.random.Generator:
    """Make the random generator for the noise of grasp `number`."""
    return make_random_stream(recipe, number, _NOISE)


def make_random_stream(recipe: Recipe, number: int, *purpose: int) -> np.random.Generator:
    """Make one of the independent random streams of grasp `number`. purpose: numbers that identify the stream."""
    return _make_generator(recipe, _GRASP, number, *purpose)


def _make_generator(recipe: Recipe, *key: int) -> np.random.Generator:
    """Make a random generator from the seed of the recipe and the numbers `key`."""
    return np.random.default_rng(np.random.SeedSequence(recipe.seed, spawn_key=key))
