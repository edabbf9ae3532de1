"""Which worlds there are, and what each hides: drawn from numbers that nobody chose."""

from __future__ import annotations

import math
import secrets
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from itertools import cycle
from typing import Any, Final, NamedTuple

import numpy as np

from taxel.blind.form import Form
from taxel.blind.hidden import Cause, Hidden
from taxel.blind.kinds import INSIDE, NAMES, SILENT, forms_of, nuisances
from taxel.blind.strangers import LOOKALIKES, OUTSIDE
from taxel.hand import Hand, load_hand

MIX: Final = {"none": 150, "single": 20 * len(NAMES), "several": 60, "outside": 60, "lookalike": 12}
"""Worlds of each kind in the full score; fewer worlds keep these shares."""

WITHHELD_EACH: Final = 8
"""Single worlds of each effect in the full score that are diagnosed once more with that effect deleted."""

ANALYSIS_EVERY: Final = 40
"""Each of so many worlds is diagnosed with ten analysis seeds."""

APPROACHES, SESSIONS, REPEATS = (8, 9), (4, 6), (1, 3)
"""Least and most of each, on the rig of four boards."""

PRESSES = (48, 120)
"""The same of all presses of a world."""

FLOORS: Final = (0.5, 6.0)
"""How far a single cause's gap lies above the floor, in floors, at strength 0 and 1 (`tools/blind/strengths.py`)."""

TOGETHER_FLOORS: Final = (2.0, 6.0)
"""The same of each of several: one that alone would make no clear gap cannot be asked for beside others."""

SALT_BYTES: Final = 32


@dataclass(frozen=True)
class Shape:
    """How large a world's plan is: ways to press, each `repeats` times in every session."""

    approaches: int
    sessions: int
    repeats: int

    @property
    def presses(self) -> int:
        """Of all sessions."""
        return self.approaches * self.sessions * self.repeats


SMALL: Final = Shape(approaches=8, sessions=4, repeats=2)
FULL_HAND: Final = Shape(approaches=24, sessions=4, repeats=1)


class Plan(NamedTuple):
    """What a world is to hide. forms: of its causes. strength: from 0 to 1. withheld: as of `World`."""

    kind: str
    forms: tuple[Form, ...]
    strength: float
    withheld: bool = False


@dataclass(frozen=True)
class World:
    """One world. number: its place in the run. seed: of plan and physics. hand: its packaged name. salt: hex, 256 bit.

    withheld: it is diagnosed a second time with its effect deleted from the catalogue. decoy: an effect that it does
    not hide, and that is deleted likewise; without such worlds a deletion would tell that what it deletes is there.
    repeated: also with other analysis seeds.
    """

    number: int
    hand: str
    seed: int
    hidden: Hidden
    salt: str
    withheld: bool = False
    repeated: bool = False
    shape: Shape = SMALL
    decoy: str = ""

    def to_json(self) -> dict[str, Any]:
        """For the seal."""
        return {**vars(self), "hidden": self.hidden.to_json(), "shape": asdict(self.shape)}

    @classmethod
    def from_json(cls, data: dict[str, Any]) -> World:
        """What `to_json` gave."""
        return cls(**{**data, "hidden": Hidden.from_json(data["hidden"]), "shape": Shape(**data["shape"])})


def drawn_worlds(count: int, full_hand: int = 0, seed: int | None = None) -> list[World]:
    """`count` worlds on the rig of four boards, in a drawn order, and `full_hand` on the whole hand behind them.

    seed: for tests; None: the operating system's random numbers, as a sealed check has them.
    """
    rng = np.random.default_rng(secrets.randbits(256) if seed is None else seed)
    plans = {hand: _plans(rng, number) for hand, number in (("rig4", count), ("allegro", full_hand)) if number}
    worlds: list[World] = []
    for name, own in plans.items():
        hand = load_hand(name)
        worlds += [_world(rng, number, hand, plan, seed is None) for number, plan in enumerate(own, len(worlds))]
    return _with_decoys(rng, worlds)


def _with_decoys(rng: np.random.Generator, worlds: list[World]) -> list[World]:
    """As many of the others as are withheld, of any kind."""
    others = [world.number for world in worlds if not world.withheld]
    count = min(len(worlds) - len(others), len(others))
    chosen = set(rng.permutation(others).tolist()[:count])
    return [
        replace(world, decoy=str(rng.choice([name for name in NAMES if name not in world.hidden.names])))
        if world.number in chosen
        else world
        for world in worlds
    ]


