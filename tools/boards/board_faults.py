"""Emulated boards for the detection campaign: healthy boards with tolerances, and single faults of a given severity.

The severity of a fault is the factor by which it exceeds the limit of the plan, according to the physics of the
emulator (firmware/emulator/README.md). A short, a stuck taxel and swapped lines have no severity. Random quantities
(drift) are measured on a twin of the board without noise, and scaled.
"""

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
from taxel.types import FloatArray
from taxel_tools.bench.analysis.fault import Axis, format_line_name, format_line_pair_name, format_taxel_name
from taxel_tools.bench.readout import HubReadout
from taxel_tools.testing.plan import Plan
from taxel_tools.testing.record import Limit
from taxel_tools.wires import HubWire

HAND: Final = load_hand("original")
BOARDS: Final = {board.kind.name: board.address for board in HAND.boards}
"""Address of one board of each kind."""
REST_PF: Final = 1.5
"""Capacitance of an emulated crossing at rest, including the fringe capacitance."""
SIGNAL_COUNTS: Final = 730.0
"""Signal of an indentation of 1 N on an emulated taxel without tolerances."""
TWIN_S: Final = 13.0
MEAN_CHANGE_LAG_S: Final = 0.25

POLL_S: Final = 0.01
"""Interval between reads of the link, five times the usual interval, which halves the computing time of a test."""

Names = frozenset[str]
SampledFault = tuple[list[str], Names, str]
"""Lines of the world file, possible names of the fault, place of the fault."""
Sampler = Callable[[random.Random, BoardKind, str, float, Plan], SampledFault]
"""Samples a fault from: random generator, kind of the board, board in the world file, severity, test plan."""


class SlowLink(VirtualMemoryLink):
    """The hub's UART, read in pieces of 10 ms. The time stamps of the frames are unaffected."""

    def read(self, timeout_s: float) -> Chunk | None:
        """Let the emulated world run for 10 ms, at most for `timeout_s`, then read its bytes as `Link.read` does."""
        wait = min(timeout_s, POLL_S)
        if wait > 0.0:
            self.world.run(wait)
        return super().read(timeout_s - wait)


@dataclass(frozen=True)
class Case:
    """An emulated board to test.

    `family`: name of the family of faults, or "healthy". `kind`: board kind. `seed`: seed of the world file.
    `effects`: lines of the world file. `names`: names under which the fault may be reported; `place`: place of the
    fault; both empty for a healthy board. `severity`: factor beyond the limit of the plan; 0 for a healthy board.
    """

    family: str
    kind: str
    seed: int
    effects: tuple[str, ...]
    names: Names
    place: str
    severity: float


@dataclass(frozen=True)
class Family:
    """A family of faults.

    `is_graded`: the faults have a severity; otherwise they are present or absent. `sample`: samples one fault.
    """

    name: str
    is_graded: bool
    sample: Sampler


