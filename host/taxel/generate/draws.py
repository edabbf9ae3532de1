"""All that one grasp draws, from a seed of its own: any grasp can be made alone, by anybody, in any order."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from taxel.campaign.variation import small_motion
from taxel.gap.report.reading import ReportedEffect
from taxel.generate.errors import HopelessDrawError
from taxel.generate.placings import drawn_placing, moved
from taxel.generate.ranges import Range
from taxel.generate.recipe import Recipe
from taxel.generate.solids import ObjectKind
from taxel.grasp.objects import GraspObject
from taxel.grasp.plan import Placing
from taxel.grasp.shapes import ShapeError
from taxel.sim.sensor_model import SimSensor

ATTEMPTS: Final = 20
"""Of a grasp; sizes may bound no solid."""

_GRASP, _SENSOR = 0, 1
_MOTION, _NOISE, _EFFECTS = 0, 1, 2
"""Streams of a grasp: adding an effect changes neither how it goes nor its noise."""


@dataclass(frozen=True, eq=False)
class DrawnGrasp:
    """One grasp before it is made.

    kind: of the object. item: the object. approach, placing: how the hand meets it. grip: factor on the torques.
    offset: f64[4, 4], where the object truly is in its nominal frame. stops_seed: of where held joints stop. values:
    what was drawn, by name.
    """

    number: int
    attempt: int
    kind: ObjectKind
    item: GraspObject
    approach: str
    placing: Placing
    grip: float
    offset: NDArray[np.float64]
    stops_seed: int
    layer_stiffness: float
    friction: float
    values: dict[str, float]


def draw_grasp(recipe: Recipe, number: int, first: int = 0) -> DrawnGrasp:
    """Grasp `number` of a recipe. first: number of the attempt to begin with.

    Raises HopelessDrawError if no attempt's sizes bound a solid.
    """
    reason, label = "no attempt is left", "any object"
    for attempt in range(first, ATTEMPTS):
        rng = stream(recipe, number, _MOTION, attempt)
        try:
            return _attempt(recipe, number, attempt, rng)
        except ShapeError as error:
            reason, label = str(error), error.shape
    raise HopelessDrawError(number, label, reason)


def _attempt(recipe: Recipe, number: int, attempt: int, rng: np.random.Generator) -> DrawnGrasp:
    shares = np.cumsum([kind.share for kind in recipe.objects])
    kind = recipe.objects[int(np.searchsorted(shares, float(rng.random()) * shares[-1], side="right"))]
    values = kind.draw(rng)
    digits = len(str(recipe.grasps - 1))
    item = kind.solid(values, f"{kind.name}_{number:0{digits}d}" if kind.varies else kind.name)
    approach, placing = drawn_placing(kind, item.shape, recipe.grasp.top_share, rng)
    for group in (recipe.grasp, recipe.simulator):
        values |= {name: one.draw(rng) for name, one in vars(group).items() if isinstance(one, Range)}
    offset = small_motion(rng.standard_normal(3), rng.standard_normal(3), *_spread(recipe))
    values |= {f"offset_{axis}_mm": 1e3 * float(offset[row, 3]) for row, axis in enumerate("xyz")}
    return DrawnGrasp(
        number,
        attempt,
        kind,
        item,
        approach,
        moved(placing, values),
        values["grip"],
        offset,
        int(rng.integers(2**63)),
        values["layer_stiffness"],
        values["friction"],
        values,
    )


def _spread(recipe: Recipe) -> tuple[float, float]:
    return 1e-3 * recipe.grasp.object_mm, float(np.radians(recipe.grasp.object_deg))


def draw_effects(recipe: Recipe, number: int) -> tuple[list[ReportedEffect], dict[str, float]]:
    """The effects of a grasp in the order in which they act, and what was drawn."""
    effects: list[ReportedEffect] = []
    values: dict[str, float] = {}
    for index, planned in enumerate(recipe.effects):
        one, told = planned.draw(stream(recipe, number, _EFFECTS, index))
        values |= told
        effects += [] if one is None else [one]
    return sorted(effects, key=lambda one: one.order), values


def draw_sensor(recipe: Recipe, shard: int) -> SimSensor:
    """The sensor model of a shard."""
    rng = _generator(recipe, _SENSOR, shard)
    return SimSensor(**{name: one.draw(rng) for name, one in vars(recipe.sensor).items()})


def noise_of(recipe: Recipe, number: int) -> np.random.Generator:
    """What draws the noise of a grasp."""
    return stream(recipe, number, _NOISE)


def stream(recipe: Recipe, number: int, *purpose: int) -> np.random.Generator:
    """A stream of one grasp."""
    return _generator(recipe, _GRASP, number, *purpose)


def _generator(recipe: Recipe, *key: int) -> np.random.Generator:
    return np.random.default_rng(np.random.SeedSequence(recipe.seed, spawn_key=key))