def _plans(rng: np.random.Generator, count: int) -> list[Plan]:
    """`count` of them in the shares of `MIX`, in a drawn order."""
    total = sum(MIX.values())
    share = {kind: round(count * number / total) for kind, number in MIX.items() if kind != "none"}
    plans = [Plan("none", (), 0.0)] * (count - sum(share.values()))
    plans += _singles(rng, share["single"], count / total)
    plans += [Plan("several", _together(rng), strength) for strength in _strengths(rng, share["several"])]
    for kind, forms in (("outside", OUTSIDE), ("lookalike", LOOKALIKES)):
        place = cycle(rng.permutation(len(forms)).tolist())
        plans += [Plan(kind, (forms[next(place)],), strength) for strength in _strengths(rng, share[kind])]
    return [plans[place] for place in rng.permutation(len(plans)).tolist()]


def _singles(rng: np.random.Generator, count: int, scale: float) -> list[Plan]:
    """Every effect as often, and each of its forms as often."""
    plans = []
    order = cycle(rng.permutation(len(NAMES)).tolist())
    own = [NAMES[next(order)] for _ in range(count)]
    for name in NAMES:
        number = own.count(name)
        withheld = min(number, round(WITHHELD_EACH * scale + float(rng.random()) * (scale < 1)))
        forms = cycle([forms_of(name)[place] for place in rng.permutation(len(forms_of(name))).tolist()])
        strengths = _strengths(rng, number)
        plans += [Plan("single", (next(forms),), strengths[place], place < withheld) for place in range(number)]
    return plans


def _strengths(rng: np.random.Generator, count: int) -> list[float]:
    """Between 0 and 1, evenly in floors, in a drawn order."""
    even = (np.arange(count) + rng.random(count)) / max(count, 1)
    low, high = FLOORS
    return [_strength(float(low + (high - low) * value)) for value in rng.permutation(even)]


def _strength(floors: float) -> float:
    """At which a cause's gap lies that far above the floor: its ranges are logarithmic."""
    low, high = FLOORS
    return math.log(floors / low) / math.log(high / low)


def _together(rng: np.random.Generator) -> tuple[Form, ...]:
    """Two or three causes of different names, of words that the emulator takes together."""
    while True:
        chosen = [INSIDE[place] for place in rng.choice(len(INSIDE), int(rng.integers(2, 4)), replace=False)]
        words = {form.form.split()[0] for form in chosen}
        if len({form.name for form in chosen}) == len(chosen) == len(words):
            return tuple(chosen)


def _world(rng: np.random.Generator, number: int, hand: Hand, plan: Plan, is_sealed: bool) -> World:
    causes = _causes(rng, hand, plan)
    while _are_unheard(causes):
        causes = _causes(rng, hand, plan)
    return World(
        number,
        hand.name,
        salt=secrets.token_hex(SALT_BYTES) if is_sealed else rng.bytes(SALT_BYTES).hex(),
        shape=FULL_HAND if hand.name == "allegro" else _shape(rng),
        seed=int(rng.integers(2**62)),
        hidden=Hidden(plan.kind, causes, nuisances(rng)),
        withheld=plan.withheld,
        repeated=number % ANALYSIS_EVERY == 0,
    )


def _causes(rng: np.random.Generator, hand: Hand, plan: Plan) -> tuple[Cause, ...]:
    return tuple(_cause(rng, hand, form, plan.strength, plan.kind) for form in plan.forms)


def _are_unheard(causes: Sequence[Cause]) -> bool:
    """Whether one acts on nothing but boards that another silences: nobody could find it."""
    silent = {place.address for cause in causes if cause.form == SILENT for place in cause.places}
    words = {f"board=0x{address:02X}" for address in silent}

    def is_unheard(cause: Cause) -> bool:
        here = bool(cause.places) and {place.address for place in cause.places} <= silent
        return cause.form != SILENT and (here or all(words & set(line.split()) for line in cause.lines))

    return any(is_unheard(cause) for cause in causes)


def _cause(rng: np.random.Generator, hand: Hand, form: Form, strength: float, kind: str) -> Cause:
    # Several at once: each has a strength of its own, none so weak that it hides behind the others.
    return form.draw(rng, hand, _strength(float(rng.uniform(*TOGETHER_FLOORS))) if kind == "several" else strength)


def _shape(rng: np.random.Generator) -> Shape:
    while True:
        shape = Shape(*(int(rng.integers(low, high + 1)) for low, high in (APPROACHES, SESSIONS, REPEATS)))
        if PRESSES[0] <= shape.presses <= PRESSES[1]:
            return shape
