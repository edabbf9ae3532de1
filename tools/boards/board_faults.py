"""Emulated boards to test: healthy ones that differ as parts do, and single faults of a chosen severity.

A severity is how many times beyond the plan's limit a fault lies, by the physics of the emulator
(firmware/emulator/README.md); a short, a stuck taxel and exchanged lines are there or not. What a board does by chance
(drift) is measured on a twin of it without noise, and scaled.
"""

from __future__ import annotations

import math
import random
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from taxel.hand import BoardKind, load_hand
from taxel.hand.world import WorldSettings, format_world
from taxel.link.base import Chunk
from taxel.link.virtual import VirtualMemoryLink, VirtualWorld
from taxel_tools.bench.analysis.fault import Axis, line_name, lines_name, taxel_name
from taxel_tools.bench.readout import HubReadout
from taxel_tools.testing.plan import Plan
from taxel_tools.testing.record import Limit
from taxel_tools.wires import HubWire

HAND: Final = load_hand("allegro")
BOARDS: Final = {board.kind.name: board.address for board in HAND.boards}
"""One board of each kind."""
REST_PF: Final = 1.5
"""Capacitance of an emulated crossing at rest, fixed and fringe."""
USUAL_COUNTS: Final = 730.0
"""What a press of 1 N does to an emulated taxel without spread."""
TWIN_S: Final = 13.0
WANDER_LAG_S: Final = 0.25

LOOK_S: Final = 0.01
"""How often a link is looked at: five times as seldom as usual, which halves the work of a test."""

Names = frozenset[str]


class SlowLink(VirtualMemoryLink):
    """The hub's UART, whose bytes are taken in pieces of 10 ms. Frames keep their own times."""

    def read(self, timeout_s: float) -> Chunk | None:
        """As `Link`."""
        wait = min(timeout_s, LOOK_S)
        if wait > 0.0:
            self.world.run(wait)
        return super().read(timeout_s - wait)


@dataclass(frozen=True)
class Case:
    """A board to test. `names`: what its fault may be called; `places`: where; empty for a healthy board."""

    family: str
    kind: str
    seed: int
    effects: tuple[str, ...]
    names: Names
    place: str
    severity: float


@dataclass(frozen=True)
class Family:
    """One kind of fault. `graded`: it has a severity; otherwise it is there or not."""

    name: str
    graded: bool
    draw: Callable[[random.Random, BoardKind, str, float, Plan], tuple[list[str], Names, str]]


def healthy_effects(rng: random.Random) -> list[str]:
    """What sound boards of one batch differ in: electrodes, current source, layer, noise, warming up, coupling of
    traces.
    """
    return [
        f"gain electrode log_std={rng.uniform(0.03, 0.06):.4f}",
        f"gain idac log_std={rng.uniform(0.02, 0.04):.4f}",
        f"modulus taxels log_std={rng.uniform(0.05, 0.12):.4f}",
        f"noise white counts={rng.uniform(2.0, 5.0):.3f}",
        f"noise line counts={rng.uniform(0.0, 2.0):.3f} axis={rng.randrange(3)}",
        f"noise pink counts={rng.uniform(0.0, 3.0):.3f}",
        f"drift warm_up counts={rng.uniform(0.0, 20.0):.3f} seconds={rng.uniform(120.0, 600.0):.1f}",
        f"coupling traces picofarad={rng.uniform(0.1, 1.0):.3f} tx_ohm=200",
    ]


def _limit(plan: Plan, phase: str, name: str) -> Limit:
    return next(one for one in plan.for_kind("") if one.name == phase).limits[name]


def _most(plan: Plan, phase: str, name: str) -> float:
    return _limit(plan, phase, name).bounds[1]


def _least(plan: Plan, phase: str, name: str) -> float:
    return _limit(plan, phase, name).bounds[0]


