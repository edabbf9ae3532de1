"""A small grasp campaign on the whole hand with hidden causes, for the demonstration."""

import secrets
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

import numpy as np

from taxel.blind.catalogue_causes import EFFECT_NAMES, list_cause_types, sample_nuisance_lines
from taxel.blind.cause_sizes import CauseSizes
from taxel.blind.cause_types import format_board_argument
from taxel.blind.hidden import Cause, HiddenCauses
from taxel.blind.loaded_locations import SimulatedLoads
from taxel.blind.world_datasets import UndescribedSettings
from taxel.campaign.emulated import run_emulated
from taxel.campaign.performed_grasp import GraspMemory
from taxel.campaign.progress import Progress, no_progress
from taxel.campaign.simulated import SimSettings, run_simulated
from taxel.grasp.plan import PlannedGrasp, make_thesis_plan
from taxel.hand import Hand, load_hand

KIND_SHARES: Final = {"single": 0.8, "several": 0.1, "none": 0.1}
"""Shares of worlds with one hidden cause, with two, and without one."""

STRENGTH: Final = (0.9, 1.0)
"""Range of the strength; at strength 1 the root of the excess of indentations is six floors."""

LOADED_SHARE: Final = 0.2
"""Smallest share of the total simulated signal on the boards of a cause that acts only on some boards: a cause has no
consequence where the grasps do not load the skin. A fault at a location needs one loaded taxel there."""

MOST_SAMPLES: Final = 1000
"""Number of samples of a cause after which the last sample is used even if the grasps do not load its location."""

APPROACHES_PER_OBJECT, SESSIONS, SIM_REPEATS = 2, 6, 8
"""Number of approaches of each object, of sessions of the emulated hand, and of simulated repeats of each approach."""


@dataclass(frozen=True)
class GraspWorld:
    """The world of a demonstration. seed: seed of campaign and physics. salt: 256 random bits, hexadecimal."""

    seed: int
    hidden: HiddenCauses
    salt: str

    def to_json(self) -> dict[str, object]:
        """Return the world of a demonstration, with its hidden cause and its salt, as the sealed JSON values."""
        return {"seed": self.seed, "hidden": self.hidden.to_json(), "salt": self.salt}


class GraspWorldSampler:
    """Samples a world of the demonstration: an emulated Allegro hand with a random hidden cause, two, or none.

    Every effect of the diagnosis's catalogue is equally probable, and so is every functional form of an effect.

    Attributes:
        campaign_seed: seed of the grasps, which are simulated before the parameters of the causes are sampled.
        kind: kind of the world, a key of `KIND_SHARES`.
        types: types of the hidden causes.
    """

    def __init__(self, seed: int | None = None) -> None:
        """Sample kind and types of the causes. seed: None: random numbers of the operating system."""
        rng = self._rng = np.random.default_rng(secrets.randbits(256) if seed is None else seed)
        self._is_secret = seed is None
        self.campaign_seed = int(rng.integers(2**31))
        self.kind = str(rng.choice(list(KIND_SHARES), p=list(KIND_SHARES.values())))
        number = {"none": 0, "single": 1, "several": 2}[self.kind]
        names = [EFFECT_NAMES[index] for index in rng.choice(len(EFFECT_NAMES), number, replace=False).tolist()]
        types = [list_cause_types(name) for name in names]
        self.types = tuple(own[int(rng.integers(len(own)))] for own in types)

    def sample(self, loads: SimulatedLoads) -> GraspWorld:
        """Sample the parameters of the hidden causes, and the deviations that every skin has.

        loads: largest signals of the simulated grasps of this world. A cause on some boards or lines is sampled again
        until the grasps load these boards or lines.
        """
        causes = tuple(
            self.sample_cause(number, loads, float(self._rng.uniform(*STRENGTH))) for number in range(len(self.types))
        )
        salt = secrets.token_hex(32) if self._is_secret else self._rng.bytes(32).hex()
        return GraspWorld(self.campaign_seed, HiddenCauses(self.kind, causes, sample_nuisance_lines(self._rng)), salt)

    def sample_cause(self, number: int, loads: SimulatedLoads, strength: float) -> Cause:
        """Sample the parameters of a cause until its boards or locations are loaded, at most `MOST_SAMPLES` times.

        number: index of the cause type in `types`. strength: at 1, the cause produces an excess (squared gap minus
        squared floor) whose root is six floors in a campaign of indentations.
        """
        hand = load_hand("original")
        for _ in range(MOST_SAMPLES):
            cause = self.types[number].sample(self._rng, hand, strength)
            boards = find_boards(cause, hand)
            if cause.locations:
                has_load = bool(loads.select_loaded(cause.locations))
            else:
                has_load = not boards or loads.compute_board_share(boards) >= LOADED_SHARE
            if has_load:
                break
        return cause


def find_boards(cause: Cause, hand: Hand) -> frozenset[int]:
    """Find the I2C addresses of the boards that the effect lines of a cause name; empty for a cause of the whole
    hand.
    """
    words = {word for line in cause.lines for word in line.split()}
    return frozenset(
        board.address for board in hand.boards if format_board_argument(board) in words or board.name in words
    )


