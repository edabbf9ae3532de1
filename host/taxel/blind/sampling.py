"""Random sampling of worlds and their hidden causes."""

import math
import secrets
from collections.abc import Sequence
from dataclasses import replace
from itertools import cycle
from typing import Final, NamedTuple

import numpy as np

from taxel.blind.catalogue_causes import CATALOGUE_CAUSES, EFFECT_NAMES, SILENT, list_cause_types, sample_nuisance_lines
from taxel.blind.cause_types import CauseType
from taxel.blind.hidden import Cause, HiddenCauses
from taxel.blind.out_of_catalogue import LOOKALIKES, OUT_OF_CATALOGUE
from taxel.blind.world import FULL_HAND_CAMPAIGN, CampaignSize, World
from taxel.hand import Hand, load_hand

KIND_COUNTS: Final = {"none": 150, "single": 20 * len(EFFECT_NAMES), "several": 60, "outside": 60, "lookalike": 12}
"""Number of worlds of each kind in the full score; a smaller check keeps the proportions."""

WITHHELD_PER_EFFECT: Final = 8
"""Single worlds of each effect in the full score that are also diagnosed without this effect in the catalogue."""

REPEATED_INTERVAL: Final = 40
"""One in this number of worlds is diagnosed with ten analysis seeds."""

APPROACHES, SESSIONS, REPEATS = (8, 9), (4, 6), (1, 3)
"""Smallest and largest number of approaches, of sessions and of repeats on the rig of four boards."""

INDENTATIONS = (48, 120)
"""Smallest and largest number of indentations of a world."""

FLOORS: Final = (0.5, 6.0)
"""Root of the excess of a single cause, in floors, at strength 0 and 1 (`tools/blind/strengths.py`)."""

FLOORS_OF_SEVERAL: Final = (2.0, 6.0)
"""The same for each of several causes of one world: a cause that alone produces no clear gap is not expected to be
named."""

SALT_BYTES: Final = 32


class WorldPlan(NamedTuple):
    """Content of a world before its causes are sampled.

    kind: as in `HiddenCauses`. strength: 0 to 1. is_withheld: whether the effect is removed from the catalogue in a
    second diagnosis.
    """

    kind: str
    cause_types: tuple[CauseType, ...]
    strength: float
    is_withheld: bool = False


def sample_worlds(count: int, full_hand: int = 0, seed: int | None = None) -> list[World]:
    """Sample worlds with hidden causes: `count` on the rig of four boards, then `full_hand` on the whole hand.

    The worlds of each hand are in random order. seed: for tests; None: random numbers of the operating system, as
    required for a sealed check.
    """
    rng = np.random.default_rng(secrets.randbits(256) if seed is None else seed)
    counts = {"rig4": count, "original": full_hand}
    plans_by_hand = {hand: _sample_plans(rng, number) for hand, number in counts.items() if number}
    worlds: list[World] = []
    for name, plans in plans_by_hand.items():
        hand, first = load_hand(name), len(worlds)
        worlds += [_sample_world(rng, number, hand, plan, seed is None) for number, plan in enumerate(plans, first)]
    return _add_decoys(rng, worlds)


def _add_decoys(rng: np.random.Generator, worlds: list[World]) -> list[World]:
    """Add a decoy to some worlds: an effect that is not hidden, but is removed from the catalogue of another diagnosis.

    In the withheld worlds (`is_withheld`), the hidden effect itself is removed. If possible, as many worlds get a decoy
    as there are withheld worlds. The removal of an effect therefore does not reveal whether this effect is hidden.
    """
    candidates = [world.number for world in worlds if not world.is_withheld]
    count = min(len(worlds) - len(candidates), len(candidates))
    with_decoy = set(rng.permutation(candidates).tolist()[:count])
    return [
        replace(world, decoy=str(rng.choice([name for name in EFFECT_NAMES if name not in world.hidden.names])))
        if world.number in with_decoy
        else world
        for world in worlds
    ]


def _sample_plans(rng: np.random.Generator, count: int) -> list[WorldPlan]:
    """Sample `count` plans of worlds, with the kinds of causes in the proportions of `KIND_COUNTS`, in random order."""
    total = sum(KIND_COUNTS.values())
    # The numbers of the other kinds are rounded; the remaining worlds have no cause.
    counts = {kind: round(count * number / total) for kind, number in KIND_COUNTS.items() if kind != "none"}
    plans = [WorldPlan("none", (), 0.0)] * (count - sum(counts.values()))
    plans += _sample_single_plans(rng, counts["single"], count / total)
    for strength in _sample_strengths(rng, counts["several"]):
        plans.append(WorldPlan("several", _sample_combination(rng), strength))
    for kind, cause_types in (("outside", OUT_OF_CATALOGUE), ("lookalike", LOOKALIKES)):
        index = cycle(rng.permutation(len(cause_types)).tolist())
        strengths = _sample_strengths(rng, counts[kind])
        plans += [WorldPlan(kind, (cause_types[next(index)],), strength) for strength in strengths]
    return [plans[index] for index in rng.permutation(len(plans)).tolist()]