def _axis(rng: random.Random, kind: BoardKind) -> tuple[Axis, list[int]]:
    axis = rng.choice(list(Axis))
    lines = kind.tx if axis is Axis.TX else kind.rx
    return axis, sorted(set(lines.tolist()))


def _open(rng: random.Random, kind: BoardKind, board: str, severity: float, plan: Plan) -> tuple[list[str], Names, str]:
    axis, lines = _axis(rng, kind)
    index = rng.choice(lines)
    stub = min(_least(plan, "electrical", "capacitance") / severity * REST_PF, 1.0)
    effect = f"line open {board} axis={axis} index={index} stub_pf={stub:.4f}"
    return [effect], frozenset({"open line"}), line_name(axis, index)


def _short(
    rng: random.Random, kind: BoardKind, board: str, severity: float, plan: Plan
) -> tuple[list[str], Names, str]:
    axis, lines = _axis(rng, kind)
    index = rng.choice(lines[:-1])
    effect = f"line short {board} axis={axis} index={index} share={rng.uniform(0.3, 0.7):.3f}"
    return [effect], frozenset({"short"}), lines_name(axis, index, index + 1)


def _swapped(
    rng: random.Random, kind: BoardKind, board: str, severity: float, plan: Plan
) -> tuple[list[str], Names, str]:
    axis, lines = _axis(rng, kind)
    first, second = rng.sample(lines, 2)
    effect = f"exchange lines {board} axis={axis} index={first} other={second}"
    return [effect], frozenset({"swapped lines"}), lines_name(axis, first, second)


def _dead(rng: random.Random, kind: BoardKind, board: str, severity: float, plan: Plan) -> tuple[list[str], Names, str]:
    taxel = rng.randrange(kind.taxel_count)
    strength = 1.0 - _least(plan, "presses", "weakest") / severity
    effect = f"dead rest {board} taxel={taxel} strength={max(strength, 0.0):.4f}"
    return [effect], frozenset({"dead taxel"}), taxel_name(taxel)


def _stuck(
    rng: random.Random, kind: BoardKind, board: str, severity: float, plan: Plan
) -> tuple[list[str], Names, str]:
    taxel = rng.randrange(kind.taxel_count)
    effect = f"dead stuck {board} taxel={taxel} value={rng.randrange(6400)}"
    return [effect], frozenset({"dead taxel"}), taxel_name(taxel)


def _gain(form: str) -> Callable[[random.Random, BoardKind, str, float, Plan], tuple[list[str], Names, str]]:
    def draw(
        rng: random.Random, kind: BoardKind, board: str, severity: float, plan: Plan
    ) -> tuple[list[str], Names, str]:
        factor = _least(plan, "presses", "response") / severity / USUAL_COUNTS
        return [f"gain {form} {board} factor={factor:.4f}"], frozenset({"low gain"}), "board"

    return draw


_NOISE: Final = {
    "white noise": ("white", "white", "white noise"),
    "TX line noise": ("line axis=0", "tx", "TX line noise"),
    "RX line noise": ("line axis=1", "rx", "RX line noise"),
    "board noise": ("line axis=2", "board", "board noise"),
    "1/f noise": ("pink", "pink", "1/f noise"),
    "shared 1/f noise": ("pink shared=1", "pink_board", "1/f noise"),
}


def _noise(family: str) -> Callable[[random.Random, BoardKind, str, float, Plan], tuple[list[str], Names, str]]:
    form, limit, name = _NOISE[family]

    def draw(
        rng: random.Random, kind: BoardKind, board: str, severity: float, plan: Plan
    ) -> tuple[list[str], Names, str]:
        counts = severity * _most(plan, "noise", limit)
        return [f"noise {form} {board} counts={counts:.3f}"], frozenset({name}), "board"

    return draw


def _impulses(
    rng: random.Random, kind: BoardKind, board: str, severity: float, plan: Plan
) -> tuple[list[str], Names, str]:
    counts = severity * _most(plan, "noise", "impulse")
    effect = f"noise impulse {board} counts={counts:.3f} rate_hz={rng.uniform(1.0, 10.0):.3f}"
    return [effect], frozenset({"impulses"}), "board"


