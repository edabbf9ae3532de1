"""A random plan of indentations: objects, approaches that load every board, and the order of the indentations."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taxel.campaign.indentation.errors import IndentationPlanError
from taxel.campaign.indentation.indenters import Indenter, sample_indenters
from taxel.campaign.indentation.placement import PlacementSampler, SkinSurface
from taxel.campaign.indentation.plan import IndentationApproach, IndentationPlan, IndenterMount, order_indentations
from taxel.campaign.indentation.settings import indentation_timeline
from taxel.cloud.contacts import BACK_KIND
from taxel.grasp.timeline import Timeline
from taxel.hand import Hand
from taxel.hand.kinematics import build_kinematics

MIN_APPROACHES_PER_BOARD = 2

PAIR_SHARE = 0.25
"""Share of the approaches that load two neighbouring boards, if the skin has neighbouring boards."""

MAX_ATTEMPTS, MAX_ATTEMPTS_PAIR = 1000, 100
"""Number of samples after which a board is treated as unreachable, and a pair of boards as unsuitable."""

FORCE_N = (4.0, 20.0)
"""Default range of the nominal force of an approach, newtons."""


@dataclass(frozen=True, eq=False)
class IndentationDesign:
    """Size and conditions of an indentation campaign.

    Attributes:
        approaches: number of ways to press.
        sessions: number of sessions; every approach occurs in each.
        repeats: indentations per approach and session.
        objects: number of sampled objects.
        force_n: smallest and largest nominal force, newtons.
        mount: springs that carry the object.
        timeline: phases of one indentation; None: `indentation_timeline` of the hand.
        joints: joint angles f64[j] at which the rig holds the hand, radians; None: 0, clipped to the joint limits.
    """

    approaches: int = 8
    sessions: int = 6
    repeats: int = 2
    objects: int = 3
    force_n: tuple[float, float] = FORCE_N
    mount: IndenterMount = field(default_factory=IndenterMount)
    timeline: Timeline | None = None
    joints: ArrayLike | None = None

    def __post_init__(self) -> None:
        """Check that the counts are at least 1 and the forces above 0. Raises IndentationPlanError."""
        for name in ("approaches", "sessions", "repeats", "objects"):
            value = getattr(self, name)
            if value < 1:
                raise IndentationPlanError(name, "at least 1", str(value))
        if not 0.0 < self.force_n[0] <= self.force_n[1] < np.inf:
            expected = "two forces above 0 newtons, the smaller one first"
            raise IndentationPlanError("force_n", expected, str(self.force_n))


def sample_indentation_plan(hand: Hand, seed: int, design: IndentationDesign | None = None) -> IndentationPlan:
    """Sample an indentation plan with random objects and approaches on the skin of `hand`.

    Boards on the back of the hand, and boards that no object reaches, are not loaded; every other board is loaded by at
    least `MIN_APPROACHES_PER_BOARD` approaches. design: size and conditions of the campaign; None: the default ones.
    Raises IndentationPlanError for a design that is not feasible, such as one with too few approaches for the boards.
    """
    design = design or IndentationDesign()
    rng = np.random.default_rng(seed)
    surface = SkinSurface.of(hand, _bracket_poses(hand, design.joints))
    indenters = sample_indenters(rng, design.objects)
    placement = PlacementSampler(surface, design.mount, rng)
    approaches = _ApproachSampler(placement, indenters, design.force_n, rng).sample(design.approaches)
    return IndentationPlan(
        hand,
        surface.bracket_poses,
        {indenter.item.name: indenter.item for indenter in indenters},
        approaches,
        order_indentations(approaches, design.sessions, design.repeats, rng),
        design.timeline or indentation_timeline(hand),
        design.mount,
    )


def _bracket_poses(hand: Hand, joints: ArrayLike | None) -> NDArray[np.float64]:
    """Compute the poses f64[s, 4, 4] of the board brackets, world, for joint angles f64[j], radians.

    joints: None: the permitted angles that are nearest to zero.
    """
    kinematics = build_kinematics(hand)
    robot = kinematics.robot
    angles = np.clip(np.zeros(len(robot.joint_names)), robot.lower, robot.upper) if joints is None else joints
    return kinematics.compute_sensor_poses(angles)


class _ApproachSampler:
    """Samples approaches one after another, each for the boards that have the fewest approaches so far."""

    def __init__(
        self,
        placement: PlacementSampler,
        indenters: Sequence[Indenter],
        force_n: tuple[float, float],
        rng: np.random.Generator,
    ) -> None:
        """Create a sampler of approaches that load the boards of a hand evenly.

        placement: samples the pose of an object on a board. indenters: objects to press into the skin. force_n:
        smallest and largest force, newtons. rng: source of the random numbers.
        """
        self._placement, self._indenters, self._force, self._rng = placement, indenters, force_n, rng
        self._hand = placement.surface.hand
        boards = [index for index, board in enumerate(self._hand.boards) if BACK_KIND not in board.kind.name]
        self._approaches_of = dict.fromkeys(boards, 0)
        self._pairs = placement.surface.neighbours(boards)
        self._approaches: list[IndentationApproach] = []

    def sample(self, count: int) -> tuple[IndentationApproach, ...]:
        """Sample `count` approaches and name them "press_1", "press_2" ... in random order.

        The share `PAIR_SHARE` of them loads pairs of neighbouring boards, if there are suitable pairs. Raises
        IndentationPlanError if no object reaches any board, or if `count` is too small for the reachable boards.
        """
        pairs = round(PAIR_SHARE * count)
        while len(self._approaches) < pairs and self._pairs:
            pair = min(
                self._pairs,
                key=lambda boards: (sum(self._approaches_of[board] for board in boards), self._rng.random()),
            )
            if not self._add(pair):
                self._pairs.remove(pair)
        while len(self._approaches) < count:
            if not self._approaches_of:
                raise IndentationPlanError("hand", "a board that an object reaches", f"none on {self._hand.name!r}")
            board = min(self._approaches_of, key=lambda board: (self._approaches_of[board], self._rng.random()))
            if not self._add((board,)):
                del self._approaches_of[board]  # practically unreachable
        fewest = min(self._approaches_of.values())
        if fewest < MIN_APPROACHES_PER_BOARD:
            needed = MIN_APPROACHES_PER_BOARD * len(self._approaches_of)
            expected = f"at least {needed} for {len(self._approaches_of)} boards"
            raise IndentationPlanError("approaches", expected, str(count))
        order = self._rng.permutation(count).tolist()
        return tuple(
            replace(self._approaches[index], name=f"press_{number}") for number, index in enumerate(order, start=1)
        )

    def _add(self, boards: tuple[int, ...]) -> bool:
        """Sample an approach that loads `boards`, and add it; return False if no suitable approach was found.

        boards: indices of one board or of two neighbouring boards.
        """
        used = [approach.object for approach in self._approaches]
        for attempt in range(MAX_ATTEMPTS if len(boards) == 1 else MAX_ATTEMPTS_PAIR):
            # The least used object comes first; the next one is tried if ten samples of an object are unsuitable.
            order = sorted(self._indenters, key=lambda indenter: (used.count(indenter.item.name), self._rng.random()))
            indenter = order[(attempt // 10) % len(order)]
            force = float(np.exp(self._rng.uniform(*np.log(self._force))))
            approach = self._placement.sample(indenter, boards, force)
            if approach is not None:
                self._approaches.append(approach)
                for board in boards:
                    self._approaches_of[board] += 1
                return True
        return False