def sample_healthy_effects(rng: random.Random) -> list[str]:
    """Sample the tolerances of a healthy board, as lines of a world file.

    The lines describe gains of electrodes and current sources, the layer's modulus, noise, warm-up drift, and coupling
    between traces. The axis of line noise is 0 for TX lines, 1 for RX lines, 2 for the whole board.
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


def _get_limit(plan: Plan, phase: str, name: str) -> Limit:
    """Return the limit of a measurement of a phase in the test plan."""
    return next(planned for planned in plan.enabled_phases("") if planned.name == phase).limits[name]


def _get_upper_limit(plan: Plan, phase: str, name: str) -> float:
    return _get_limit(plan, phase, name).bounds[1]


def _get_lower_limit(plan: Plan, phase: str, name: str) -> float:
    return _get_limit(plan, phase, name).bounds[0]


def _sample_axis(rng: random.Random, kind: BoardKind) -> tuple[Axis, list[int]]:
    """Sample whether a fault concerns a TX or an RX line.

    Returns the axis and the numbers of all lines of the board on this axis.
    """
    axis = rng.choice(list(Axis))
    lines = kind.tx if axis is Axis.TX else kind.rx
    return axis, sorted(set(lines.tolist()))


def _sample_open_line(rng: random.Random, kind: BoardKind, board: str, severity: float, plan: Plan) -> SampledFault:
    """Sample an interrupted TX or RX line. The higher the severity, the smaller the capacitance that remains.

    The limit of the test plan is a share of the median capacitance of the board, which is `REST_PF` at rest. The
    emulator permits a stub of at most 1 pF.
    """
    axis, lines = _sample_axis(rng, kind)
    index = rng.choice(lines)
    stub = min(_get_lower_limit(plan, "electrical", "capacitance") / severity * REST_PF, 1.0)
    effect = f"line open {board} axis={axis} index={index} stub_pf={stub:.4f}"
    return [effect], frozenset({"open line"}), format_line_name(axis, index)


def _sample_short(rng: random.Random, kind: BoardKind, board: str, severity: float, plan: Plan) -> SampledFault:
    """Sample two neighbouring TX or RX lines that are shorted."""
    axis, lines = _sample_axis(rng, kind)
    index = rng.choice(lines[:-1])
    effect = f"line short {board} axis={axis} index={index} share={rng.uniform(0.3, 0.7):.3f}"
    return [effect], frozenset({"short"}), format_line_pair_name(axis, index, index + 1)


def _sample_swapped_lines(rng: random.Random, kind: BoardKind, board: str, severity: float, plan: Plan) -> SampledFault:
    """Sample two TX or RX lines that are connected in the wrong order."""
    axis, lines = _sample_axis(rng, kind)
    first, second = rng.sample(lines, 2)
    effect = f"exchange lines {board} axis={axis} index={first} other={second}"
    return [effect], frozenset({"swapped lines"}), format_line_pair_name(axis, first, second)


def _sample_dead_taxel(rng: random.Random, kind: BoardKind, board: str, severity: float, plan: Plan) -> SampledFault:
    """Sample one taxel with a reduced response.

    With severity 1, the response equals the lower limit of the test plan.
    """
    taxel = rng.randrange(kind.taxel_count)
    strength = 1.0 - _get_lower_limit(plan, "presses", "weakest") / severity
    effect = f"dead rest {board} taxel={taxel} strength={max(strength, 0.0):.4f}"
    return [effect], frozenset({"dead taxel"}), format_taxel_name(taxel)


def _sample_stuck_taxel(rng: random.Random, kind: BoardKind, board: str, severity: float, plan: Plan) -> SampledFault:
    """Sample one taxel whose raw count is constant."""
    taxel = rng.randrange(kind.taxel_count)
    effect = f"dead stuck {board} taxel={taxel} value={rng.randrange(6400)}"
    return [effect], frozenset({"dead taxel"}), format_taxel_name(taxel)


def _make_gain_sampler(component: str) -> Sampler:
    """Create a sampler of a gain that is too low for the whole board.

    component: part of the board with the low gain, "electrode" or "idac".
    """

    def sample(rng: random.Random, kind: BoardKind, board: str, severity: float, plan: Plan) -> SampledFault:
        """Sample the low gain. With severity 1, the median response equals the lower limit of the test plan."""
        factor = _get_lower_limit(plan, "presses", "response") / severity / SIGNAL_COUNTS
        return [f"gain {component} {board} factor={factor:.4f}"], frozenset({"low gain"}), "board"

    return sample


_NOISE: Final = {
    "white noise": ("white", "white", "white noise"),
    "TX line noise": ("line axis=0", "tx", "TX line noise"),
    "RX line noise": ("line axis=1", "rx", "RX line noise"),
    "board noise": ("line axis=2", "board", "board noise"),
    "1/f noise": ("pink", "pink", "1/f noise"),
    "shared 1/f noise": ("pink shared=1", "pink_board", "1/f noise"),
}


def _make_noise_sampler(family: str) -> Sampler:
    """Create a sampler of noise on the whole board. family: kind of noise, a key of `_NOISE`."""
    effect, limit, name = _NOISE[family]

    def sample(rng: random.Random, kind: BoardKind, board: str, severity: float, plan: Plan) -> SampledFault:
        """Sample noise. With severity 1, its standard deviation equals the limit of the test plan."""
        counts = severity * _get_upper_limit(plan, "noise", limit)
        return [f"noise {effect} {board} counts={counts:.3f}"], frozenset({name}), "board"

    return sample


def _sample_impulses(rng: random.Random, kind: BoardKind, board: str, severity: float, plan: Plan) -> SampledFault:
    """Sample impulse noise on the whole board, with 1 to 10 impulses per second."""
    counts = severity * _get_upper_limit(plan, "noise", "impulse")
    effect = f"noise impulse {board} counts={counts:.3f} rate_hz={rng.uniform(1.0, 10.0):.3f}"
    return [effect], frozenset({"impulses"}), "board"


def _sample_warm_up(rng: random.Random, kind: BoardKind, board: str, severity: float, plan: Plan) -> SampledFault:
    """Sample the drift of a board that warms up. With severity 1, the drift equals the limit of the test plan."""
    effect = f"drift warm_up {board} seconds={rng.uniform(30.0, 600.0):.2f}"
    # The limit of the test plan is a drift per minute; the drift is measured over `TWIN_S` seconds.
    target = severity * _get_upper_limit(plan, "drift", "board") * TWIN_S / 60.0

    def measure(mean: FloatArray, rate_hz: float) -> float:
        """Return the absolute change of the board's mean raw count f64[T] between its first and last five frames."""
        return abs(float(mean[-5:].mean() - mean[:5].mean()))

    return [_scale_drift(effect, kind, rng, measure, target)], frozenset({"drift"}), "board"