def _warm_up(
    rng: random.Random, kind: BoardKind, board: str, severity: float, plan: Plan
) -> tuple[list[str], Names, str]:
    form = f"drift warm_up {board} seconds={rng.uniform(30.0, 600.0):.2f}"
    goal = severity * _most(plan, "drift", "board") * TWIN_S / 60.0
    return (
        [_scaled(form, kind, rng, lambda mean, rate: abs(float(mean[-5:].mean() - mean[:5].mean())), goal)],
        (frozenset({"drift"})),
        "board",
    )


def _wander(
    rng: random.Random, kind: BoardKind, board: str, severity: float, plan: Plan
) -> tuple[list[str], Names, str]:
    form = f"drift wander {board} seconds={rng.uniform(1.0, 10.0):.2f}"
    goal = severity * _most(plan, "noise", "wander")

    def change(mean: np.ndarray, rate: float) -> float:
        lag = max(round(WANDER_LAG_S * rate), 1)
        return math.sqrt(float(np.mean((mean[lag:] - mean[:-lag]) ** 2)))

    return [_scaled(form, kind, rng, change, goal)], frozenset({"drift"}), "board"


def _scaled(
    form: str, kind: BoardKind, rng: random.Random, size: Callable[[np.ndarray, float], float], goal: float
) -> str:
    """The line with the `counts` that make its size the goal, by a twin without noise (the same seeds)."""
    trial = 300.0
    seed = rng.randrange(1, 2**31)
    with VirtualWorld(render_text(kind.name, seed, [f"{form} counts={trial}"], noise_counts=0.0)) as world:
        world.run(0.5)
        readout = HubReadout(HubWire(SlowLink(world)), BOARDS[kind.name], kind.taxel_count)
        readout.begin()
        capture = readout.frames(lambda count, seconds: seconds >= TWIN_S)
        found = size(capture.raw_counts.mean(axis=1), (len(capture) - 1) / capture.seconds)
    return f"{form} counts={trial * goal / max(found, 1e-3):.3f} # {seed}"


FAMILIES: Final = (
    Family("open line", True, _open),
    Family("short", False, _short),
    Family("swapped lines", False, _swapped),
    Family("dead taxel", True, _dead),
    Family("stuck taxel", False, _stuck),
    Family("low gain, electrodes", True, _gain("electrode")),
    Family("low gain, current source", True, _gain("idac")),
    *(Family(name, True, _noise(name)) for name in _NOISE),
    Family("impulses", True, _impulses),
    Family("drift, warming up", True, _warm_up),
    Family("drift, wandering", True, _wander),
)


def render_text(kind: str, seed: int, effects: list[str], noise_counts: float = 0.0) -> str:
    """World file of one board of a kind."""
    alone = replace(HAND, boards=(HAND.get_board(BOARDS[kind]),))
    return format_world(alone, WorldSettings(seed=seed, noise_counts=noise_counts, effects=effects))


def draw_case(family: Family | None, number: int, seed: int, severity: float, plan: Plan) -> Case:
    """One board. family None: a healthy one."""
    name = family.name if family else "healthy"
    rng = random.Random(f"{seed} {name} {number} {severity:.3f}")
    kind = HAND.get_board(BOARDS[rng.choice(sorted(BOARDS))]).kind
    effects = healthy_effects(rng)
    world_seed = rng.randrange(1, 2**31)
    if family is None:
        return Case(name, kind.name, world_seed, tuple(effects), frozenset(), "", 0.0)
    lines, names, place = family.draw(rng, kind, f"board=0x{BOARDS[kind.name]:02X}", severity, plan)
    for line in lines:
        body, _, own_seed = line.partition(" # ")
        effects.append(body)
        world_seed = int(own_seed) if own_seed else world_seed
    return Case(name, kind.name, world_seed, tuple(effects), names, place, severity)