def _sample_single_plans(rng: np.random.Generator, count: int, scale: float) -> list[WorldPlan]:
    """Sample `count` plans of worlds with one cause, with every effect and each of its cause types equally often.

    scale: ratio of the number of worlds to the sum of `KIND_COUNTS`. Some worlds are withheld: their effect is removed
    from the catalogue in a second diagnosis. Below scale 1 their number is rounded at random, so that small checks also
    contain some.
    """
    plans = []
    order = cycle(rng.permutation(len(EFFECT_NAMES)).tolist())
    names = [EFFECT_NAMES[next(order)] for _ in range(count)]
    for name in EFFECT_NAMES:
        number = names.count(name)
        withheld = min(number, round(WITHHELD_PER_EFFECT * scale + float(rng.random()) * (scale < 1)))
        own_types = list_cause_types(name)
        cause_type = cycle([own_types[index] for index in rng.permutation(len(own_types)).tolist()])
        strengths = _sample_strengths(rng, number)
        plans += [
            WorldPlan("single", (next(cause_type),), strengths[index], index < withheld) for index in range(number)
        ]
    return plans


def _sample_strengths(rng: np.random.Generator, count: int) -> list[float]:
    """Sample `count` strengths between 0 and 1 in random order.

    A strength is the result of `find_strength` for a sampled root of the excess (squared gap minus squared floor;
    floor: the gap that repeats alone show). This root is uniform between the two values of `FLOORS`, in floors. Each of
    `count` equal parts of this range contains one value.
    """
    strata = (np.arange(count) + rng.random(count)) / max(count, 1)
    low, high = FLOORS
    return [find_strength(float(low + (high - low) * value)) for value in rng.permutation(strata)]


def find_strength(floors: float) -> float:
    """Compute the strength of a cause, 0 to 1, at which the root of the excess is `floors` times the floor.

    Excess: squared gap minus squared floor. Its root at strength 0 and 1 is the first and the second value of `FLOORS`.
    The scale between them is logarithmic, as are the parameter ranges of the causes.
    """
    low, high = FLOORS
    return math.log(floors / low) / math.log(high / low)


def _sample_combination(rng: np.random.Generator) -> tuple[CauseType, ...]:
    """Sample two or three cause types of different catalogue effects and different emulator effects."""
    while True:
        indices = rng.choice(len(CATALOGUE_CAUSES), int(rng.integers(2, 4)), replace=False)
        combination = [CATALOGUE_CAUSES[index] for index in indices]
        # The first word of an emulator effect, such as "spread film", is the effect; the second is its variant.
        emulator_effects = {cause_type.emulator_effect.split()[0] for cause_type in combination}
        if len({cause_type.name for cause_type in combination}) == len(combination) == len(emulator_effects):
            return tuple(combination)


def _sample_world(rng: np.random.Generator, number: int, hand: Hand, plan: WorldPlan, is_sealed: bool) -> World:
    """Sample one world according to a plan.

    All causes are sampled again while one of them is not observable because of another cause. is_sealed: whether the
    salt is secret; otherwise the seed determines the salt.
    """
    causes = _sample_causes(rng, hand, plan)
    while _is_any_masked(causes):
        causes = _sample_causes(rng, hand, plan)
    return World(
        number,
        hand.name,
        salt=secrets.token_hex(SALT_BYTES) if is_sealed else rng.bytes(SALT_BYTES).hex(),
        size=FULL_HAND_CAMPAIGN if hand.name == "original" else sample_campaign_size(rng),
        seed=int(rng.integers(2**62)),
        hidden=HiddenCauses(plan.kind, causes, sample_nuisance_lines(rng)),
        is_withheld=plan.is_withheld,
        is_repeated=number % REPEATED_INTERVAL == 0,
    )


def _sample_causes(rng: np.random.Generator, hand: Hand, plan: WorldPlan) -> tuple[Cause, ...]:
    """Sample one cause for each cause type of a world's plan."""
    return tuple(_sample_cause(rng, hand, cause_type, plan) for cause_type in plan.cause_types)


def _is_any_masked(causes: Sequence[Cause]) -> bool:
    """Whether one of the causes acts only on boards that another cause silences, so that it is not observable."""
    silent = {location.address for cause in causes if cause.emulator_effect == SILENT for location in cause.locations}
    board_arguments = {f"board=0x{address:02X}" for address in silent}

    def is_masked(cause: Cause) -> bool:
        """Whether all boards of a cause are silent because of another cause."""
        is_on_silent = bool(cause.locations) and {location.address for location in cause.locations} <= silent
        is_line_on_silent = all(board_arguments & set(line.split()) for line in cause.lines)
        return cause.emulator_effect != SILENT and (is_on_silent or is_line_on_silent)

    return any(is_masked(cause) for cause in causes)


def _sample_cause(rng: np.random.Generator, hand: Hand, cause_type: CauseType, plan: WorldPlan) -> Cause:
    """Sample one cause of a type. plan: plan of the world, with the strength of a single cause."""
    # Each of several causes has its own strength, and none is so weak that the others mask it.
    is_several = plan.kind == "several"
    strength = find_strength(float(rng.uniform(*FLOORS_OF_SEVERAL))) if is_several else plan.strength
    return cause_type.sample(rng, hand, strength)


def sample_campaign_size(rng: np.random.Generator) -> CampaignSize:
    """Sample the size of an indentation campaign whose number of indentations is within the limits."""
    while True:
        size = CampaignSize(*(int(rng.integers(low, high + 1)) for low, high in (APPROACHES, SESSIONS, REPEATS)))
        if INDENTATIONS[0] <= size.indentations <= INDENTATIONS[1]:
            return size