def _sample_random_drift(rng: random.Random, kind: BoardKind, board: str, severity: float, plan: Plan) -> SampledFault:
    """Sample a random drift of the whole board.

    With severity 1, the change of the mean raw count equals the limit of the test plan.
    """
    effect = f"drift wander {board} seconds={rng.uniform(1.0, 10.0):.2f}"
    target = severity * _get_upper_limit(plan, "noise", "wander")

    def measure(mean: FloatArray, rate_hz: float) -> float:
        """Return the RMS change of the board's mean raw count f64[T] within the lag `MEAN_CHANGE_LAG_S`."""
        lag = max(round(MEAN_CHANGE_LAG_S * rate_hz), 1)
        return math.sqrt(float(np.mean((mean[lag:] - mean[:-lag]) ** 2)))

    return [_scale_drift(effect, kind, rng, measure, target)], frozenset({"drift"}), "board"


def _scale_drift(
    effect: str, kind: BoardKind, rng: random.Random, measure: Callable[[FloatArray, float], float], target: float
) -> str:
    """Return the world-file line of a random drift that has the size `target`, with its seed as a comment.

    effect: the line without its parameter `counts`. measure: returns the size of a drift from the mean raw count
    f64[T], T frames, and the frame rate in Hz. The size depends on the seed, so it is measured over `TWIN_S` on a board
    without noise and with the same seed; `counts` is then scaled by the ratio.
    """
    trial_counts = 300.0
    seed = rng.randrange(1, 2**31)
    with VirtualWorld(build_world(kind.name, seed, [f"{effect} counts={trial_counts}"], noise_counts=0.0)) as world:
        world.run(0.5)
        readout = HubReadout(HubWire(SlowLink(world)), BOARDS[kind.name], kind.taxel_count)
        readout.start()
        capture = readout.read_frames(lambda count, seconds: seconds >= TWIN_S)
        measured = measure(capture.raw_counts.mean(axis=1), (len(capture) - 1) / capture.seconds)
    return f"{effect} counts={trial_counts * target / max(measured, 1e-3):.3f} # {seed}"


FAMILIES: Final = (
    Family("open line", True, _sample_open_line),
    Family("short", False, _sample_short),
    Family("swapped lines", False, _sample_swapped_lines),
    Family("dead taxel", True, _sample_dead_taxel),
    Family("stuck taxel", False, _sample_stuck_taxel),
    Family("low gain, electrodes", True, _make_gain_sampler("electrode")),
    Family("low gain, current source", True, _make_gain_sampler("idac")),
    *(Family(name, True, _make_noise_sampler(name)) for name in _NOISE),
    Family("impulses", True, _sample_impulses),
    Family("drift, warm-up", True, _sample_warm_up),
    Family("drift, random walk", True, _sample_random_drift),
)


def build_world(kind: str, seed: int, effects: list[str], noise_counts: float = 0.0) -> str:
    """Return the world file of one board of a kind, with the given effects (lines of the world file)."""
    single_board_hand = replace(HAND, boards=(HAND.get_board(BOARDS[kind]),))
    return format_world(single_board_hand, WorldSettings(seed=seed, noise_counts=noise_counts, effects=effects))


def sample_case(family: Family | None, number: int, seed: int, severity: float, plan: Plan) -> Case:
    """Sample one board with a fault of a family, or a healthy board if `family` is None.

    The result depends only on the family, `number`, `seed` and `severity`. A random drift keeps the world seed for
    which its size was measured.
    """
    name = family.name if family else "healthy"
    rng = random.Random(f"{seed} {name} {number} {severity:.3f}")
    kind = HAND.get_board(BOARDS[rng.choice(sorted(BOARDS))]).kind
    effects = sample_healthy_effects(rng)
    world_seed = rng.randrange(1, 2**31)
    if family is None:
        return Case(name, kind.name, world_seed, tuple(effects), frozenset(), "", 0.0)
    lines, names, place = family.sample(rng, kind, f"board=0x{BOARDS[kind.name]:02X}", severity, plan)
    for line in lines:
        effect, _, twin_seed = line.partition(" # ")
        effects.append(effect)
        world_seed = int(twin_seed) if twin_seed else world_seed
    return Case(name, kind.name, world_seed, tuple(effects), names, place, severity)