def make_small_plans(
    seed: int, approaches: int = APPROACHES_PER_OBJECT, sessions: int = SESSIONS
) -> tuple[tuple[PlannedGrasp, ...], tuple[PlannedGrasp, ...]]:
    """Make the plans of the emulated hand and of the simulator, with some random approaches of every object.

    The hand performs each approach once in each session: the first repeat of the thesis plan. The simulator performs
    each approach `SIM_REPEATS` times. A condition is a pair of object and approach.
    """
    rng = np.random.default_rng(seed)
    plan = make_thesis_plan(seed)
    conditions = set()
    for item in sorted({planned.object for planned in plan}):
        names = sorted({planned.approach for planned in plan if planned.object == item})
        indices = rng.choice(len(names), min(approaches, len(names)), replace=False).tolist()
        conditions |= {(item, names[index]) for index in indices}
    grasps = [
        planned for planned in plan if (planned.object, planned.approach) in conditions and planned.session < sessions
    ]
    # A dictionary keeps the last value of a key: the reversed order keeps the first repeat of each session.
    first_of_session = {(planned.object, planned.approach, planned.session): planned for planned in reversed(grasps)}
    real = tuple(
        planned for planned in grasps if first_of_session[planned.object, planned.approach, planned.session] is planned
    )
    last_of_condition = {(planned.object, planned.approach): planned for planned in real}
    sim = tuple(
        replace(planned, id=f"{index:02d}_{planned.object}_{planned.approach}_{number}", iteration=number, session=0)
        for index, planned in enumerate(last_of_condition.values())
        for number in range(SIM_REPEATS)
    )
    return real, sim


def simulate_grasps(campaign_seed: int, sim: Path, progress: Progress = no_progress, jobs: int | None = None) -> None:
    """Run the simulated grasps of a world and write them to `sim`.

    jobs: number of processes; None: one per core. Raises TaxelError with a one-line message.
    """
    plan = make_small_plans(campaign_seed)[1]
    run_simulated(sim, plan, SimSettings(seed=campaign_seed + 1), jobs=jobs, progress=progress)


def emulate_grasps(
    world: GraspWorld,
    path: Path,
    progress: Progress = no_progress,
    jobs: int | None = None,
    memory: GraspMemory | None = None,
    *,
    causes: Sequence[Cause] | None = None,
    plan: Sequence[PlannedGrasp] | None = None,
) -> None:
    """Run grasps of a world on the emulated hand and write them to `path`.

    The placeholder OBJECT in an effect line is replaced by the first object of the world's plan. jobs: number of
    processes; None: one per core. memory: grasps that need not be performed again; None: none. causes: subset of the
    world's causes; None: all. plan: the grasps; None: those of all sessions. Raises TaxelError.
    """
    whole_plan = make_small_plans(world.seed)[0]
    hidden = world.hidden if causes is None else replace(world.hidden, causes=tuple(causes))
    effects = tuple(line.replace(" OBJECT ", f" {whole_plan[0].object} ") for line in hidden.lines)
    settings = UndescribedSettings(seed=world.seed, effects=effects)
    grasps = whole_plan if plan is None else plan
    run_emulated(path, grasps, settings, jobs=jobs, progress=progress, memory=memory)


def list_first_session(seed: int) -> tuple[PlannedGrasp, ...]:
    """List the grasps of the emulated hand in the first session. seed: of the campaign."""
    plan = make_small_plans(seed)[0]
    session = min(planned.session for planned in plan)
    return tuple(planned for planned in plan if planned.session == session)


def measure_sizes(
    world: GraspWorld,
    real: Path,
    without_all: Path,
    cause_sizes: CauseSizes,
    progress: Progress = no_progress,
    jobs: int | None = None,
    memory: GraspMemory | None = None,
) -> tuple[float, ...]:
    """Measure the gap that each hidden cause alone produces, in floors.

    real: dataset of the world. without_all: first session without any cause; it is sufficient for a single cause.
    cause_sizes: measures the sizes with the simulated dataset of the world. memory: grasps that need not be performed
    again. For one of several causes, the grasps of the first session are repeated without this cause; all other random
    numbers are equal. Raises TaxelError with a one-line message.
    """
    if len(world.hidden.causes) == 1:
        return (cause_sizes.measure(real, without_all),)
    first = list_first_session(world.seed)
    total, sizes = len(world.hidden.causes) * len(first), []
    for number, cause in enumerate(world.hidden.causes):

        def show(done: int, _: int, before: int = number * len(first)) -> None:
            """Report the progress over all causes. done: number of finished grasps without the present cause."""
            progress(before + done, total)

        others = tuple(other for other in world.hidden.causes if other is not cause)
        with TemporaryDirectory(prefix="taxel-demo-") as folder:
            without = Path(folder) / "without.h5"
            emulate_grasps(world, without, show, jobs, memory, causes=others, plan=first)
            sizes.append(cause_sizes.measure(real, without))
    return tuple(sizes)
